"""A nonlinear program in NLopt's form: equations ``c(x) = 0`` and inequalities ``d(x) <= 0`` with dense Jacobians."""

from __future__ import annotations

from typing import Any

import numpy as np

from stc.solver.nlp import NLP, Floats
from stc.solver.residuals import signed_violations
from stc.solver.scaled_problem import relative_violation

__all__ = ["CONSTRAINT_TOLERANCE", "Functions"]

CONSTRAINT_TOLERANCE = 1e-9
ORDINARY = (1e-3, 1e2)
USUAL = (1e-2, 1e3)
MOST = 1e8


class Functions:
    """The problem in NLopt's form: free variables only, each point evaluated once."""

    def __init__(self, nlp: NLP, x: Floats, scaling: bool) -> None:
        self.nlp = nlp
        self.objective_scale, self.row_scale, self.x_scale = 1.0, np.ones(nlp.m), np.ones(nlp.n)
        if scaling:
            self.x_scale = _variable_scales(nlp, x)
            self.objective_scale, self.row_scale = _gradient_scales(nlp, x, self.x_scale)
        self.free = np.flatnonzero(nlp.x_lower != nlp.x_upper)
        self.unit = self.x_scale[self.free]
        self.x = x.copy()
        self.lower, self.upper = nlp.x_lower[self.free] / self.unit, nlp.x_upper[self.free] / self.unit
        bounded = np.isfinite(nlp.row_lower) | np.isfinite(nlp.row_upper)
        equal = (nlp.row_lower == nlp.row_upper) & bounded
        self.equal = np.flatnonzero(equal)
        self.above = np.flatnonzero(~equal & np.isfinite(nlp.row_upper))
        self.below = np.flatnonzero(~equal & np.isfinite(nlp.row_lower))
        self.f, self.r = 0.0, np.zeros(nlp.m)
        self.gradient, self.jac = np.zeros(nlp.n), np.zeros(len(nlp.jac_rows))
        self._valued = self._derived = b""
        sign = np.concatenate([np.ones(len(self.above)), -np.ones(len(self.below))])
        sign *= self.row_scale[np.concatenate([self.above, self.below])]
        self._equality_entries = self._entries([self.equal], self.row_scale[self.equal])
        self._inequality_entries = self._entries([self.above, self.below], sign)

    def _entries(self, parts: list[Any], sign: Floats) -> tuple[Any, Any, Any, Floats]:
        """The position of each Jacobian entry in a dense matrix of these rows and the free variables."""
        nlp = self.nlp
        column = np.full(nlp.n, -1)
        column[self.free] = np.arange(len(self.free))
        source, line = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
        at = 0
        for part in parts:
            place = np.full(nlp.m, -1)
            place[part] = at + np.arange(len(part))
            mine = np.flatnonzero((place[nlp.jac_rows] >= 0) & (column[nlp.jac_cols] >= 0))
            source.append(mine)
            line.append(place[nlp.jac_rows[mine]])
            at += len(part)
        entry, row = np.concatenate(source), np.concatenate(line)
        return entry, row, column[nlp.jac_cols[entry]], sign[row] * self.x_scale[nlp.jac_cols[entry]]

    def inside(self, x: Floats) -> Floats:
        """The free variables of ``x`` (n,) as NLopt counts them, moved inside their bounds."""
        return np.clip(x[self.free] / self.unit, self.lower, self.upper)

    def outside(self, z: Floats) -> Floats:
        """All variables (n,) for NLopt's, moved inside their bounds."""
        x = self.x.copy()
        x[self.free] = z * self.unit
        return np.clip(x, self.nlp.x_lower, self.nlp.x_upper)

    def move(self, z: Floats) -> bool:
        """Go to free variables ``z``; True if the point is new."""
        key = z.tobytes()
        if key == self._valued:
            return False
        self.x[self.free] = z * self.unit
        self.f, r = self.nlp.values(self.x)
        self.r = r.copy()
        self._valued = key
        return True

    def derive(self, z: Floats) -> bool:
        """Compute derivatives at ``z``; True if they are new."""
        self.move(z)
        key = z.tobytes()
        if key == self._derived:
            return False
        gradient, jac, _ = self.nlp.derivatives(self.x, np.zeros(self.nlp.m), 0.0)
        self.gradient, self.jac = gradient.copy(), jac.copy()
        self._derived = key
        return True

    def equalities(self, out: Floats, matrix: Floats) -> None:
        """Values and dense Jacobian of the equations."""
        out[:] = self.row_scale[self.equal] * (self.r[self.equal] - self.nlp.row_upper[self.equal])
        _fill(matrix, self.jac, self._equality_entries)

    def inequalities(self, out: Floats, matrix: Floats) -> None:
        """Values and dense Jacobian of the inequalities, upper bounds first."""
        nlp, high, low = self.nlp, self.above, self.below
        out[: len(high)] = self.row_scale[high] * (self.r[high] - nlp.row_upper[high])
        out[len(high) :] = self.row_scale[low] * (nlp.row_lower[low] - self.r[low])
        _fill(matrix, self.jac, self._inequality_entries)

    def tolerances(self, bounds: Floats, rows: Any) -> Floats:
        """Violations of rows that NLopt may ignore, in its units."""
        size = np.maximum(1.0, np.abs(bounds[rows]))
        return np.asarray(CONSTRAINT_TOLERANCE * self.row_scale[rows] * size)

    def slope(self) -> Floats:
        """Gradient of the objective in NLopt's units."""
        return np.asarray(self.objective_scale * self.unit * self.gradient[self.free])

    def squares(self) -> float:
        """Half the sum of the squared violations of the rows, in NLopt's units."""
        over = self._over()
        return 0.5 * float(over @ over)

    def squares_slope(self) -> Floats:
        """Gradient of :meth:`squares`."""
        nlp = self.nlp
        terms = self.jac * (self.row_scale * self._over())[nlp.jac_rows]
        return np.bincount(nlp.jac_cols, weights=terms, minlength=nlp.n)[self.free] * self.unit

    def _over(self) -> Floats:
        return np.asarray(self.row_scale * signed_violations(self.nlp, self.r))

    def violation(self) -> float:
        """Largest relative violation of a row at the current point."""
        rows = relative_violation(self.r, self.nlp.row_lower, self.nlp.row_upper)
        bounds = relative_violation(self.x, self.nlp.x_lower, self.nlp.x_upper)
        return max(float(rows.max(initial=0.0)), float(bounds.max(initial=0.0)))


