"""Mesh refinement: solve, estimate the discretisation error, solve again on more frames until it is small.

How many frames the next solve gets follows from the error and the method's order.  Where phases have frame counts
of their own, each gets what its own error asks for; elsewhere all steps are refined alike.  Every solve starts from
the one before, so that the finer ones take few iterations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from itertools import pairwise
from typing import Any

import numpy as np

from stc.arguments import number, whole
from stc.errors import UsageError
from stc.pipeline import Model
from stc.records import dataclass, field
from stc.solution import Solution
from stc.studies.discretisation import Estimate, estimate
from stc.studies.effort import Clock, Effort
from stc.studies.finer import solve_finer
from stc.studies.frames import ORDER, Spread, growth_for, observed_order

__all__ = ["Level", "Refinement", "refine"]

SAFETY = 0.5
"""The next solve is to have this share of the tolerance."""
MOST_LEVELS = 12
MOST_FRAMES = 50_000
NO_FALL = 0.95
"""An error that falls by less than this factor twice does not fall."""
CONFIRM = 0.1
"""An estimate that is below the tolerance, but by less than this factor, is confirmed by a finer solve."""


@dataclass(frozen=True, slots=True)
class Level:
    """One solve.

    Attributes:
        n: number of steps.
        phases: number of steps in each phase with a frame count of its own.
        status, objective, iterations, factorizations: of the solve.
        error: the estimate that is compared with the tolerance: the largest one of the next three.
        local_error: local errors of all steps together, relative.
        quadrature_error: relative error of the objective's integrals.
        objective_error: relative error of the objective, by how it changed from the level before; 0 for the first.
        worst: what has the largest local errors.
        seconds: wall time of the solve.
    """

    n: int
    phases: list[int]
    status: str
    objective: float
    iterations: int
    factorizations: int
    error: float
    local_error: float
    quadrature_error: float
    objective_error: float
    worst: str
    seconds: float


@dataclass(slots=True)
class Refinement:
    """What refining led to.

    Attributes:
        tolerance: for the estimate.
        levels: every solve, coarsest first.
        solution: the last optimal one (the first one where that was not optimal).
        effort: of all solves.
        message: why the tolerance was not reached (a spec whose frames cannot be refined is told with the place);
            empty where it was.
    """

    tolerance: float
    levels: list[Level] = field(default_factory=list)
    solution: Solution | None = None
    effort: Effort = field(default_factory=Effort)
    message: str = ""

    @property
    def reached(self) -> bool:
        """Whether the estimate fell below the tolerance."""
        return not self.message

    def to_dict(self) -> dict[str, Any]:
        """The refinement as JSON takes it."""
        return {
            "tolerance": self.tolerance,
            "reached": self.reached,
            "error": self.levels[-1].error if self.levels else None,
            "solves": self.effort.solves,
            "levels": [asdict(level) for level in self.levels],
        }


def refine(
    model: Model,
    error: float,
    *,
    solve: Callable[..., Solution] | None = None,
    on_level: Callable[[Level], None] | None = None,
    start: Solution | None = None,
    most_frames: int = MOST_FRAMES,
    **options: Any,
) -> Refinement:
    """Refine until the estimated discretisation error is below a tolerance.

    Args:
        model: the spec; its n is that of the coarsest solve.
        error: what the estimate has to fall below (see :mod:`stc.studies.discretisation`).
        solve: used in place of ``model.solve``, with the same arguments (to watch it).
        on_level: told after every solve.
        start: a solution of the coarsest problem, where there is one already; it is not solved again.
        most_frames: no solve gets more.
        **options: of :meth:`stc.pipeline.Model.solve`; a time limit is for all solves together.

    Raises:
        UsageError: a tolerance that is not positive, or a motion of one frame.
        SpecError, EvaluationError: mistakes in the spec, or a start where a function is undefined.
    """
    error, most_frames = number(error, "the error of a refinement"), whole(most_frames, "most_frames")
    if not error > 0:
        raise UsageError(f"the tolerance of a refinement must be positive, not {error:g}")
    solve = solve or model.solve
    constants = dict(options.pop("constants", {}))
    clock = Clock(options.pop("time_limit", None))
    method = options.get("method")
    spread = Spread.of(model, method, constants)
    factors = np.ones(len(spread.ends), int)
    found = Refinement(error)
    overrides: dict[str, float] = {}
    idle = 0
    while True:
        given = {**options, "constants": {**constants, **overrides}}
        if found.solution is not None:
            solution = solve_finer(solve, found.solution, given, clock, found.effort)
        elif start is not None:
            solution = start
        else:
            solution = solve(**given, **clock.option())
            found.effort.add(solution)
        good = solution.status == "optimal"
        phases = [int(k) for k in factors * spread.lengths]
        judged = estimate(model.problem(method, **{**constants, **overrides}), solution) if good else None
        found.levels.append(_level(solution, phases, judged, found))
        if good or found.solution is None:
            found.solution = solution
        if on_level is not None:
            on_level(found.levels[-1])
        if judged is None:
            found.message = f"with n = {solution.n} the solve ended {solution.status}"
            return found
        level = found.levels[-1]
        if level.error <= (error if len(found.levels) > 1 else CONFIRM * error):
            return found
        if len(found.levels) > 1:
            idle = idle + 1 if level.error > NO_FALL * found.levels[-2].error else 0
        wanted = _wanted(found, np.array(phases), factors, judged, solution.method)
        if idle > 1 or len(found.levels) == MOST_LEVELS:
            found.message = f"the error no longer falls: {level.error:.2g} with n = {solution.n}"
            return found
        if clock.is_over:
            found.message = f"the time limit of {clock.limit:g} s came first; the error is {level.error:.2g}"
            return found
        if int(wanted @ spread.lengths) > most_frames:
            found.message = f"an error of {error:g} would take more than {most_frames} frames"
            found.message += f"; it is {level.error:.2g} with n = {solution.n}"
            if _order(found, solution.method) < ORDER[solution.method] - 0.5:
                found.message += " and falls slowly, as at kinks and at jumps that the spec does not declare"
            return found
        try:
            overrides = spread.finer([int(k) for k in wanted])
        except UsageError as reason:
            if level.error > error:
                found.message = f"the error is {level.error:.2g} with n = {solution.n}, and {reason}"
            return found
        factors = np.array(spread.counts(overrides)) // np.array(spread.lengths)


def _level(solution: Solution, phases: list[int], judged: Estimate | None, found: Refinement) -> Level:
    unknown = float("nan")
    before = found.levels[-1] if found.levels else None
    change = _objective_error(before, judged, solution) if before and judged else 0.0
    return Level(
        n=solution.n,
        phases=phases,
        status=solution.status,
        objective=solution.objective,
        iterations=solution.iterations,
        factorizations=solution.factorizations,
        error=max(judged.error, change) if judged else unknown,
        local_error=judged.accumulated if judged else unknown,
        quadrature_error=judged.quadrature_error if judged else unknown,
        objective_error=change,
        worst=judged.worst if judged else "",
        seconds=solution.seconds.get("total", 0.0),
    )


def _objective_error(before: Level, judged: Estimate, solution: Solution) -> float:
    """What is left of the objective's error if it falls from level to level as the estimate does.

    (L. F. Richardson's extrapolation, with the observed order in place of the method's.)
    """
    change = abs(solution.objective - before.objective) / (1.0 + abs(solution.objective))
    estimated = max(before.local_error, before.quadrature_error)
    fall = min(estimated / max(judged.error, 1e-300), (solution.n / before.n) ** ORDER[solution.method])
    return change / (fall - 1.0) if fall > 1.0 / NO_FALL else change


def _wanted(
    found: Refinement, counts: np.ndarray, factors: np.ndarray, judged: Estimate, method: str
) -> np.ndarray:
    """How many times as many frames as at first each phase needs; more than now somewhere.

    Args:
        counts: steps of each phase now.
        factors: how many times as many as at first those are.
        judged: the error now.
    """
    ends = np.concatenate([[0], np.cumsum(counts)])
    errors = np.array([judged.within(int(a), int(b)) for a, b in pairwise(ends)])
    share = SAFETY * found.tolerance / found.levels[-1].error
    growth = growth_for(errors, counts, _order(found, method), min(share, 1.0))
    wanted = np.ceil(growth * factors - 1e-9).astype(int)
    return np.asarray(wanted if (wanted > factors).any() else factors + 1)


def _order(found: Refinement, method: str) -> float:
    """The order at which the error falls, as far as the levels tell."""
    if len(found.levels) < 2:
        return ORDER[method]
    coarse, fine = found.levels[-2:]
    return observed_order(method, (coarse.n, coarse.error), (fine.n, fine.error))
