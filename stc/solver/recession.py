"""Whether a linear or convex quadratic program falls without limit, told by the directions in which it may go on.

From a feasible point a program with linear rows may go on forever in the directions ``d`` with

    A d = 0 where a row has two bounds,   A d >= 0 or <= 0 where it has one,   the same for the variables

which make a cone (R. T. Rockafellar, Convex Analysis, 1970, section 8).  The objective falls without limit if it falls
in one of them and does not bend there.  In a box that is a linear program with the sparsity of the one at hand, which
0 meets, and which has a solution.  Rays through iterates far out, in comparison, meet rows only as nearly as these do.
"""

from __future__ import annotations

import numpy as np

from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.products import between, symmetric_times, times
from stc.solver.residuals import signed_violations
from stc.solver.status import Status

__all__ = ["RecessionProblem", "falls_forever"]

BENDS = 1e8
"""What bending costs, per unit of the largest slope and curvature."""
LEAST_FALL = 1e-7
"""Fall of the objective along a direction, relative to its terms."""
LENGTHS = 10.0 ** np.arange(1.0, 10.0)
KEPT = 0.5
"""Share of the slope that is left along a direction, as far as it is gone."""
ITERATIONS = 200


class RecessionProblem:
    """The directions in which a program with linear rows may go on: :class:`stc.solver.nlp.NLP`.

    Attributes:
        gradient: slope of the objective at the point that it was made for, (n,).
    """

    def __init__(self, nlp: NLP, x: Floats, size: Floats) -> None:
        """Directions from ``x`` (n,), of at most ``size`` (n,) in each variable."""
        gradient, jac, hess = nlp.derivatives(x, np.zeros(nlp.m), 1.0)
        self.gradient, self._jac = gradient.copy(), jac.copy()
        self.n, self.m = nlp.n, nlp.m
        self.jac_rows, self.jac_cols = nlp.jac_rows, nlp.jac_cols
        self.hess_rows, self.hess_cols = nlp.hess_rows, nlp.hess_cols
        self.var_stage, self.row_stage = nlp.var_stage, nlp.row_stage
        self._jac_places = nlp.jac_rows.astype(np.int64), nlp.jac_cols.astype(np.int64)
        self._hess_places = nlp.hess_rows.astype(np.int64), nlp.hess_cols.astype(np.int64)
        steepest = max(np.abs(self.gradient * size).max(initial=0.0), 1e-300)
        curved = np.abs(hess * size[nlp.hess_rows] * size[nlp.hess_cols]).max(initial=0.0)
        self._hess = hess * (BENDS * steepest / curved) if curved else np.zeros_like(hess)
        self.x_lower, self.x_upper = _cone(nlp.x_lower, nlp.x_upper, size)
        self.row_lower, self.row_upper = _cone(nlp.row_lower, nlp.row_upper, np.full(nlp.m, np.inf))
        self.x0 = np.zeros(nlp.n)
        self.row_linear = np.ones(nlp.m, bool)
        self.objective_degree = 2 if curved else 1
        self.fixed_curvature = np.ones(nlp.n, bool)

    def values(self, x: Floats) -> tuple[float, Floats]:
        """What the objective gains along ``x`` (n,), bending counted, and the rows."""
        return float((self.gradient + 0.5 * self._bend(x)) @ x), self.rows(x)

    def rows(self, x: Floats) -> Floats:
        """A x, (m,)."""
        return times(*self._jac_places, self._jac, x, self.m)

    def derivatives(
        self, x: Floats, multipliers: Floats, objective_factor: float
    ) -> tuple[Floats, Floats, Floats]:
        """See ``NLP.derivatives``."""
        return self.gradient + self._bend(x), self._jac.copy(), objective_factor * self._hess

    def _bend(self, x: Floats) -> Floats:
        """The Hessian times ``x`` (n,)."""
        return symmetric_times(*self._hess_places, self._hess, x, self.n)


def _cone(lower: Floats, upper: Floats, size: Floats) -> tuple[Floats, Floats]:
    """Bounds of directions, from those of points."""
    return np.where(np.isfinite(lower), 0.0, -size), np.where(np.isfinite(upper), 0.0, size)


def falls_forever(nlp: NLP, x: Floats, size: Floats, limits: Options) -> tuple[bool, int]:
    """Whether the objective of a program with linear rows, affine or quadratic, falls without limit.

    Args:
        x: a feasible point, (n,).
        size: what to measure directions in, (n,).
        limits: has those on iterations and time.

    Returns:
        That, and the iterations it took to tell.
    """
    from stc.solver.sqp import minimize

    problem = RecessionProblem(nlp, x, size)
    left = min(ITERATIONS, limits.max_iterations)
    result = minimize(problem, Options(max_iterations=left, time_limit=limits.time_limit, retries=0))
    if result.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    if result.status is not Status.OPTIMAL:
        return False, result.iterations
    way = between(result.x, problem.x_lower, problem.x_upper)
    slope = float(problem.gradient @ way)
    # What the rows give way by may have gained that much, at most, since the program is convex.
    gained = float(np.abs(result.row_multipliers) @ np.abs(signed_violations(problem, problem.rows(way))))
    if not slope + gained < -LEAST_FALL * float(np.abs(problem.gradient) @ np.abs(way)):
        return False, result.iterations
    start = nlp.values(x)[0]
    longest = max(1.0, float(np.abs(x / size).max(initial=0.0)))
    falls = all(nlp.values(x + t * way)[0] - start < KEPT * t * slope for t in longest * LENGTHS)
    return falls, result.iterations
