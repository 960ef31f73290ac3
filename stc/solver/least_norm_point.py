"""The point of least norm that satisfies a program's linear equations; it shows how large the variables are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from stc.solver.nlp import NLP, Floats
from stc.solver.options import Options
from stc.solver.outcome import SHORT_BUDGET
from stc.solver.products import between
from stc.solver.report import Result
from stc.solver.status import Status

__all__ = ["LeastNormProblem", "Solve", "least_norm_point"]

Solve = Callable[[NLP, Options], Result]


class LeastNormProblem:
    """Least squares of the variables, subject to the linear equations of a program: :class:`stc.solver.nlp.NLP`."""

    def __init__(self, nlp: NLP, unit: Floats) -> None:
        """``unit`` (n,) is the unit of each variable."""
        self._nlp, self._weight = nlp, 1.0 / unit**2
        self.n, self.m = nlp.n, nlp.m
        self.x_lower, self.x_upper = _equal(nlp.x_lower, nlp.x_upper)
        self.row_lower, self.row_upper = _equal(nlp.row_lower, nlp.row_upper)
        self.x0 = np.where(np.isfinite(self.x_lower), self.x_lower, 0.0)
        self.jac_rows, self.jac_cols = nlp.jac_rows, nlp.jac_cols
        self.hess_rows = self.hess_cols = np.arange(nlp.n, dtype=np.int32)
        self.var_stage, self.row_stage = nlp.var_stage, nlp.row_stage
        self.row_linear = np.ones(nlp.m, bool)
        self.objective_degree = 2
        self.fixed_curvature = np.ones(nlp.n, bool)

    def values(self, x: Floats) -> tuple[float, Floats]:
        """Half the sum of squares, and the rows."""
        return 0.5 * float(self._weight @ (x * x)), self._nlp.values(x)[1]

    def derivatives(
        self, x: Floats, multipliers: Floats, objective_factor: float
    ) -> tuple[Floats, Floats, Floats]:
        """See ``NLP.derivatives``."""
        _, jac, _ = self._nlp.derivatives(x, np.zeros(self.m), 0.0)
        return self._weight * x, jac, objective_factor * self._weight


def _equal(lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
    """Only the bounds that are equal."""
    equal = lower == upper
    return np.where(equal, lower, -np.inf), np.where(equal, upper, np.inf)


def least_norm_point(nlp: NLP, unit: Floats, limits: Options, solve: Solve) -> tuple[Floats, int]:
    """The solver's approximation of that point within the bounds, (n,), and the number of its iterations.

    Args:
        nlp: a program with linear rows.
        unit: what each variable is measured in, (n,).
        limits: has those on iterations and time.
        solve: solves a program.

    Raises:
        KeyboardInterrupt: the solve was interrupted.
    """
    most = min(SHORT_BUDGET, limits.max_iterations)
    result = solve(
        LeastNormProblem(nlp, unit), replace(limits, max_iterations=most, retries=0, warm_start=False)
    )
    if result.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    return between(result.x, nlp.x_lower, nlp.x_upper), result.iterations
