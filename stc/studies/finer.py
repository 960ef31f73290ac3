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
    """A solution on more frames, from the solution on fewer frames or, if that fails or is not a good guess, from the
    first start.

    A coarse optimum may be an artefact of its grid, and far from any optimum of the fine grid.  The grid error shows
    this: if it is very large, the solve starts from the first start; if it is gross, from both, and the better one
    counts.

    Args:
        solve: see :meth:`stc.pipeline.Model.solve`.
        before: the solution on fewer frames.
        options: options of the first solve, with the constants of this one.
        clock: the remaining time; effort: the totals to which solves are added.
        ways_left: whether the caller can try fewer frames if the solve from a good solution fails; then the first
            start is not used.
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
    """The better of two solutions on the same frames; the first one if both are equally good."""
    if one.status == other.status == "optimal":
        return other if other.objective < one.objective - SAME * (1.0 + abs(one.objective)) else one
    return other if other.status in _FINAL and one.status != "optimal" else one
