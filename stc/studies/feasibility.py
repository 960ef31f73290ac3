"""Whether some of a spec's statements can hold together: two nonlinear programs without the objective.

:class:`FeasibilityProblem` is the spec's own program with the other statements left out.  :class:`ElasticProblem` is
that with every row elastic, so that it always has a feasible point:

    minimise  sum(p + q)    subject to   lower <= r(x) + D (q - p) <= upper,   p, q >= 0,   bounds as they are

D scales the rows.  The minimum is zero if the statements can hold together near the start, and otherwise the least
violation (the elastic filter: J. W. Chinneck, Feasibility and Infeasibility in Optimization, 2008).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from stc.transcription.bind import BoundProgram
from stc.transcription.ownership import Ownership

FloatArray = NDArray[np.float64]

__all__ = ["ElasticProblem", "FeasibilityProblem"]

SIZES = (1e-3, 1e3)
"""The range within which rows are scaled to one size; those outside are scaled by the same factor as its end."""
FIRST = 1e-2
"""First value of p and q in excess of the violations at the start."""


class FeasibilityProblem:
    """A nonlinear program without its objective, with some of its statements only: :class:`stc.solver.nlp.NLP`.

    Rows of statements left out stay in the sparsity, without bounds.
    """

    def __init__(self, bound: BoundProgram, ownership: Ownership, kept: Iterable[int]) -> None:
        self._bound = bound
        kept = set(kept)
        rows = ownership.rows_kept(kept)
        self.left_out = np.flatnonzero(~rows)
        self._entry_left_out = ~rows[bound.jac_rows]
        self.n, self.m = bound.n, bound.m
        self.row_lower = np.where(rows, bound.row_lower, -np.inf)
        self.row_upper = np.where(rows, bound.row_upper, np.inf)
        lower, upper = ownership.bounds_kept(kept, bound.n)
        self.crossed = np.flatnonzero(lower > upper + 1e-9 * np.maximum(1.0, np.abs(lower)))
        self.x_lower, self.x_upper = lower, np.maximum(lower, upper)
        self.x0 = np.clip(bound.x0, self.x_lower, self.x_upper)
        self.jac_rows, self.jac_cols = bound.jac_rows, bound.jac_cols
        self.hess_rows, self.hess_cols = bound.hess_rows, bound.hess_cols
        self.var_stage, self.row_stage = bound.var_stage, bound.row_stage
        self.row_linear = bound.row_linear
        self.objective_degree = 0
        self.fixed_curvature = np.zeros(self.n, bool)

    def values(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Zero, and the rows; 0 for those left out, which may have no value here."""
        _, rows = self._bound.values(x)
        rows[self.left_out] = 0.0
        return 0.0, rows

    def derivatives(
        self, x: FloatArray, multipliers: FloatArray, objective_factor: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Derivatives of the rows kept."""
        y = multipliers.copy()
        y[self.left_out] = 0.0
        _, jac, hess = self._bound.derivatives(x, y, 0.0)
        if len(self.left_out):
            hess = np.nan_to_num(hess, nan=0.0, posinf=0.0, neginf=0.0)
        return np.zeros(self.n), self.masked(jac), hess

    def masked(self, jac: FloatArray) -> FloatArray:
        """The Jacobian's entries, 0 in rows left out."""
        return np.where(self._entry_left_out, 0.0, jac)


class ElasticProblem:
    """A feasibility problem with elastic rows, in (x, p, q): :class:`stc.solver.nlp.NLP`."""

    def __init__(self, base: FeasibilityProblem, x: FloatArray) -> None:
        """Elastic ``base``, to be started at ``x`` (n,)."""
        self.base = base
        n, rows = base.n, np.flatnonzero(np.isfinite(base.row_lower) | np.isfinite(base.row_upper))
        self._rows, count = rows, len(rows)
        _, jac, _ = base.derivatives(x, np.zeros(base.m), 0.0)
        size = np.zeros(base.m)
        np.maximum.at(size, base.jac_rows, np.where(np.isfinite(jac), np.abs(jac), 0.0))
        self._size = np.clip(np.where(size > 0.0, size, 1.0)[rows], *SIZES)
        self.n, self.m = n + 2 * count, base.m
        self.x_lower = np.concatenate([base.x_lower, np.zeros(2 * count)])
        self.x_upper = np.concatenate([base.x_upper, np.full(2 * count, np.inf)])
        self.row_lower, self.row_upper = base.row_lower, base.row_upper
        _, value = base.values(x)
        over = np.maximum(value[rows] - base.row_upper[rows], 0.0) / self._size
        under = np.maximum(base.row_lower[rows] - value[rows], 0.0) / self._size
        self.x0 = np.concatenate([x, over + FIRST, under + FIRST])
        columns = np.arange(count)
        self.jac_rows = np.concatenate([base.jac_rows, rows, rows]).astype(np.int32)
        self.jac_cols = np.concatenate([base.jac_cols, n + columns, n + count + columns]).astype(np.int32)
        self.hess_rows, self.hess_cols = base.hess_rows, base.hess_cols
        stages = [base.var_stage, base.row_stage[rows], base.row_stage[rows]]
        self.var_stage, self.row_stage = np.concatenate(stages).astype(np.int32), base.row_stage
        self.row_linear, self.objective_degree = base.row_linear, 1
        self.fixed_curvature = np.zeros(self.n, bool)

    def values(self, x: FloatArray) -> tuple[float, FloatArray]:
        """The sum of p and q, and the rows with them."""
        n, count = self.base.n, len(self._rows)
        _, rows = self.base.values(x[:n])
        rows[self._rows] += self._size * (x[n + count :] - x[n : n + count])
        return float(x[n:].sum()), rows

    def derivatives(
        self, x: FloatArray, multipliers: FloatArray, objective_factor: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The derivatives of :meth:`values`: gradient, Jacobian and Hessian entries."""
        _, jac, hess = self.base.derivatives(x[: self.base.n], multipliers, 0.0)
        gradient = np.ones(self.n)
        gradient[: self.base.n] = 0.0
        return gradient, np.concatenate([jac, -self._size, self._size]), hess
