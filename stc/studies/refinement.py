"""Mesh refinement: solve, estimate the discretisation error, and solve again on more frames until it is small.

The number of frames of the next solve follows from the error and the method's order.  If phases have frame counts of
their own, each is refined according to its own error; otherwise all steps are refined alike.  Every solve starts from
the one before, so that finer ones take few iterations, unless the error of that one is too large for a guess.
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
from stc.studies.doubled import FROM_COARSER
from stc.studies.effort import Clock, Effort
from stc.studies.finer import SAME, solve_finer
from stc.studies.frames import ORDER, SAFETY, Spread, growth_for, in_shares, observed_order
from stc.studies.grid_error import GROSS, NO_GUESS, local_grid_error

__all__ = ["Level", "Refinement", "refine"]

MOST_LEVELS = 20
MOST_FRAMES = 50_000
MOST_FROM_GROSS = 2
"""Largest factor by which frames increase if the grid error is gross."""
MOST_TRIES = 3
"""Number of solves in a row that may fail or find another optimum. Each is on fewer frames than the one before; the
last one has hardly more frames than the solution that it starts from, and may take long."""
AT_LAST = 2000
"""Limit of iterations of the last one, whose optimum may still be far away along a flat valley of the objective."""
WITHIN = 3.0
"""Largest difference between two objectives of the same optimum, as a multiple of their estimated errors."""
NO_FALL = 0.95
"""The refinement stops if the error falls by less than this factor twice."""
CONFIRM = 0.1
"""An estimate that is below the tolerance, but by less than this factor, is confirmed by a finer solve."""


@dataclass(frozen=True, slots=True)
class Level:
    """One solve.

    Attributes
    ----------
    n : int
        Number of steps.
    phases : list[int]
        Number of steps in each phase with a frame count of its own.
    status, objective, iterations, factorizations
        Results of the solve.
    error : float
        The estimate that is compared with the tolerance: the largest of ``local_error``,
        ``quadrature_error`` and ``objective_error``.
    grid_error : float
        The larger figure of :func:`stc.studies.grid_error.local_grid_error`.
    local_error : float
        Local errors of all steps together, relative.
    quadrature_error : float
        Relative error of the objective's integrals.
    objective_error : float
        Relative error of the objective, from its change since the level before; 0 for the first.
    worst : str
        The quantity with the largest local errors.
    seconds : float
        Wall time of the solve.
    """

    n: int
    phases: list[int]
    status: str
    objective: float
    iterations: int
    factorizations: int
    error: float
    grid_error: float
    local_error: float
    quadrature_error: float
    objective_error: float
    worst: str
    seconds: float


@dataclass(slots=True)
class Refinement:
    """The result of a refinement.

    Attributes
    ----------
    tolerance : float
        Tolerance of the estimate.
    levels : list[Level]
        Every solve, coarsest first.
    solution : Solution | None
        The best one: of those whose grid error is not gross the one on the most frames, unless one on fewer
        has a lower objective than the errors of both explain; if all are gross, the one with the smallest error.
    kept : int
        Index of its level.
    trail : list[Level]
        The levels that each refined the one before, coarsest first, without those that found another optimum.
    effort : Effort
        Totals of all solves.
    message : str
        Why the tolerance was not reached (with the position in the spec if its frames cannot be refined);
        empty if it was.
    """

    tolerance: float
    levels: list[Level] = field(default_factory=list)
    solution: Solution | None = None
    kept: int = 0
    trail: list[Level] = field(default_factory=list)
    effort: Effort = field(default_factory=Effort)
    message: str = ""

    @property
    def reached(self) -> bool:
        """Whether the estimate is below the tolerance."""
        return not self.message

    @property
    def best(self) -> Level:
        """The level whose solution is kept."""
        return self.levels[self.kept]

    @property
    def remark(self) -> str:
        """A note on the solution that was kept, if it is not the last one, and on artefacts of coarse grids."""
        told = []
        best = self.best
        if best is not self.levels[-1]:
            told.append(
                f"the solution kept is that with n = {best.n}: objective {best.objective:.10g}, error {best.error:.2g}"
            )
        if best.grid_error <= GROSS:
            told += [
                f"what was found with n = {one.n}, of objective {one.objective:.6g}, was an artefact of that grid"
                for one in self.levels
                if one.grid_error > NO_GUESS
            ]
        return "; ".join(told)

    def to_dict(self) -> dict[str, Any]:
        """The refinement for JSON."""
        return {
            "tolerance": self.tolerance,
            "reached": self.reached,
            "error": self.best.error if self.levels else None,
            "kept": self.best.n if self.levels else None,
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

    Parameters
    ----------
    model : Model
        The spec; its n is that of the coarsest solve.
    error : float
        Tolerance of the estimate (see :mod:`stc.studies.discretisation`).
    solve : Callable[..., Solution] | None
        Function to use in place of ``model.solve``, with the same arguments (to watch it).
    on_level : Callable[[Level], None] | None
        Called with the record of every solve.
    start : Solution | None
        A solution of the coarsest problem, if there is one already; it is not solved again.
    most_frames : int
        Largest number of frames.
    **options : Any
        Arguments of :meth:`stc.pipeline.Model.solve`; a time limit applies to all solves together.

    Returns
    -------
    Refinement
        The refinement, with the best solution.

    Raises
    ------
    UsageError
        A tolerance that is not positive, or a motion of one frame.
    SpecError, EvaluationError
        Mistakes in the spec, or a start where a function is undefined.
    """
    error, most_frames = number(error, "the error of a refinement"), whole(most_frames, "most_frames")
    if not error > 0:
        raise UsageError(f"the tolerance of a refinement must be positive, not {error:g}")
    if solve is None:
        model = in_shares(model, options.get("method"), **options.get("constants", {}))
        solve = model.solve
    constants = dict(options.pop("constants", {}))
    clock = Clock(options.pop("time_limit", None))
    method = options.get("method")
    spread = Spread.of(model, method, constants)
    factors = np.ones(len(spread.ends), int)
    found = Refinement(error)
    reached = factors
    last: Solution | None = None
    overrides: dict[str, float] = {}
    idle = tries = 0
    most_growth = np.inf
    while True:
        given = {**options, "constants": {**constants, **overrides}}
        if last is not None:
            at_last = tries == MOST_TRIES
            patience = AT_LAST if at_last else FROM_COARSER
            solution = solve_finer(solve, last, given, clock, found.effort, not at_last, patience)
        elif start is not None:
            solution = start
        else:
            solution = solve(**given, **clock.option())
            found.effort.add(solution)
        good = solution.status == "optimal"
        phases = [int(k) for k in factors * spread.lengths]
        judged = estimate(model.problem(method, **{**constants, **overrides}), solution) if good else None
        level = _level(solution, phases, judged, found)
        found.levels.append(level)
        # From a gross error every other one is a step on, be it as gross.
        better = found.solution is None or _is_better(level, found.best)
        on = judged is not None and (better or found.best.grid_error > GROSS)
        if better:
            found.solution, found.kept = solution, len(found.levels) - 1
        if on or last is None:
            last = solution
            found.trail += [level] if good else []
        if on_level is not None:
            on_level(level)
        if judged is None or not on:
            if not found.trail or tries == MOST_TRIES or clock.is_over or solution.status == "interrupted":
                found.message = _elsewhere(solution)
                return found
            tries += 1
            most_growth = float(np.cbrt((factors / reached).max())) if tries < MOST_TRIES else 1.0
            wanted = _at_most(factors, reached, most_growth)
            if (wanted == factors).all():
                tries = MOST_TRIES  # there are no fewer
        else:
            # Where steps between grids had to be short, the next one is hardly longer.
            most_growth = max(most_growth, float((factors / reached).max())) ** 2
            reached, tries = factors, 0
            if level.error <= (error if len(found.trail) > 1 else CONFIRM * error):
                return found
            if len(found.trail) > 1:
                idle = idle + 1 if level.error > NO_FALL * found.trail[-2].error else 0
            wanted = _wanted(found, np.array(phases), factors, judged, solution.method)
            wanted = _at_most(wanted, reached, most_growth)
            found.message = _in_the_way(found, solution, clock, idle)
            if not found.message and int(wanted @ spread.lengths) > most_frames:
                found.message = _too_many(found, solution, most_frames)
            if found.message:
                return found
        try:
            overrides = spread.finer([int(k) for k in wanted])
        except UsageError as reason:
            if found.best.error > error:
                found.message = f"the error is {found.best.error:.2g} with n = {found.best.n}, and {reason}"
            return found
        factors = np.array(spread.counts(overrides)) // np.array(spread.lengths)


