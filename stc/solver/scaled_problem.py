"""A user's problem, scaled, in the form that the iteration works on.

Scaling is by gradients at the starting point (A. Waechter and L. T. Biegler, On the implementation of a
primal-dual interior point filter line search algorithm, Math. Program. 106, 2006, section 3.8): the objective
and the rows are divided so that no gradient entry exceeds a limit.  Variables are scaled first, and only those
whose own magnitude is far from one, or has to be to make a difference to any row.  What is flat where all begins,
like squares at 0, tells its size a little way off, or by its bounds.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from stc.arrays import scattered
from stc.core.structures import Structure, structure
from stc.solver.evaluator import Evaluator, Scaling, evaluator_of
from stc.solver.formulation import Formulation
from stc.solver.nlp import NLP, Floats, Mask
from stc.solver.options import Options
from stc.solver.products import ROUNDED, Indices

if TYPE_CHECKING:
    from stc.solver.kkt.contract import KKTSystem

__all__ = ["ScaledProblem", "relative_violation"]

LARGEST_GRADIENT = 100.0
SMALLEST_FACTOR = 1e-8
TOO_LARGE = 1e4
"""A gradient that no such factor keeps below this, or that only begins small, is divided by more; and so is an
inequality row with a larger bound: a gradient that is small where all begins says nothing of it."""
WEAK, WEAKEST = 1.0 / TOO_LARGE, 1e-10
"""A variable whose entries of the scaled Jacobian are all smaller is measured in larger units."""
RELAXATION = 1e-9
ORDINARY = 1e-2, 1e3
"""Magnitudes of variables that are left alone."""
SMALLEST = 1.0 / ORDINARY[1]
"""Gradients that are smaller are scaled, and bounds that are smaller are widened by less."""
NEARBY = 0.1
"""A little way off: so much of a variable's size."""


def _is_small(x: Floats) -> Mask:
    """(n,) whether a variable is smaller than usual, but not 0."""
    magnitude = np.abs(x)
    return (magnitude > 0.0) & (magnitude < ORDINARY[0])


def _are_tiny(nlp: NLP, x0: Floats) -> bool:
    """Whether all variables are, for their units, as far as ``x0`` (n,) and their bounds tell."""
    bounds = np.abs(np.concatenate([nlp.x_lower, nlp.x_upper]))
    told = bounds[np.isfinite(bounds) & (bounds > 0.0)]
    return told.size > 0 and max(told.max(), np.abs(x0).max()) < WEAK


def relative_violation(values: Floats, lower: Floats, upper: Floats) -> Floats:
    """Violation of ``lower <= values <= upper``, each relative to ``max(1, |bound|)``; nan counts as inf."""
    with np.errstate(invalid="ignore"):
        below = np.where(np.isfinite(lower), (lower - values) / np.maximum(1.0, np.abs(lower)), 0.0)
        above = np.where(np.isfinite(upper), (values - upper) / np.maximum(1.0, np.abs(upper)), 0.0)
        worst = np.maximum(np.maximum(below, above), 0.0)
    return np.where(np.isnan(worst), np.inf, worst)


