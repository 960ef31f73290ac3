"""Inertia correction, compiled: which shift of the Hessian to try next.

A. Waechter and L. T. Biegler, Math. Program. 106, 2006, algorithm IC. See :mod:`stc.solver.newton_system` for the
system, and :mod:`stc.solver.state` for the numbers ``s`` and the calls.
"""

from __future__ import annotations

from stc.codegen.calls import invoke
from stc.codegen.native import f64, f64s, fabs, i64, i64s, native, sqrt
from stc.solver.barrier_update import SMALLEST_TAU
from stc.solver.filter_line_search import HALF, SMALL_VIOLATION
from stc.solver.kkt.contract import COARSE
from stc.solver.products import NOTHING
from stc.solver.state import (
    ATTEMPT,
    BEND,
    BENDS,
    BENDS_ALIKE,
    DAMPED,
    DIAGONALS,
    DUAL_ERROR,
    DUAL_SHIFT,
    ENDED,
    ENDED_BY,
    EQUATIONS,
    ERROR,
    EXACT,
    EXCESS,
    FAILURES,
    LAST_SHIFT,
    MU,
    SHIFT,
    SHIFTED,
    SLOW_BEFORE,
    SLOW_BEST,
    SLOW_STEPS,
    SOFT,
    STIFFNESS,
    TASK,
    UNTRIED,
    WHOLE,
)

FIRST_SHIFT = 1e-4
"""In units of the Hessian's usual curvature, which is taken to be within these."""
SMALLEST_CURVATURE, LARGEST_CURVATURE = 1e-6, 1e2
SMALLEST_SHIFT = 1e-20
LARGEST_SHIFT = 1e40
GROWTH_AT_FIRST = 100.0
GROWTH = 8.0
DECAY = 1.0 / 3.0
MOST_UNTRIED = 3
"""Iterations in a row at most in which a matrix without a shift is not tried, after it has failed again and again."""
WATCHED, SLOW = 6, 0.6
"""So many damped steps in a row that are whole, but leave more than such a share of the dual error, are the last."""
BENT = 0.05
"""Share of the variables that an objective has to bend at least."""
#: What a factorisation has to do next: try the shifts, look at what that has found, shift more, damp, or either, ...
TRY, LOOK, GROW, DAMP, DAMP_OR_GROW = 0.0, 1.0, 2.0, 3.0, 4.0
#: ... and how it may end: done, or somebody else has to factorise, provide a call, or give up.
DONE, REFACTOR, CALL_MISSING, NO_SHIFT = 0, 1, 2, 3
UNKNOWN = -1.0


