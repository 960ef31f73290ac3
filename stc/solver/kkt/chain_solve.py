"""Solving with the factors of a chain, refined: what its runs of stages do, and how that is put together.

A chain has one run of stages, or two from both ends and the tail between them, which two threads can be at.
"""

from __future__ import annotations

from stc.codegen.calls import invoke
from stc.codegen.native import f64s, fabs, i32s, i64, i64s, native
from stc.solver.kkt.chain_rows import subtract
from stc.solver.kkt.chain_substitution import (
    backward_both,
    backward_one_vector,
    forward_both,
    forward_one_vector,
)
from stc.solver.kkt.substitution import improves
from stc.solver.kkt.values import add_to, bring_scaled, return_scaled

__all__ = [
    "BACKWARD",
    "BACKWARD_TAIL",
    "CALLS",
    "FORWARD",
    "FORWARD_TAIL",
    "PROGRESS",
    "backward_run",
    "forward_run",
    "solve",
]

#: What a run of stages is to do: whether it is a first solution, which is checked, and for which of two vectors.
CHECKED, WHICH, PROGRESS = 0, 1, 2
BOTH, FIRST, SECOND = 0, 1, 2
#: Where the runs' calls are among the prepared ones.
FORWARD, FORWARD_TAIL, BACKWARD_TAIL, BACKWARD, CALLS = 0, 1, 2, 3, 4


@native(fast=True, inline=True)
def _copy(begin: i64, end: i64, x: f64s, y: f64s) -> None:
    for k in range(begin, end):
        y[k] = x[k]


@native(fast=True, inline=True)
def _zero(begin: i64, end: i64, x: f64s) -> None:
    for k in range(begin, end):
        x[k] = 0.0


@native
def forward_run(
    apart: i64,
    begin: i64,
    end: i64,
    tail: i64,
    size: i64,
    progress: i64s,
    distance: i64,
    stages: i64,
    table: i64s,
    code: i32s,
    stride: i64,
    factors: f64s,
    work: f64s,
    solution: f64s,
    change: f64s,
    aside: f64s,
    other_solution: f64s,
    other_change: f64s,
    other_aside: f64s,
) -> None:
    """Substitute forward with the factors of stages that follow one another.

    Args:
        apart: whether others are at other stages meanwhile: then a vector of its own is used, ``aside``, in which what
            is left to the stages from ``tail`` to ``size`` is found.
        begin, end: where the unknowns of these stages are in vectors.
        progress: CHECKED, whether ``solution`` is to be found, from the right-hand side that is there, or ``change``;
            WHICH of two.
        other arguments: see ``solve``.
    """
    which = progress[WHICH]
    x = change[0:]
    other_x = other_change[0:]
    if progress[CHECKED] != 0:
        x = solution[0:]
        other_x = other_solution[0:]
    if apart != 0:
        if which != SECOND:
            _copy(begin, end, x, aside)
            _zero(tail, size, aside)
        if which != FIRST:
            _copy(begin, end, other_x, other_aside)
            _zero(tail, size, other_aside)
        x = aside[0:]
        other_x = other_aside[0:]
    if which == BOTH:
        forward_both(distance, stages, table, code, stride, factors, work, x, other_x)
    elif which == FIRST:
        forward_one_vector(distance, stages, table, code, stride, factors, work, x)
    else:
        forward_one_vector(distance, stages, table, code, stride, factors, work, other_x)


