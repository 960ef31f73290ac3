"""Compiled parts of Newton's method on the active set: how far a point is from a solution, and what a step leads to.

See :mod:`stc.solver.projection` for the points and :mod:`stc.solver.active_set` for the method.
"""

from __future__ import annotations

from stc.codegen.calls import invoke
from stc.codegen.native import f64, f64s, i64, i64s, native
from stc.solver.kernels import multiplier_scale

__all__ = [
    "ACCURATE",
    "ADVANCE",
    "CALLS",
    "CONTRACTION",
    "EVALUATE",
    "REMAINING",
    "SOLVE",
    "improve",
    "judge",
    "undefined",
]

CONTRACTION = 0.1
ACCURATE = 0.1
"""Share of the tolerance that a point is to reach where another step would."""
CORRECTIONS = 3
EXACT = 1e-3
"""Share of the tolerance above which a correction with the factorisation at hand is worth its while."""

#: Calls of a pair of points, those of the first one and then of the second: evaluate it; the right-hand side for a
#: correction from there; move from there to the other one. The last one solves.
EVALUATE, REMAINING, ADVANCE, SOLVE, CALLS = 0, 2, 4, 6, 7


@native
def undefined(status: f64s) -> i64:
    """1 where functions are undefined."""
    return 1 if status[0] != 0.0 else 0


@native
def judge(count: i64, of_x: f64s, of_rows: f64s, status: f64s, error: f64s) -> i64:
    """The largest violated condition, dual ones over the size of the ``count`` multipliers; 1 where it is none.

    Args:
        of_x, of_rows: see ``conditions.project_entries``.
        status: of the derivatives.
        error: the result.
    """
    dual = max(of_x[1], of_rows[1])
    error[0] = max(max(of_x[0], of_rows[0]), dual / multiplier_scale(of_x[2] + of_rows[2], count))
    check = error[0] + of_x[1] + of_rows[1] + status[0]
    return 0 if check - check == 0.0 else 1


@native
def _differ(count: i64, one: f64s, other: f64s) -> i64:
    """1 where some of the numbers do."""
    differing = 0
    for k in range(count):
        if one[k] != other[k]:
            differing = 1
    return differing


@native(shared=True)
def improve(
    calls: i64s, here: i64, n: i64, m: i64, tolerance: f64, active_x: f64s, active_rows: f64s, other_active_x: f64s,
    other_active_rows: f64s, errors: f64s, other_errors: f64s, largest: f64s,
) -> i64:  # fmt: skip
    """Make a Newton step, found already, and make it better with the same factorisation where it has contracted.

    A correction makes a factorisation gain as much as one and a half Newton steps (J. F. Traub, Iterative methods for
    the solution of equations, 1964, section 8.4).  One is made, and more where that saves another step.

    Args:
        calls: those of the pair of points.
        here: the point where the step begins, 0 or 1.
        tolerance: the error to reach.
        active_x, active_rows, errors: of the first point; then those of the other one.
        largest: becomes the largest change of a variable, and what is 0 where all is finite.

    Returns:
        The place of the point it leads to, counted from 1, or 0 where there is none.
    """
    now = 1 - here
    invoke(calls, ADVANCE + here)
    if largest[1] != 0.0 or invoke(calls, EVALUATE + now) != 0:
        return 0
    before = errors[0] if here == 0 else other_errors[0]
    error = errors[0] if now == 0 else other_errors[0]
    enough = ACCURATE * tolerance
    left = CORRECTIONS
    while left > 0 and EXACT * tolerance < error and error <= CONTRACTION * before:
        if left < CORRECTIONS:
            reached = error
            for _k in range(left):
                reached *= error / before
            if reached > (enough if error > enough else EXACT * tolerance):
                break
        if _differ(n, active_x, other_active_x) + _differ(m, active_rows, other_active_rows) != 0:
            break
        invoke(calls, REMAINING + now)
        invoke(calls, SOLVE)
        change = largest[0]
        invoke(calls, ADVANCE + now)
        closer = error
        if largest[1] == 0.0 and invoke(calls, EVALUATE + 1 - now) == 0:
            closer = errors[0] if now == 1 else other_errors[0]
        if not closer < error:
            largest[0] = change
            break
        largest[0] += change
        before = error
        error = closer
        now = 1 - now
        left -= 1
    return now + 1
