"""Which steps are good enough, compiled: a filter line search on (constraint violation, barrier function).

A. Waechter and L. T. Biegler, Line search filter methods for nonlinear programming: motivation and global
convergence, SIAM J. Optim. 16 (2005), with the second-order correction and the constants of their 2006 paper.
See :mod:`stc.solver.state` for the numbers ``s`` and the calls.
"""

from __future__ import annotations

from stc.codegen.calls import invoke
from stc.codegen.native import exp, f64, f64s, fabs, i64, i64s, log, native
from stc.solver.filter import GAMMA_PHI, GAMMA_THETA, accepts, add
from stc.solver.products import EPSILON
from stc.solver.state import (
    CENTRE,
    CHANGED,
    CORRECTION,
    DOUBT,
    ENDED_BY,
    EQUATIONS,
    FINITE,
    FROM_PHI,
    FROM_SLOPE,
    FROM_THETA,
    LENGTH_TAKEN,
    LENGTHENS,
    LIMIT,
    LOG_SLOPE,
    LOGARITHMS,
    MOVE,
    MOVED,
    MU,
    OBJECTIVE,
    PRIMAL_STEP,
    REACH,
    RELATIVE,
    RETURN,
    SHIFT,
    SHORTEST,
    SLOPE,
    SMALL_THETA,
    TAU,
    THETA,
    TINY,
    TRIAL_GAP,
    TRIAL_LOGARITHMS,
    TRIAL_THETA,
    TRY_POINT,
    TRY_STEP,
    WHOLE,
)

DELTA = 1.0
S_THETA = 1.1
S_PHI = 2.3
ETA = 1e-8
SMALL_VIOLATION = 1e-4
HALF = 0.5
"""Of a step, of a violation or of an error: what is nearly whole, and what is clearly less."""
GAMMA_ALPHA = 0.05
MOST_CORRECTIONS = 4
CORRECTION_PROGRESS = 0.99
SMALLEST_POWER = 1e-300
LONGER, WORTHWHILE = 2.0, 1.25
"""By how much a step is lengthened at a time, and at least."""
LIKELY = 0.25
"""Share of the fall that the Lagrangian's slope promises, which has to come true for that."""
DOWNHILL = 0.5
"""Share of the same slope that is to be the barrier function's, rather than the violation's."""
SURE = 0.3
"""How far the Lagrangian may be from the parabola through what was found before, relative to its fall."""
#: How a search may end.
TAKEN, NOT_TAKEN, CALL_MISSING, NOT_FINITE = 0, 1, 2, 3
#: What a point tried may be: refused, acceptable by its barrier function, or by the filter, which is then extended.
REFUSED, DESCENT, OUTSIDE = 0, 1, 2


@native
def power(base: f64, exponent: f64) -> f64:
    """``base ** exponent`` of a number that is not negative."""
    return exp(exponent * log(base)) if base > 0.0 else 0.0


@native
def smallest_fraction(theta: f64, slope: f64, s: f64s) -> f64:
    """The fraction of a step below which none can be expected to be acceptable."""
    smallest = GAMMA_THETA
    if slope < 0.0:
        smallest = min(smallest, GAMMA_PHI * theta / -slope)
        if theta <= s[SMALL_THETA]:
            smallest = min(
                smallest, DELTA * power(theta, S_THETA) / max(power(-slope, S_PHI), SMALLEST_POWER)
            )
    return max(GAMMA_ALPHA * smallest, 1e-14)


@native
def judge(alpha: f64, trial_theta: f64, trial_phi: f64, filter: f64s, s: f64s) -> i64:
    """Whether the point tried is good enough, after a fraction ``alpha`` of the step."""
    if accepts(filter, trial_theta, trial_phi) == 0:
        return REFUSED
    theta = s[FROM_THETA]
    phi = s[FROM_PHI]
    slope = s[FROM_SLOPE]
    noise = 10.0 * EPSILON * fabs(phi)
    if (
        theta <= s[SMALL_THETA]
        and slope < 0.0
        and alpha * power(-slope, S_PHI) > DELTA * power(theta, S_THETA)
    ):
        return DESCENT if trial_phi - phi - noise <= ETA * alpha * slope else REFUSED
    if trial_theta <= (1.0 - GAMMA_THETA) * theta or trial_phi - phi - noise <= -GAMMA_PHI * theta:
        return OUTSIDE
    return REFUSED


@native
def barrier_of(gaps: i64, f: f64, logarithms: f64, s: f64s) -> f64:
    """The barrier function."""
    return f - s[MU] * logarithms if gaps > 0 else f


@native
def is_inside(f: f64s, s: f64s) -> i64:
    """Whether functions are defined at the point tried, and no gap is closed there."""
    total = f[0] + s[TRIAL_THETA]
    return 1 if total - total == 0.0 and s[TRIAL_GAP] > 0.0 else 0