def _at_most(wanted: np.ndarray, reached: np.ndarray, growth: float) -> np.ndarray:
    """The growth factor, limited in relation to the frames reached so far."""
    if not np.isfinite(growth):
        return wanted
    return np.minimum(wanted, np.maximum((growth * reached).round(), reached + 1)).astype(int)


def _elsewhere(solution: Solution) -> str:
    """Why a solve on more frames cannot be continued from."""
    if solution.status != "optimal":
        return f"with n = {solution.n} the solve ended {solution.status}"
    return (
        f"with n = {solution.n} the solve led to another optimum than on fewer frames, with the objective "
        f"{solution.objective:.6g}"
    )


def _in_the_way(found: Refinement, solution: Solution, clock: Clock, idle: int) -> str:
    """Why a refinement cannot continue, in words; empty if it can."""
    error = found.trail[-1].error
    if idle > 1 or len(found.levels) == MOST_LEVELS:
        return f"the error no longer falls: {error:.2g} with n = {solution.n}"
    if clock.is_over:
        return f"the time limit of {clock.limit:g} s came first; the error is {error:.2g}"
    return ""


def _too_many(found: Refinement, solution: Solution, most_frames: int) -> str:
    told = f"an error of {found.tolerance:g} would take more than {most_frames} frames"
    told += f"; it is {found.trail[-1].error:.2g} with n = {solution.n}"
    if _order(found, solution.method) < ORDER[solution.method] - 0.5:
        told += " and falls slowly, as at kinks and at jumps that the spec does not declare"
    return told