def _fill(matrix: Floats, jac: Floats, entries: tuple[Any, Any, Any, Floats]) -> None:
    """A dense matrix from the entries of the Jacobian, each with its factor; an empty matrix is not wanted."""
    if matrix.size:
        entry, row, col, factor = entries
        matrix[:] = 0.0
        matrix[row, col] = factor * jac[entry]


def _variable_scales(nlp: NLP, x: Floats) -> Floats:
    """Scale factors (n,) for very large or small variables."""
    with np.errstate(invalid="ignore"):
        span = nlp.x_upper - nlp.x_lower
    narrow = np.isfinite(span) & (span > 0.0) & (span < USUAL[0])
    wide = np.abs(x) > USUAL[1]
    units = np.where(narrow, span, np.where(wide, np.abs(x), 1.0))
    return np.exp2(np.round(np.log2(units)))


def _gradient_scales(nlp: NLP, x: Floats, x_scale: Floats) -> tuple[float, Floats]:
    """Scale factors for the objective and the rows (m,) with very large or small gradients at ``x`` (n,)."""
    gradient, jac, _ = nlp.derivatives(x, np.zeros(nlp.m), 0.0)
    rows = np.zeros(nlp.m)
    np.maximum.at(rows, nlp.jac_rows, np.abs(jac * x_scale[nlp.jac_cols]))
    return float(_factors(np.abs(gradient * x_scale).max(initial=0.0, keepdims=True))[0]), _factors(rows)


def _factors(size: Floats) -> Floats:
    factors = np.ones_like(size)
    odd = np.isfinite(size) & (size > 0.0) & ((size < ORDINARY[0]) | (size > ORDINARY[1]))
    factors[odd] = np.clip(1.0 / size[odd], 1.0 / MOST, MOST)
    return factors
