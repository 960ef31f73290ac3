"""What is done with the segments of one part of a horizon, while another thread may be at those of another part.

A part is some groups of segments, which follow one another in vectors.  It reads what the rest has and writes nothing
that is not its own: what it leaves to the rest goes to a vector of its own, unless it is the first part, which goes on
where the rest has begun.  How parts are put together, in an order that does not depend on threads, is in
stc.solver.kkt.segmented_passes.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, i32s, i64, i64s, native
from stc.solver.kkt.lane_rows import subtract_segments
from stc.solver.kkt.lane_solve import backward, forward
from stc.solver.kkt.lane_state import COUNTED, STALE, WATCHED
from stc.solver.kkt.lanes import eliminate
from stc.solver.kkt.values import add_to, bring_scaled, return_scaled

__all__ = [
    "ACTIVE",
    "BACKWARD",
    "CALLS",
    "FORWARD",
    "NORMS",
    "OTHER_ACTIVE",
    "OTHER_RIGHT",
    "PROGRESS",
    "RETURN",
    "RIGHT",
    "SPREADS",
    "STEPS",
    "backward_part",
    "eliminate_part",
    "forward_part",
    "return_part",
]

#: Numbers that ``eliminate`` notes of the rows of a part.
SPREADS = 16
#: How far a solve is: refinements so far, and whether either solution is still to be refined.
STEPS, ACTIVE, OTHER_ACTIVE, PROGRESS = 0, 1, 2, 3
#: Largest magnitudes that a part finds: those of ``subtract_segments``, then of the scaled right-hand sides.
RIGHT, OTHER_RIGHT, NORMS = 4, 5, 8
#: Where the phases of a solve are among the prepared calls.
FORWARD, BACKWARD, RETURN, CALLS = 0, 1, 2, 3


@native(fast=True, inline=True)
def _clear(count: i64, x: f64s) -> None:
    for k in range(count):
        x[k] = 0.0


@native
def eliminate_part(
    groups: i64,
    table: i64s,
    index: i32s,
    code: i32s,
    growth: f64,
    suspect: f64,
    given: f64s,
    ring: f64s,
    diagonal: f64s,
    scale: f64s,
    result: f64s,
    work: f64s,
    scales: f64s,
    known: f64s,
    made: f64s,
    matrix: f64s,
    row_most: f64s,
    most: f64s,
    spread: f64s,
    factors: f64s,
    state: f64s,
    length: i64,
    outer: i64,
    rest: i64,
) -> None:
    """Eliminate the segments of a part (see ``eliminate``); ``state[COUNTED]`` becomes what that returns.

    Args:
        length, rest: numbers of ``result``, and of ``most`` from ``outer`` on, to be cleared first.
    """
    _clear(length, result)
    _clear(rest, most[outer:])
    for k in range(SPREADS):
        spread[k] = -STALE
    negative = eliminate(
        groups, table, index, code, growth, suspect, given, ring, diagonal, scale, result, work, scales, known,
        made, matrix, int(state[WATCHED]), row_most, most, spread, factors, state,
    )  # fmt: skip
    state[COUNTED] = 1.0 * negative


@native
def forward_part(
    both: i64,
    distance: i64,
    groups: i64,
    table: i64s,
    index: i32s,
    code: i32s,
    factors: f64s,
    part: f64s,
    progress: i64s,
    norms: f64s,
    begin: i64,
    end: i64,
    outer: i64,
    cleared: i64,
    scale: f64s,
    rhs: f64s,
    scaled_rhs: f64s,
    change: f64s,
    between: f64s,
    left: f64s,
    other_rhs: f64s,
    other_scaled_rhs: f64s,
    other_change: f64s,
    other_between: f64s,
    other_left: f64s,
) -> None:
    """Bring a part of the right-hand side, from ``begin`` to ``end``, and substitute forward (see ``forward``).

    Args:
        left: where what is left to the rest is added; from ``outer`` on, so many numbers are ``cleared`` there first.
    """
    count = end - begin
    source = change[0:]
    other_source = other_change[0:]
    if progress[STEPS] == 0:
        norms[RIGHT] = bring_scaled(count, index[begin:], scale[begin:], rhs, scaled_rhs[begin:])
        source = scaled_rhs[0:]
        if both != 0:
            norms[OTHER_RIGHT] = bring_scaled(
                count, index[begin:], scale[begin:], other_rhs, other_scaled_rhs[begin:]
            )
            other_source = other_scaled_rhs[0:]
    _clear(cleared, left[outer:])
    if both != 0:
        _clear(cleared, other_left[outer:])
        forward(
            1, distance, groups, table, index, code, factors, source, between, left, other_source, other_between,
            other_left, part,
        )  # fmt: skip
    else:
        forward(
            0, distance, groups, table, index, code, factors, source, between, left, other_source, other_between,
            other_left, part,
        )  # fmt: skip


@native(inline=True)
def _backward_part(
    both: i64, distance: i64, groups: i64, table: i64s, index: i32s, code: i32s, factors: f64s, matrix: f64s,
    work: f64s, part: f64s, progress: i64s, norms: f64s, begin: i64, end: i64, outer: i64, cleared: i64, between: f64s,
    kept: f64s, solution: f64s, scaled_rhs: f64s, change: f64s, left: f64s, other_between: f64s, other_kept: f64s,
    other_solution: f64s, other_scaled_rhs: f64s, other_change: f64s, other_left: f64s,
) -> None:  # fmt: skip
    """See ``backward_part``; ``both`` is a constant here."""
    target = kept[0:]
    other_target = other_kept[0:]
    if progress[STEPS] == 0:
        target = solution[0:]
        other_target = other_solution[0:]
    backward(
        both,
        distance,
        groups,
        table,
        index,
        code,
        factors,
        between,
        target,
        other_between,
        other_target,
        part,
    )
    if progress[STEPS] > 0 and progress[ACTIVE] != 0:
        add_to(end - begin, kept[begin:], solution[begin:])
    if progress[STEPS] > 0 and progress[OTHER_ACTIVE] != 0:
        add_to(end - begin, other_kept[begin:], other_solution[begin:])
    _clear(cleared, left[outer:])
    if both != 0:
        _clear(cleared, other_left[outer:])
    subtract_segments(
        both,
        distance,
        groups,
        table,
        index,
        code,
        matrix,
        solution,
        scaled_rhs,
        change,
        left,
        other_solution,
        other_scaled_rhs,
        other_change,
        other_left,
        work,
        part,
        norms,
    )


@native
def backward_part(
    both: i64,
    distance: i64,
    groups: i64,
    table: i64s,
    index: i32s,
    code: i32s,
    factors: f64s,
    matrix: f64s,
    work: f64s,
    part: f64s,
    progress: i64s,
    norms: f64s,
    begin: i64,
    end: i64,
    outer: i64,
    cleared: i64,
    between: f64s,
    kept: f64s,
    solution: f64s,
    scaled_rhs: f64s,
    change: f64s,
    left: f64s,
    other_between: f64s,
    other_kept: f64s,
    other_solution: f64s,
    other_scaled_rhs: f64s,
    other_change: f64s,
    other_left: f64s,
) -> None:
    """Substitute back (see ``backward``), refine the solution, and find its residual, ``change``.

    What the rest has of the solution is there; ``left`` and ``cleared`` as for ``forward_part``.
    """
    if both != 0:
        _backward_part(
            1, distance, groups, table, index, code, factors, matrix, work, part, progress, norms, begin, end, outer,
            cleared, between, kept, solution, scaled_rhs, change, left, other_between, other_kept, other_solution,
            other_scaled_rhs, other_change, other_left,
        )  # fmt: skip
    else:
        _backward_part(
            0, distance, groups, table, index, code, factors, matrix, work, part, progress, norms, begin, end, outer,
            cleared, between, kept, solution, scaled_rhs, change, left, other_between, other_kept, other_solution,
            other_scaled_rhs, other_change, other_left,
        )  # fmt: skip


@native
def return_part(
    both: i64, begin: i64, end: i64, index: i32s, scale: f64s, solution: f64s, result: f64s, other_solution: f64s,
    other_result: f64s,
) -> None:  # fmt: skip
    """Return a part of the solution to the unknowns' own order."""
    return_scaled(end - begin, index[begin:], scale[begin:], solution[begin:], result)
    if both != 0:
        return_scaled(end - begin, index[begin:], scale[begin:], other_solution[begin:], other_result)
