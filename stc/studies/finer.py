"""A solve of the same motion on more frames."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from stc.solution import Solution
from stc.solver.options import Options
from stc.studies.doubled import FROM_COARSER
from stc.studies.effort import Clock, Effort
from stc.studies.grid_error import GROSS, NO_GUESS, local_grid_error

#: Iterations from where the first solve began, where another way is left.
FROM_GUESS = 500
#: Objectives that differ by less than this share are those of one optimum.
SAME = 1e-6
#: What a solve ends with that is not to be followed by another one.
_FINAL = ("optimal", "interrupted", "time_limit")


def solve_finer(
    solve: Callable[..., Solution],
    before: Solution,
    options: Mapping[str, Any],
    clock: Clock,
    effort: Effort,
    ways_left: bool = False,
    patience: int = FROM_COARSER,
) -> Solution:
    """The solution next to that on fewer frames, or, where that is no guess or leads nowhere, from where all began.

    A coarse optimum may be one of the coarse motion alone, from which every way to one of the fine motion is long.
    How far it is from a motion tells its grid error: where that is next to all, the solve begins where the first one
    did; where it is gross, from both, and the better one counts.

    Args:
        solve: see :meth:`stc.pipeline.Model.solve`.
        before: on fewer frames.
        options: of the first solve, but with the constants of this one.
        clock: what time is left; effort: what solves are added to.
        ways_left: whether the caller has fewer frames to try where a sound solution leads nowhere: then nothing begins
            where the first solve did.
        patience: iterations from the solution on fewer frames.
    """
    most = options.get("max_iterations") or Options().max_iterations
    few = {**options, "max_iterations": min(most, FROM_GUESS)}
    near = {**options, "max_iterations": min(most, patience), "warm_start": before, "guess": None}
    coarse = local_grid_error(before)
    error = 0.0 if coarse is None else coarse.largest
    if error > NO_GUESS:
        ways = [few, near, dict(options)]
    elif error > GROSS:
        ways = [near, few]
    else:
        ways = [near] if ways_left else [near, few]
    best: Solution | None = None
    for way in ways:
        solution = solve(**way, **clock.option())
        effort.add(solution)
        best = solution if best is None else _better(best, solution)
        if solution.status in _FINAL and not (way is near and GROSS < error <= NO_GUESS):
            break
        if clock.is_over:
            break
    assert best is not None
    return best


def _better(one: Solution, other: Solution) -> Solution:
    """Of two solutions on the same frames, the first being the one to keep where both are as good."""
    if one.status == other.status == "optimal":
        return other if other.objective < one.objective - SAME * (1.0 + abs(one.objective)) else one
    return other if other.status in _FINAL and one.status != "optimal" else one