@native
def median_magnitude(count: i64, values: f64s) -> f64:
    """The median of the magnitudes that are not zero, 0 where all are; of two, the larger one.  Reorders ``values``.

    Found by parting them again and again (C. A. R. Hoare, Algorithm 65: find, Commun. ACM 4, 1961).
    """
    last = -1
    for k in range(count):
        value = fabs(values[k])
        if value > 0.0:
            last += 1
            values[last] = value
    if last < 0:
        return 0.0
    wanted = (last + 1) // 2
    first = 0
    while first < last:
        pivot = values[(first + last) // 2]
        low = first
        high = last
        while low <= high:
            while values[low] < pivot:
                low += 1
            while values[high] > pivot:
                high -= 1
            if low <= high:
                held = values[low]
                values[low] = values[high]
                values[high] = held
                low += 1
                high -= 1
        if wanted <= high:
            last = high
        elif wanted >= low:
            first = low
        else:
            return values[wanted]
    return values[wanted]


@native
def usual_curvature(count: i64, diagonal: i64s, hess: f64s, scratch: f64s) -> f64:
    """The median magnitude on the Hessian's diagonal, which the first shift of all is measured in.

    Entries of a motion's Hessian shrink with its steps of time, and a shift that is large beside all of them shortens
    steps in every direction: what is added to a diagonal has to be relative to the matrix (P. E. Gill, W. Murray and
    M. H. Wright, Practical Optimization, 1981, 4.4.2).

    Args:
        diagonal: which of ``hess`` are on its diagonal, (count,); ``scratch`` is work space, (count,).
    """
    for k in range(count):
        scratch[k] = hess[diagonal[k]]
    found = median_magnitude(count, scratch)
    return min(max(found, SMALLEST_CURVATURE), LARGEST_CURVATURE) if found > 0.0 else 1.0


@native
def smaller_shift(s: f64s) -> f64:
    """The first shift to try after the last iterate's."""
    return max(SMALLEST_SHIFT, DECAY * s[LAST_SHIFT])


@native(shared=True)
def begin(calls: i64s, s: f64s) -> None:
    """Prepare the factorisation at an iterate; :func:`factorize` does it."""
    invoke(calls, DIAGONALS)
    s[WHOLE] = 1.0
    s[SHIFT] = s[STIFFNESS]
    s[SOFT] = NOTHING * sqrt(sqrt(max(s[MU], 1e-12)))
    s[DUAL_SHIFT] = 0.0
    s[TASK] = TRY
    if s[UNTRIED] > 0.0:  # without a shift: it has failed again and again
        s[UNTRIED] -= 1.0
        s[SHIFT] = max(s[STIFFNESS], smaller_shift(s))
        if s[EXACT] == 0.0:
            s[TASK] = DAMP


@native
def larger_shift(s: f64s) -> f64:
    """The next shift to try, after another one or the last iterate's; more than LARGEST_SHIFT where there is none.

    Steps are the longer the nearer a shift is to the smallest that serves (J. J. More and D. C. Sorensen, SIAM J. Sci.
    Stat. Comput. 4, 1983): where a smaller one than the last iterate's has failed, that is tried next, before larger
    ones. Of a damped Hessian, whose shifts are small, a larger one costs less than a factorisation.
    """
    last = s[LAST_SHIFT]
    grown = s[SHIFT] * (GROWTH_AT_FIRST if last == 0.0 else GROWTH)
    if s[WHOLE] != 0.0 and s[SHIFT] < last:
        grown = min(grown, last)
    return max(grown, smaller_shift(s))


@native(shared=True)
def damp(calls: i64s, n: i64, count: i64, diagonal: i64s, bend: f64s, s: f64s) -> i64:
    """Use a share of the rows' part of the Hessian only; 0 when that is so already, or of no use."""
    if s[WHOLE] == 0.0 or s[BENDS] == 0.0:
        return 0
    if s[BENDS] == UNKNOWN or s[BENDS_ALIKE] == 0.0:
        invoke(calls, BEND)
    if s[BENDS] == UNKNOWN:
        bent = 0
        downwards = 0
        for k in range(count):
            bent += bend[diagonal[k]] > 0.0
            downwards += bend[diagonal[k]] < 0.0
        s[BENDS] = 1.0 if downwards == 0 and bent >= BENT * n and bent > 0 else 0.0
        if s[BENDS] == 0.0:
            return 0
    invoke(calls, DAMPED)
    s[WHOLE] = 0.0
    return 1


@native(shared=True)
def factorize(
    calls: i64s,
    n: i64,
    m: i64,
    count: i64,
    diagonal: i64s,
    bend: f64s,
    hess: f64s,
    scratch: f64s,
    inertia: i64s,
    accuracy: f64s,
    s: f64s,
) -> i64:
    """Factorise, shifting until the inertia is right.

    Returns:
        What somebody else has to do before this goes on: REFACTOR the matrix and leave its ``inertia`` (3,), and so
        on; ``s[ENDED_BY]`` keeps it.
    """
    ended = DONE
    while True:
        if s[TASK] == TRY:
            invoke(calls, SHIFTED)
            s[TASK] = LOOK
            s[ENDED] = 0.0
            if calls[2 * ATTEMPT] == 0:
                ended = REFACTOR
                break
            s[ENDED] = float(invoke(calls, ATTEMPT))
            if s[ENDED] != 0.0:
                ended = REFACTOR
                break
        if s[TASK] == DAMP:
            if calls[2 * BEND] == 0 and s[BENDS] != 0.0:
                ended = CALL_MISSING
                break
            s[TASK] = TRY
            damp(calls, n, count, diagonal, bend, s)
            continue
        if s[TASK] == LOOK:
            s[EXCESS] = float(inertia[1] - m)
            singular = inertia[2] > 0 or s[EXCESS] < 0.0
            if not singular and s[EXCESS] == 0.0:
                break
            s[TASK] = TRY
            if singular and s[DUAL_SHIFT] == 0.0 and s[EQUATIONS] != 0.0:
                s[DUAL_SHIFT] = s[SOFT]
                if s[SHIFT] == 0.0:
                    continue
            if s[SHIFT] == 0.0:
                s[FAILURES] += 1.0
                s[UNTRIED] = min(s[FAILURES] - 1.0, MOST_UNTRIED)
            s[TASK] = GROW if singular or s[EXACT] != 0.0 else DAMP_OR_GROW
        if s[TASK] == DAMP_OR_GROW:
            if calls[2 * BEND] == 0 and s[BENDS] != 0.0:
                ended = CALL_MISSING
                break
            s[TASK] = GROW
            if damp(calls, n, count, diagonal, bend, s) != 0 and s[SHIFT] > 0.0:
                s[TASK] = TRY
                continue
        if s[SHIFT] == 0.0 and s[LAST_SHIFT] == 0.0:
            s[SHIFT] = FIRST_SHIFT * usual_curvature(count, diagonal, hess, scratch)
        else:
            s[SHIFT] = larger_shift(s)
        s[TASK] = TRY
        if s[SHIFT] > LARGEST_SHIFT:
            ended = NO_SHIFT
            break
    s[ENDED_BY] = float(ended)
    if ended != DONE:
        return ended
    # Near a solution, what a solve leaves is an error of the multipliers that takes further iterations to be rid of.
    if s[ERROR] > SMALL_VIOLATION:
        accuracy[0] = COARSE
    if s[SHIFT] == 0.0:
        s[FAILURES] = 0.0
    if s[SHIFT] > 0.0:
        s[LAST_SHIFT] = s[SHIFT]
    return DONE


@native
def notice_slowness(length: f64, s: f64s) -> None:
    """Damp no more where that is all that makes the iteration slow: whole steps hardly change the dual error.

    Newton's own would all but remove it.  What is left out of the Hessian is then nearly as large as what is not, and
    the error falls by the same few per cent again and again, or goes up and down meanwhile.
    """
    if s[WHOLE] != 0.0 or length < SMALLEST_TAU:
        s[SLOW_STEPS] = 0.0
        s[SLOW_BEFORE] = 0.0
        return
    s[SLOW_BEST] = s[DUAL_ERROR] if s[SLOW_STEPS] == 0.0 else min(s[SLOW_BEST], s[DUAL_ERROR])
    s[SLOW_STEPS] += 1.0
    if s[SLOW_STEPS] >= WATCHED:
        if s[SLOW_BEFORE] > 0.0 and s[SLOW_BEST] > SLOW * s[SLOW_BEFORE]:
            s[BENDS] = 0.0
        s[SLOW_BEFORE] = s[SLOW_BEST]
        s[SLOW_STEPS] = 0.0


@native
def relax(length: f64, s: f64s) -> None:
    """Let the stiffness go where a step is accepted nearly whole, and where none is (``length`` 0)."""
    notice_slowness(length, s)
    if length == 0.0:
        s[STIFFNESS] = 0.0
    elif s[SHIFT] > 0.0:
        s[LAST_SHIFT] = s[SHIFT]
    if length >= HALF:
        s[STIFFNESS] = 0.0