class ScaledProblem(Formulation):
    """``objective_scale * f(D x)`` with rows ``row_scale * r(D x)``; ``x_scale`` is the diagonal of D."""

    def __init__(
        self,
        nlp: NLP,
        x0: Floats,
        options: Options,
        new_kkt: Callable[..., KKTSystem],
        objective_factor: float = 1.0,
        even: bool = False,
    ) -> None:
        """Scale ``nlp`` at ``x0`` (n,), a point where it is defined; the objective by ``objective_factor`` as well.

        Variables that are small there may become large: they are left alone unless all are tiny.
        Where ``even``, each variable is measured such that it makes a difference to some row.
        """
        self.nlp = nlp
        self.n, self.m = nlp.n, nlp.m
        self.x_scale = np.ones(self.n)
        self.row_scale = np.ones(self.m)
        self._row_unit = np.ones(self.m)  # one as stated, scaled, but for steep rows
        self.objective_scale = 1.0
        self._set_pattern(nlp.jac_rows, nlp.jac_cols, nlp.hess_rows, nlp.hess_cols)
        self._held_user = nlp.x_lower == nlp.x_upper
        if options.scaling:
            self._choose_scales(x0, 1.0 if even else WEAK)
        self.objective_factor = objective_factor
        self.objective_scale *= objective_factor
        self._combine_scales()
        lower, upper = nlp.x_lower / self.x_scale, nlp.x_upper / self.x_scale
        row_lower, row_upper = nlp.row_lower * self.row_scale, nlp.row_upper * self.row_scale
        self.true_x = (lower, upper)
        self.true_rows = (row_lower, row_upper)
        below, above = _relaxed(lower, upper, 1.0 / self.x_scale)
        start = x0 / self.x_scale
        below = below if self._is_defined(np.where(np.isfinite(below), below, start)) else lower
        above = above if self._is_defined(np.where(np.isfinite(above), above, start)) else upper
        self._set_bounds(below, above, *_relaxed(row_lower, row_upper, self._row_unit))
        self.stated_limits = (
            *_limits(self.true_rows, (nlp.row_lower, nlp.row_upper), 1.0 / self.row_scale),
            *_limits(self.true_x, (nlp.x_lower, nlp.x_upper), self.x_scale),
        )
        diagonal = np.flatnonzero((self.hess_rows == self.hess_cols) & nlp.fixed_curvature[self.hess_rows])
        self.convex = self.hess_rows[diagonal], diagonal
        self.linear = bool(np.all(nlp.row_linear))
        self.quadratic_objective = nlp.objective_degree <= 2
        self.quadratic_program = self.linear and self.quadratic_objective
        self.kkt = new_kkt(
            self.n, self.m, nlp.jac_rows, nlp.jac_cols, nlp.hess_rows, nlp.hess_cols, nlp.var_stage, nlp.row_stage,
            self.held,
        )  # fmt: skip

    @cached_property
    def program(self) -> Structure:
        """Sizes, sparsity and bounds, not relaxed, for functions of the core (``active_set.h``)."""
        (x_lower, x_upper), (row_lower, row_upper) = self.true_x, self.true_rows
        return structure("program")(
            n=self.n, m=self.m, jac_entries=self.jac_rows.size, hess_entries=self.hess_rows.size,
            jac_rows=self.jac_rows, jac_cols=self.jac_cols, hess_rows=self.hess_rows, hess_cols=self.hess_cols,
            x_lower=x_lower, x_upper=x_upper, row_lower=row_lower, row_upper=row_upper, held=self.held_factor,
            equality=self.equality_factor,
        )  # fmt: skip

    def release(self) -> None:
        """Let go of the program, so that it may keep the form."""
        del self.nlp

    def _is_defined(self, x: Floats) -> bool:
        """True where functions and derivatives are finite."""
        f, r = self.values(x)
        if not np.isfinite(f + r.sum()):
            return False
        return all(bool(np.isfinite(part.sum())) for part in self.derivatives(x, np.ones(self.m)))

    def _choose_scales(self, x0: Floats, weak_below: float) -> None:
        nlp = self.nlp
        span = nlp.x_upper - nlp.x_lower
        magnitude = np.minimum(np.abs(x0), np.where(span > 0.0, np.maximum(span, 1.0), np.inf))
        narrow = np.isfinite(span) & (span > 0) & (span < ORDINARY[0])
        wide = magnitude > ORDINARY[1]
        if _are_tiny(nlp, x0):
            wide |= _is_small(x0)
        self.x_scale = np.where(narrow, span, np.where(wide, magnitude, 1.0))
        self.x_scale = np.exp2(np.round(np.log2(self.x_scale)))
        entries = self._choose_function_scales(x0)
        columns = np.zeros(self.n)
        np.maximum.at(columns, self.jac_cols, entries * self.row_scale[self.jac_rows])
        weak = (columns > 0.0) & (columns < weak_below)
        if weak.any() and bool((self.x_scale >= 1.0).all()):  # else it is small that they are
            most = np.maximum(np.abs(nlp.x_lower), np.abs(nlp.x_upper))[weak]  # infinite where either is
            larger = np.minimum(self.x_scale[weak] / np.maximum(columns[weak], WEAKEST), most)
            self.x_scale[weak] = np.exp2(np.round(np.log2(np.maximum(larger, self.x_scale[weak]))))
            self._choose_function_scales(x0)
        sizes = np.zeros(self.m)
        for bound in (nlp.row_lower, nlp.row_upper):
            np.maximum(sizes, np.abs(bound), out=sizes, where=np.isfinite(bound))
        sizes *= self.row_scale
        large = (sizes > TOO_LARGE) & (nlp.row_lower < nlp.row_upper)
        # A steep row is not widened by less: two that meet would leave room for rounding errors alone.
        self._row_unit = np.maximum(self.row_scale, 1.0)
        self._row_unit[large] *= TOO_LARGE / sizes[large]
        self.row_scale[large] *= TOO_LARGE / sizes[large]

    def _choose_function_scales(self, x0: Floats) -> Floats:
        """Scale the objective and the rows for the scales of the variables; the magnitudes of the Jacobian's entries
        of rows as stated by scaled variables, the larger ones of those at two points, (nnz_J,).
        """
        nlp = self.nlp
        at_start, entries = self._magnitudes(x0)
        way = NEARBY * scattered(self.n)
        nearby, entries_nearby = self._magnitudes(np.clip(x0 + way * self.x_scale, nlp.x_lower, nlp.x_upper))
        factors = _factors(at_start, nearby)
        flat = (at_start < SMALLEST) & (nearby > TOO_LARGE)
        if flat.any():
            # Where a variable is small, a way of its own size.
            own = np.where(x0 == 0.0, self.x_scale, np.minimum(np.abs(x0), self.x_scale))
            nearby, _ = self._magnitudes(np.clip(x0 + way * own, nlp.x_lower, nlp.x_upper))
            flat &= np.isfinite(nearby) & (nearby > TOO_LARGE)
            factors[flat] = TOO_LARGE / nearby[flat]
        self.row_scale, self.objective_scale = factors[:-1], float(factors[-1])
        return np.maximum(entries, entries_nearby)

    def _magnitudes(self, x: Floats) -> tuple[Floats, Floats]:
        """Largest gradient entry of each row and of the objective, (m + 1,), for the scaled variables; the magnitudes
        of the Jacobian's entries, (nnz_J,)."""
        gradient, jac, _ = self.nlp.derivatives(x, np.zeros(self.m), 0.0)
        free = ~self._held_user
        functions = np.zeros(self.m + 1)
        entries = np.abs(jac) * (self.x_scale * free)[self.jac_cols]
        np.maximum.at(functions, self.jac_rows, entries)
        functions[-1] = (np.abs(gradient) * self.x_scale)[free].max(initial=0.0)
        return functions, entries

    def _combine_scales(self) -> None:
        nlp = self.nlp
        self.objective_unit = self.objective_scale
        bounded = np.isfinite(nlp.row_lower) | np.isfinite(nlp.row_upper)
        self._scaling = Scaling(self.x_scale, self.row_scale, self.objective_scale, ~self._held_user, bounded)
        self._multiplier_scale = self.row_scale / self.objective_scale
        self._gradient_scale = self._scaling.gradient()
        self._jac_scale = self._scaling.jacobian(self.jac_rows, self.jac_cols)
        self._hess_scale = self._scaling.hessian(self.hess_rows, self.hess_cols)

    # -- functions ---------------------------------------------------------------------------------------------

    def values(self, x: Floats) -> tuple[float, Floats]:
        f, r = self.nlp.values(x * self.x_scale)
        return self.objective_scale * f, self.row_scale * r

    def derivatives(self, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        return self.weighted_derivatives(x, y, 1.0)

    def weighted_derivatives(self, x: Floats, y: Floats, weight: float) -> tuple[Floats, Floats, Floats]:
        """As :meth:`derivatives`, of ``weight`` times the objective in the Hessian only."""
        gradient, jac, hess = self.nlp.derivatives(
            x * self.x_scale, y * self.row_scale, weight * self.objective_scale
        )
        return gradient * self._gradient_scale, jac * self._jac_scale, hess * self._hess_scale

    def evaluator(self) -> Evaluator:
        return evaluator_of(self.nlp, self._scaling)

    def violation(self, x: Floats, r: Floats) -> float:
        """Largest violation in the user's units of rows ``r`` (m,) and of the bounds of ``x`` (n,), scaled both."""
        out = np.empty(1)
        self.violation_call(x, r, out)()
        return float(out[0])

    def user_variables(self, x: Floats) -> Floats:
        return x * self.x_scale

    def user_objective(self, f: float) -> float:
        """Objective in the user's terms."""
        return f / self.objective_scale

    def as_stated(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Variables (n,) and row multipliers (m,) in the user's terms."""
        return x * self.x_scale, y * self._multiplier_scale

    def scaled_multipliers(self, y: Floats) -> Floats:
        """Row multipliers of the scaled problem, (m,), for those in the user's terms."""
        return y / self.row_scale * self.objective_scale

    def scaled_bound_multipliers(self, z: Floats) -> Floats:
        """Multipliers of the bounds of the scaled variables, (n,), for those of the variables as stated."""
        return z * self.x_scale * self.objective_scale


def _limits(
    scaled: tuple[Floats, Floats], stated: tuple[Floats, Floats], unit: Floats
) -> tuple[Indices, Floats, Floats]:
    """Entries with bounds, these bounds scaled, and what turns ``bound - value`` into the user's relative violation."""
    sides = []
    for sign, bound, side in zip((1.0, -1.0), scaled, stated):
        at = np.flatnonzero(np.isfinite(side))
        sides.append((at, bound[at], sign * unit[at] / np.maximum(1.0, np.abs(side[at]))))
    below, above = sides
    return (
        np.concatenate([below[0], above[0]]),
        np.concatenate([below[1], above[1]]),
        np.concatenate([below[2], above[2]]),
    )


def _factors(gradients: Floats, nearby: Floats) -> Floats:
    """Divide large functions down to :data:`LARGEST_GRADIENT`, multiply small ones up to 1.

    A gradient may happen to be small at one point: a function counts as small when it is so nearby as well.
    """
    factors = np.ones_like(gradients)
    large = np.isfinite(gradients) & (gradients > LARGEST_GRADIENT)
    factors[large] = np.maximum(LARGEST_GRADIENT / gradients[large], SMALLEST_FACTOR)
    both = np.maximum(gradients, nearby)
    small = (both > 0.0) & (both < SMALLEST)  # False for nan
    factors[small] = np.minimum(1.0 / both[small], 1.0 / SMALLEST_FACTOR)
    return factors


def _hair(bound: Floats, unit: Floats) -> Floats:
    """What bounds are widened by, in which ``unit`` is one as stated; one that is 0 says nothing of its size.

    The least is a few units in the last place: enough for a gap to be a number.
    """
    size = np.abs(bound)
    hair = np.where(size == 0.0, 1.0, np.clip(size, SMALLEST, 1.0))
    return np.maximum(RELAXATION * np.minimum(hair, unit), 4.0 * ROUNDED * size)


def _relaxed(lower: Floats, upper: Floats, unit: Floats) -> tuple[Floats, Floats]:
    """Inequalities widened by a hair, so that a strict interior exists even where they imply equalities.

    Those of variables stay where functions are undefined beyond them.  Small limits are widened by less: one of 1e-7
    that gives way by 1e-9 may be worth a per cent of the objective.  Large ones are not widened by more: what shifts a
    bound from 1 to 1e7 does not make what it holds back any larger.
    """
    open_ = lower < upper
    below = np.where(open_, lower - _hair(lower, unit), lower)
    above = np.where(open_, upper + _hair(upper, unit), upper)
    return np.where(np.isfinite(lower), below, lower), np.where(np.isfinite(upper), above, upper)