@native
def backward_run(
    apart: i64,
    begin: i64,
    end: i64,
    tail: i64,
    size: i64,
    progress: i64s,
    distance: i64,
    stages: i64,
    table: i64s,
    code: i32s,
    stride: i64,
    units: f64s,
    factors: f64s,
    matrix: f64s,
    work: f64s,
    solution: f64s,
    change: f64s,
    aside: f64s,
    left: f64s,
    other_solution: f64s,
    other_change: f64s,
    other_aside: f64s,
    other_left: f64s,
) -> None:
    """Substitute back with the factors of these stages; arguments as for ``forward_run``.

    Where it is CHECKED, what ``solution`` leaves of the right-hand side is subtracted from ``change``: ``left`` has the
    stages' own part of that, and what is to be added to the stages from ``tail`` on.
    """
    which = progress[WHICH]
    checked = progress[CHECKED]
    x = change[0:]
    other_x = other_change[0:]
    if checked != 0:
        x = solution[0:]
        other_x = other_solution[0:]
    own = x[0:]
    other_own = other_x[0:]
    z = change[0:]
    other_z = other_change[0:]
    if apart != 0:
        own = aside[0:]
        other_own = other_aside[0:]
        z = left[0:]
        other_z = other_left[0:]
        if which != SECOND:
            _copy(tail, size, x, aside)
            if checked != 0:
                _copy(begin, end, change, left)
                _zero(tail, size, left)
        if which != FIRST:
            _copy(tail, size, other_x, other_aside)
            if checked != 0:
                _copy(begin, end, other_change, other_left)
                _zero(tail, size, other_left)
    if which == BOTH:
        backward_both(
            checked, distance, stages, table, code, stride, units, factors, matrix, work, own, other_own, z, other_z
        )  # fmt: skip
    elif which == FIRST:
        backward_one_vector(
            checked, distance, stages, table, code, stride, units, factors, matrix, work, own, z
        )
    else:
        backward_one_vector(
            checked, distance, stages, table, code, stride, units, factors, matrix, work, other_own, other_z
        )  # fmt: skip
    if apart != 0:
        if which != SECOND:
            _copy(begin, end, aside, x)
            if checked != 0:
                _copy(begin, end, left, change)
        if which != FIRST:
            _copy(begin, end, other_aside, other_x)
            if checked != 0:
                _copy(begin, end, other_left, other_change)


@native(shared=True)
def _substitute(
    which: i64, checked: i64, calls: i64s, place: i64, runs: i64, tail: i64, size: i64, progress: i64s, solution: f64s,
    change: f64s, aside: f64s, left: f64s, other_solution: f64s, other_change: f64s, other_aside: f64s,
    other_left: f64s,
) -> None:  # fmt: skip
    """Solve with the factors for ``solution``, where ``checked`` with ``change -= K solution``, or for ``change``.

    Args:
        which: BOTH, FIRST or SECOND of two vectors.
    """
    progress[WHICH] = which
    progress[CHECKED] = checked
    invoke(calls, place + FORWARD)
    if runs > 1:
        x = change[tail:]
        other_x = other_change[tail:]
        if checked != 0:
            x = solution[tail:]
            other_x = other_solution[tail:]
        if which != SECOND:
            add_to(size - tail, aside[tail:], x)
        if which != FIRST:
            add_to(size - tail, other_aside[tail:], other_x)
        invoke(calls, place + FORWARD_TAIL)
        invoke(calls, place + BACKWARD_TAIL)
    invoke(calls, place + BACKWARD)
    if runs > 1 and checked != 0:
        if which != SECOND:
            add_to(size - tail, left[tail:], change[tail:])
        if which != FIRST:
            add_to(size - tail, other_left[tail:], other_change[tail:])


@native(fast=True)
def _norms(size: i64, x: f64s, z: f64s, norms: f64s) -> None:
    """The largest magnitudes of x and z, nan when not all is finite."""
    check = 0.0
    length = 0.0
    remaining = 0.0
    for k in range(size):
        check += (x[k] + z[k]) * 0.0
        length = max(length, fabs(x[k]))
        remaining = max(remaining, fabs(z[k]))
    norms[0] = length + check
    norms[1] = remaining + check


@native(fast=True)
def _begin(size: i64, scaled_rhs: f64s, solution: f64s, change: f64s) -> None:
    for k in range(size):
        solution[k] = scaled_rhs[k]
        change[k] = scaled_rhs[k]