@native(shared=True)
def take(
    calls: i64s, kind: i64, alpha: f64, alphas: f64s, mu: f64s, shifted: f64s, filter: f64s, s: f64s
) -> i64:
    """Make the point tried the iterate; 0 where a derivative is undefined there."""
    alphas[0] = alpha
    mu[0] = s[MU]
    shifted[0] = 1.0 if s[SHIFT] != 0.0 and s[EQUATIONS] != 0.0 else 0.0
    invoke(calls, MOVE)
    if s[MOVED] == 0.0:
        invoke(calls, RETURN)
        return 0
    if kind == OUTSIDE:
        add(filter, s[FROM_THETA], s[FROM_PHI])
    return 1


@native(shared=True)
def correct(
    calls: i64s, n: i64, m: i64, gaps: i64, index: i64s, sign: f64s, alpha: f64, w: f64s, c: f64s, gap: f64s,
    trial_w: f64s, trial_c: f64s, x: f64s, f: f64s, dw: f64s, residual: f64s, mu: f64s, report: f64s, filter: f64s,
    s: f64s,
) -> i64:  # fmt: skip
    """Second-order correction: try the step that also removes the violation seen at the point tried.

    Returns:
        What the point tried last is.
    """
    for r in range(m):
        residual[r] = alpha * c[r] + trial_c[r]
    last = s[TRIAL_THETA]
    for _ in range(MOST_CORRECTIONS):
        mu[0] = s[MU]
        invoke(calls, CENTRE)
        invoke(calls, CORRECTION)
        if report[0] > s[DOUBT]:
            return REFUSED
        fall = 0.0
        for k in range(gaps):
            fall = max(fall, -sign[k] * dw[index[k]] / gap[k])
        length = 1.0 if fall <= s[TAU] else s[TAU] / fall
        for i in range(n + m):
            trial_w[i] = w[i] + length * dw[i]
        for i in range(n):
            x[i] = trial_w[i]
        invoke(calls, TRY_POINT)
        if is_inside(f, s) == 0:
            return REFUSED
        now = s[TRIAL_THETA]
        kind = judge(alpha, now, barrier_of(gaps, f[0], s[TRIAL_LOGARITHMS], s), filter, s)
        if kind != REFUSED:
            return kind
        if now > CORRECTION_PROGRESS * last:
            return REFUSED
        last = now
        for r in range(m):
            residual[r] = length * residual[r] + trial_c[r]
    return REFUSED


@native(fast=True)
def lagrangian(m: i64, phi: f64, y: f64s, dy: f64s, c: f64s) -> f64:
    """The barrier function ``phi`` plus the violations ``c`` (m,) times the multipliers that a step leads to."""
    total = phi
    for r in range(m):
        total += (y[r] + dy[r]) * c[r]
    return total


@native
def may_lengthen(s: f64s) -> i64:
    """Whether more than all of the step may be better: a shift has made it short, and will do so again.

    Not so with the rows' part of the Hessian damped: there the shift falls from step to step.
    """
    shortened = s[SHIFT] != 0.0 and s[WHOLE] != 0.0 and s[TINY] == 0.0
    return 1 if s[LENGTHENS] != 0.0 and shortened and s[LIMIT] >= 1.0 else 0


@native(shared=True)
def lengthen(
    calls: i64s, m: i64, gaps: i64, y: f64s, c: f64s, dy: f64s, trial_c: f64s, f: f64s, alphas: f64s, filter: f64s,
    s: f64s,
) -> f64:  # fmt: skip
    """How much of the step to take, one or more, where all of it has just been tried and would do.

    A shift bounds the step as a trust region does, and those are made larger where their model is right (A. R. Conn,
    N. I. M. Gould and Ph. L. Toint, Trust-region methods, SIAM 2000, 6.1). Along the step that is as if the shift were
    smaller, even where the matrix would be indefinite. The model is the Lagrangian with the multipliers that go with
    the step, which knows of the rows' curvature: it has to fall as foreseen, and that mostly by the barrier function;
    and the violation may grow as curvature makes it. Linear rows, which all of the step meets, are met.
    What is found is the point tried.
    """
    before = lagrangian(m, s[FROM_PHI], y, dy, c)
    slope = s[FROM_SLOPE] - (before - s[FROM_PHI])
    change = lagrangian(m, barrier_of(gaps, f[0], s[TRIAL_LOGARITHMS], s), y, dy, trial_c) - before
    theta = s[TRIAL_THETA]
    alpha = 1.0
    if not (slope < 0.0 and s[FROM_SLOPE] <= DOWNHILL * slope and change <= LIKELY * slope):
        return alpha
    bend = change - slope
    while True:
        longer = min(LONGER * alpha, s[REACH])
        if longer < WORTHWHILE * alpha:
            return alpha
        alphas[0] = longer
        invoke(calls, TRY_STEP)
        better = REFUSED
        if is_inside(f, s) != 0:
            phi = barrier_of(gaps, f[0], s[TRIAL_LOGARITHMS], s)
            further = lagrangian(m, phi, y, dy, trial_c) - before
            foreseen = longer * (slope + longer * bend)
            falls = further <= change + LIKELY * (longer - alpha) * slope
            bends = s[TRIAL_THETA] <= LONGER * LONGER * theta
            if falls and bends and fabs(further - foreseen) <= SURE * fabs(foreseen):
                better = judge(longer, s[TRIAL_THETA], phi, filter, s)
                change = further
                theta = s[TRIAL_THETA]
        if better == REFUSED:
            alphas[0] = alpha
            invoke(calls, TRY_STEP)
            return alpha
        alpha = longer