def _is_better(level: Level, best: Level) -> bool:
    """Whether a level replaces the best one before, which has fewer frames."""
    if level.status != "optimal" or best.status != "optimal":
        return level.status == "optimal"
    if best.grid_error > GROSS:
        return level.grid_error < best.grid_error
    explained = WITHIN * (level.grid_error + best.grid_error) * (1.0 + abs(level.objective))
    return level.grid_error <= GROSS and level.objective <= best.objective + explained + SAME * abs(
        best.objective
    )


def _level(solution: Solution, phases: list[int], judged: Estimate | None, found: Refinement) -> Level:
    unknown = float("nan")
    before = found.trail[-1] if found.trail else None
    if before is not None and before.grid_error > NO_GUESS:
        before = None  # another optimum, or none: nothing to extrapolate from
    told = local_grid_error(solution)
    change = _objective_error(before, judged, solution) if before and judged else 0.0
    return Level(
        n=solution.n,
        phases=phases,
        status=solution.status,
        objective=solution.objective,
        iterations=solution.iterations,
        factorizations=solution.factorizations,
        error=max(judged.error, change) if judged else unknown,
        grid_error=unknown if told is None else told.largest,
        local_error=judged.accumulated if judged else unknown,
        quadrature_error=judged.quadrature_error if judged else unknown,
        objective_error=change,
        worst=judged.worst if judged else "",
        seconds=solution.seconds.get("total", 0.0),
    )


def _objective_error(before: Level, judged: Estimate, solution: Solution) -> float:
    """The remaining error of the objective if it decreases from level to level like the estimate.

    (L. F. Richardson's extrapolation, with the observed order in place of the method's.)
    """
    change = abs(solution.objective - before.objective) / (1.0 + abs(solution.objective))
    estimated = max(before.local_error, before.quadrature_error)
    fall = min(estimated / max(judged.error, 1e-300), (solution.n / before.n) ** ORDER[solution.method])
    return change / (fall - 1.0) if fall > 1.0 / NO_FALL else change


def _wanted(
    found: Refinement, counts: np.ndarray, factors: np.ndarray, judged: Estimate, method: str
) -> np.ndarray:
    """The growth factor of each phase relative to the first level; more than now somewhere.

    Args:
        counts: steps of each phase now.
        factors: how many times as many as at first those are.
        judged: the error now.
    """
    ends = np.concatenate([[0], np.cumsum(counts)])
    errors = np.array([judged.within(int(a), int(b)) for a, b in pairwise(ends)])
    share = SAFETY * found.tolerance / found.trail[-1].error
    growth = growth_for(errors, counts, _order(found, method), min(share, 1.0))
    if found.trail[-1].grid_error > GROSS:
        growth = np.minimum(growth, MOST_FROM_GROSS)  # an error so large says little of how it falls
    wanted = np.ceil(growth * factors - 1e-9).astype(int)
    return np.asarray(wanted if (wanted > factors).any() else factors + 1)


def _order(found: Refinement, method: str) -> float:
    """The order at which the error decreases, as far as the levels show."""
    if len(found.trail) < 2 or found.trail[-2].grid_error > NO_GUESS:
        return ORDER[method]
    coarse, fine = found.trail[-2:]
    return observed_order(method, (coarse.n, coarse.error), (fine.n, fine.error))