@native(fast=True)
def _refine(size: i64, change: f64s, kept: f64s, solution: f64s) -> None:
    for k in range(size):
        kept[k] = change[k]
        solution[k] += change[k]


@native(shared=True)
def solve(
    both: i64,
    refinements: i64,
    accuracy: f64s,
    calls: i64s,
    place: i64,
    runs: i64,
    tail: i64,
    progress: i64s,
    stages: i64,
    table: i64s,
    code: i32s,
    index: i32s,
    size: i64,
    stride: i64,
    matrix: f64s,
    scale: f64s,
    work: f64s,
    norms: f64s,
    aside: f64s,
    left: f64s,
    other_aside: f64s,
    other_left: f64s,
    rhs: f64s,
    scaled_rhs: f64s,
    solution: f64s,
    change: f64s,
    kept: f64s,
    result: f64s,
    other_rhs: f64s,
    other_scaled_rhs: f64s,
    other_solution: f64s,
    other_change: f64s,
    other_kept: f64s,
    other_result: f64s,
    report: f64s,
    other_report: f64s,
) -> None:
    """Solve K x = rhs, refined as in ``substitution.solve``.

    Args:
        both: whether to do the same for ``other_rhs``, in common passes; ``report`` then tells of the less accurate.
        calls, place: where the calls of the runs of stages are among the prepared ones: FORWARD and so on from
            ``place`` on; runs: see ``chain_elimination.eliminate``; tail: where the unknowns of the last run begin.
        progress: tells the runs what to do; aside, left: a vector each of the second part's own.
        stages ... scale: see ``chain_elimination.eliminate_run``; size: N.
        rhs, result: (N,); report: see ``substitution.REPORT``; the other arrays are work space.
    """
    length = bring_scaled(size, index, scale, rhs, scaled_rhs)
    other_length = 0.0
    if both != 0:
        other_length = bring_scaled(size, index, scale, other_rhs, other_scaled_rhs)
    active = 1 if length > 0.0 else 0
    other_active = 1 if other_length > 0.0 else 0
    report[0] = 1.0 * active
    report[1] = 0.0
    report[2] = 0.0
    other_report[0] = 1.0 * other_active
    _begin(size, scaled_rhs, solution, change)
    if both != 0:
        _begin(size, other_scaled_rhs, other_solution, other_change)
    _substitute(
        BOTH if both != 0 else FIRST, 1, calls, place, runs, tail, size, progress, solution, change, aside, left,
        other_solution, other_change, other_aside, other_left,
    )  # fmt: skip
    steps = 0
    while active + other_active > 0:
        report[1] = 1.0 * steps
        if active != 0:
            if steps > 0:
                subtract(stages, table, code, stride, matrix, work, size, solution, scaled_rhs, change)
            _norms(size, solution, change, norms)
            if steps == 0:
                report[2] = norms[0] / length
            active = improves(
                size, steps, refinements, accuracy[0], norms[1], length, norms[0], report, kept, solution
            )
        if other_active != 0:
            if steps > 0:
                subtract(
                    stages, table, code, stride, matrix, work, size, other_solution, other_scaled_rhs,
                    other_change,
                )  # fmt: skip
            _norms(size, other_solution, other_change, norms)
            other_active = improves(
                size, steps, refinements, accuracy[0], norms[1], other_length, norms[0], other_report, other_kept,
                other_solution,
            )  # fmt: skip
        steps += 1
        if active + other_active > 0:
            which = BOTH
            if other_active == 0:
                which = FIRST
            elif active == 0:
                which = SECOND
            _substitute(
                which, 0, calls, place, runs, tail, size, progress, solution, change, aside, left, other_solution,
                other_change, other_aside, other_left,
            )  # fmt: skip
        if active != 0:
            _refine(size, change, kept, solution)
        if other_active != 0:
            _refine(size, other_change, other_kept, other_solution)
    return_scaled(size, index, scale, solution, result)
    if both != 0:
        return_scaled(size, index, scale, other_solution, other_result)
        report[0] = max(report[0], other_report[0])