@native(shared=True)
def backtrack(
    calls: i64s, n: i64, m: i64, gaps: i64, index: i64s, sign: f64s, w: f64s, y: f64s, c: f64s, gap: f64s, dy: f64s,
    trial_w: f64s, trial_c: f64s, x: f64s, f: f64s, dw: f64s, residual: f64s, alphas: f64s, mu: f64s, shifted: f64s,
    report: f64s, filter: f64s, s: f64s,
) -> i64:  # fmt: skip
    """Move the iterate along the step by the largest fraction of :data:`LIMIT`, halved again and again, that will do.

    Where all of the step will, more than that may be taken (:func:`lengthen`). ``dy`` is the step's;
    ``dw`` and ``residual`` are those of the second-order correction.

    Returns:
        TAKEN, NOT_TAKEN or CALL_MISSING.
    """
    theta = s[FROM_THETA]
    limit = s[LIMIT]
    s[LENGTH_TAKEN] = 0.0
    smallest = max(smallest_fraction(theta, s[FROM_SLOPE], s), s[SHORTEST] * limit)
    first = True
    alpha = limit
    while alpha >= smallest or first:
        alphas[0] = alpha
        invoke(calls, TRY_STEP)
        if is_inside(f, s) != 0:
            kind = DESCENT
            if s[TINY] == 0.0:
                kind = judge(alpha, s[TRIAL_THETA], barrier_of(gaps, f[0], s[TRIAL_LOGARITHMS], s), filter, s)
            if kind == REFUSED and first and s[TRIAL_THETA] >= theta and theta > 0.0:
                if calls[2 * CORRECTION] == 0:
                    return CALL_MISSING
                kind = correct(
                    calls, n, m, gaps, index, sign, alpha, w, c, gap, trial_w, trial_c, x, f, dw, residual, mu, report,
                    filter, s,
                )  # fmt: skip
            elif kind != REFUSED and first and may_lengthen(s) != 0:
                alpha = lengthen(calls, m, gaps, y, c, dy, trial_c, f, alphas, filter, s)
                if alpha > limit:
                    phi = barrier_of(gaps, f[0], s[TRIAL_LOGARITHMS], s)
                    kind = judge(alpha, s[TRIAL_THETA], phi, filter, s)
            if kind != REFUSED and take(calls, kind, alpha, alphas, mu, shifted, filter, s) != 0:
                s[LENGTH_TAKEN] = alpha
                return TAKEN
        first = False
        alpha *= 0.5
    return NOT_TAKEN


@native(shared=True)
def search(
    calls: i64s, n: i64, m: i64, gaps: i64, index: i64s, sign: f64s, w: f64s, y: f64s, c: f64s, gap: f64s, dy: f64s,
    trial_w: f64s, trial_c: f64s, x: f64s, f: f64s, dw: f64s, residual: f64s, alphas: f64s, mu: f64s, shifted: f64s,
    report: f64s, filter: f64s, s: f64s,
) -> i64:  # fmt: skip
    """Search along the step from the iterate.

    Returns:
        As :func:`backtrack`, or NOT_FINITE; ``s[ENDED_BY]`` keeps it.
    """
    s[LENGTH_TAKEN] = 0.0
    if s[CHANGED] != 0.0:
        filter[0] = 0.0
    ended = NOT_FINITE
    if s[FINITE] == 0.0:
        theta = s[THETA]
        s[FROM_THETA] = theta
        s[FROM_PHI] = barrier_of(gaps, s[OBJECTIVE], s[LOGARITHMS], s)
        s[FROM_SLOPE] = s[SLOPE] - s[MU] * s[LOG_SLOPE]
        s[LIMIT] = s[PRIMAL_STEP]
        s[TINY] = 1.0 if s[RELATIVE] < 10.0 * EPSILON and theta < SMALL_VIOLATION else 0.0
        ended = backtrack(
            calls, n, m, gaps, index, sign, w, y, c, gap, dy, trial_w, trial_c, x, f, dw, residual, alphas, mu,
            shifted, report, filter, s,
        )  # fmt: skip
    s[ENDED_BY] = float(ended)
    return ended
