"""More frames until a motion passes its validation, or the reason why more frames do not help.

Unlike :mod:`stc.studies.verified`, which drives one drift below a given number, this search stops as soon as every
measurement of the verdict is within its limit.  On the ground these limits are wide, since the model's contacts give
way, and few frames are enough.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import Any

from stc.errors import UsageError
from stc.pipeline import Model
from stc.records import dataclass, field
from stc.solution import Solution
from stc.statements_between import statements_between
from stc.studies.effort import Clock, Effort
from stc.studies.finer import solve_finer
from stc.studies.frames import MOST_AT_ONCE, ORDER, SAFETY, Spread, in_shares
from stc.studies.grid_error import GROSS, local_grid_error
from stc.studies.refinement import MOST_FROM_GROSS
from stc.validate.certificate import certify
from stc.validate.certificate.advice import cured_by_frames, fine_enough
from stc.validate.metrics import Metric

__all__ = ["Attempt", "Passing", "frames_needed", "solve_until_passed"]

MOST_ATTEMPTS = 5
NO_FALL = 0.7
"""The search stops if, with more frames, neither the worst measurement nor the error of a step is below this share of
the last one, or twice in a row the measurement is not."""


@dataclass(frozen=True, slots=True)
class Attempt:
    """One solve and its verdict.

    Attributes
    ----------
    n : int
        Number of steps.
    status, objective, iterations
        Results of the solve.
    worst : str
        The measurement that exceeds its limit most, of those that more frames can reduce; empty if there is none.
    excess : float
        Its value as a multiple of the limit; 0 if there is none.
    grid_error : float
        The largest estimated error of a step, as a share; 0 if there is no estimate.
    """

    n: int
    status: str
    objective: float
    iterations: int
    worst: str
    excess: float
    grid_error: float


@dataclass(slots=True)
class Passing:
    """The result of :func:`solve_until_passed`.

    Attributes
    ----------
    attempts : list[Attempt]
        The solves in order.
    solution : Solution | None
        The last optimal solution (that of the first solve if it was not optimal).
    effort : Effort
        Totals of all solves.
    message : str
        Why the motion did not pass; empty if it did.
    """

    attempts: list[Attempt] = field(default_factory=list)
    solution: Solution | None = None
    effort: Effort = field(default_factory=Effort)
    message: str = ""

    def to_dict(self) -> dict[str, Any]:
        """The result for JSON."""
        return {"passed": not self.message, "attempts": [asdict(one) for one in self.attempts]}


def frames_needed(method: str, metrics: Sequence[Metric]) -> int:
    """The factor, at least 2, by which the frames must be multiplied to bring the measurements below their limits.

    The residual of an equation of motion within a step decreases like the acceleration's error, with half the order.
    """
    times = 2.0
    for metric in metrics:
        if metric.verdict == "fail" and metric.limit and cured_by_frames(metric):
            order = ORDER[method] / (2 if metric.name.endswith("between frames") else 1)
            times = max(times, (metric.value / (SAFETY * metric.limit)) ** (1.0 / order))
    return math.ceil(min(times, MOST_AT_ONCE)) if math.isfinite(times) else MOST_AT_ONCE


def solve_until_passed(
    model: Model,
    *,
    solve: Callable[..., Solution] | None = None,
    on_attempt: Callable[[Attempt], None] | None = None,
    start: Solution | None = None,
    **options: Any,
) -> Passing:
    """Add frames until a motion passes its validation, or report why more frames do not help.

    Parameters
    ----------
    model : Model
        The spec, with a ``replay:`` section or a model; its n is that of the first solve.
    solve : Callable[..., Solution] | None
        Function to use in place of ``model.solve``, with the same arguments (to watch it); then ``model`` must state
        its frames as shares of n (:func:`stc.studies.frames.in_shares`).
    on_attempt : Callable[[Attempt], None] | None
        Called with the record of every solve.
    start : Solution | None
        A solution of the first problem, if there is one already; it is not solved again.
    **options : Any
        Arguments of :meth:`stc.pipeline.Model.solve`; a time limit applies to all solves together.

    Returns
    -------
    Passing
        The solves, with the last optimal solution.

    Raises
    ------
    UsageError
        A motion of one frame, or a spec that names no model.
    ModelError
        The model is missing, or a replay line does not fit it.
    SpecError, EvaluationError
        Mistakes in the spec, or a start where a function is undefined.
    """
    if solve is None:
        model = in_shares(model, options.get("method"), **options.get("constants", {}))
        solve = model.solve
    constants = dict(options.pop("constants", {}))
    clock = Clock(options.pop("time_limit", None))
    spread = Spread.of(model, options.get("method"), constants)
    if spread.problem.model is None:
        raise UsageError(
            f"{spread.problem.name} names no model", "a `replay:` section ties a spec to its model"
        )
    found, times = Passing(), 1
    overrides: dict[str, float] = {}
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
        metrics = certify(solution, statements=statements_between(solution)).metrics if good else ()
        told = local_grid_error(solution)
        found.attempts.append(_attempt(solution, metrics, 0.0 if told is None else told.largest))
        if on_attempt is not None:
            on_attempt(found.attempts[-1])
        if good or found.solution is None:
            found.solution = solution
        found.message = _in_the_way(found, good, metrics, clock)
        if found.message or all(metric.verdict != "fail" for metric in metrics):
            return found
        needed = frames_needed(solution.method, metrics)
        # An error so large says little of how it falls, and the motion may be an artefact of its grid.
        times *= needed if told is None or told.largest <= GROSS else min(needed, MOST_FROM_GROSS)
        try:
            overrides = spread.multiplied(times)
        except UsageError as reason:
            found.message = f"more frames are needed, and {reason}"
            return found


def _attempt(solution: Solution, metrics: Sequence[Metric], grid_error: float) -> Attempt:
    beyond = [(one.value / one.limit, one) for one in metrics if one.limit and _can_fall(one)]
    excess, worst = max(beyond, key=lambda pair: pair[0], default=(0.0, None))
    name = "" if worst is None else f"{worst.name}, {worst.subject}"
    return Attempt(
        solution.n, solution.status, solution.objective, solution.iterations, name, excess, grid_error
    )


def _can_fall(metric: Metric) -> bool:
    return metric.verdict == "fail" and cured_by_frames(metric)


def _in_the_way(found: Passing, good: bool, metrics: Sequence[Metric], clock: Clock) -> str:
    """Why more frames do not help; "" if they may, or none are needed."""
    now = found.attempts[-1]
    if not good:
        return f"with n = {now.n} the solve ended {now.status}"
    failed = [one for one in metrics if one.verdict == "fail"]
    other = next((one for one in failed if not cured_by_frames(one)), None)
    if other is not None:
        return f"more frames cannot correct what is wrong with n = {now.n}: {other.name}, {other.subject}"
    if failed and fine_enough(metrics):
        return f"with n = {now.n} the rest is due to the model's contacts, which more frames cannot correct"
    if failed and clock.is_over:
        return f"the time limit of {clock.limit:g} s came first, with n = {now.n}"
    stalls = [b.excess > NO_FALL * a.excess for a, b in pairwise(found.attempts)]
    # From a coarse grid a drift may rise at first; then the steps' own errors fall.
    rises = [b.grid_error > NO_FALL * a.grid_error for a, b in pairwise(found.attempts)]
    if failed and stalls[-1:] == [True] and (rises[-1] or stalls[-2:] == [True, True]):
        before = found.attempts[-2]
        return (
            f"more frames no longer help: {now.worst} is {now.excess:.3g} times its limit with n = {now.n}, after "
            f"{before.excess:.3g} times with n = {before.n}"
        )
    return (
        f"not passed after {MOST_ATTEMPTS} solves" if failed and len(found.attempts) == MOST_ATTEMPTS else ""
    )
