"""A solve of the same motion on more frames."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from stc.solution import Solution
from stc.solver.options import Options
from stc.studies.effort import Clock, Effort

#: Iterations from the solution on fewer frames; it takes ten or so where that is near one on more frames.
FROM_COARSER = 500
#: What a solve ends with that is not to be followed by another one.
_FINAL = ("optimal", "interrupted", "time_limit")


def solve_finer(
    solve: Callable[..., Solution], before: Solution, options: Mapping[str, Any], clock: Clock, effort: Effort
) -> Solution:
    """The solution next to that on fewer frames, or, where none is found from there, from where the first solve began.

    A coarse optimum may be one of the coarse motion alone, from which every way to one of the fine motion is long.

    Args:
        solve: see :meth:`stc.pipeline.Model.solve`.
        before: on fewer frames.
        options: of the first solve, but with the constants of this one.
        clock: what time is left; effort: what solves are added to.
    """
    most = options.get("max_iterations") or Options().max_iterations
    started = {**options, "warm_start": before, "guess": None, "max_iterations": min(most, FROM_COARSER)}
    solution = solve(**started, **clock.option())
    effort.add(solution)
    if solution.status in _FINAL or clock.is_over:
        return solution
    other = solve(**options, **clock.option())
    effort.add(other)
    return other if other.status in _FINAL else solution
