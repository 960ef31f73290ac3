"""The barrier parameter, and the step that goes with it, compiled.

See :mod:`stc.solver.barrier_parameter` for the method, :mod:`stc.solver.places` for the numbers ``s`` and the calls.
"""

from __future__ import annotations

from stc.codegen.calls import invoke
from stc.codegen.native import f64, f64s, i64, i64s, isfinite, native, sqrt
from stc.solver.filter import accepts, add
from stc.solver.places import (
    ADAPTIVE,
    BLOCKED,
    BOUNDED_ERROR,
    CENTRE,
    CENTRING_STEP,
    CHANGED,
    COMBINE,
    CRAWLS,
    DOUBT,
    DUAL_STEP,
    ERROR,
    ERROR_BEFORE,
    FREE,
    LARGEST_MU,
    LENGTHS,
    MEASURE,
    MU,
    MU_BEFORE,
    NEWTON,
    OBJECTIVE,
    PREDICT,
    PRIMAL_STEP,
    PRODUCTS,
    SIGMA,
    SMALLEST_MU,
    STUCK,
    TAU,
    THETA,
)

SMALLEST_TAU = 0.99
SOLVED = 10.0  # a barrier problem counts as solved when its error is below this multiple of mu
LINEAR_DECREASE = 0.2
MARGIN = 1e-5
HELD_FRACTION = 0.8
LARGEST_GROWTH = 1e3
ERROR_FRACTION = 1e-4
SHORT = 0.1
MANY = 3
RECENTRE = 0.1
LONG = 0.1
REACH = 0.3
GAIN = 0.1
NEAR_MU_BELOW, NEAR_MU_ABOVE = 0.1, 10.0
#: Where the error has become RELAPSE times larger, so often, with a parameter no less than CRAWL times the one before,
#: the free choice takes several steps for each small reduction: problems that are solved allow larger ones.
RELAPSE, CRAWL, PATIENT = 10.0, 0.25, 2.0
#: Why no step was found.
CALL_MISSING, DOUBTFUL_SOLUTION = 1, 2


@native
def set_mu(mu: f64, s: f64s) -> None:
    """Change the parameter, and the fraction of the way to the boundary with it."""
    if mu != s[MU]:
        s[CHANGED] = 1.0
    s[MU] = mu
    s[TAU] = max(SMALLEST_TAU, 1.0 - mu)


@native(shared=True)
def update(calls: i64s, gaps: i64, target: f64s, accepted: f64s, s: f64s) -> None:
    """Decide the mode for the iterate, just measured, and, in the held mode, the parameter.

    ``target`` is the barrier parameter that the iterate is measured with; ``accepted`` the filter of the free mode.
    """
    s[CHANGED] = 0.0
    s[BOUNDED_ERROR] = min(1.0, s[ERROR])
    if gaps == 0:
        return
    average = s[PRODUCTS] / gaps
    if not isfinite(s[LARGEST_MU]):
        s[LARGEST_MU] = LARGEST_GROWTH * max(average, s[SMALLEST_MU])
    margin = MARGIN * s[BOUNDED_ERROR]
    if s[FREE] != 0.0 and s[ERROR] > RELAPSE * s[ERROR_BEFORE] and s[MU] > CRAWL * s[MU_BEFORE]:
        s[CRAWLS] += 1.0
        if s[CRAWLS] >= PATIENT:
            s[ADAPTIVE] = 0.0
    s[ERROR_BEFORE] = s[ERROR]
    s[MU_BEFORE] = s[MU]
    progress = 0
    if s[STUCK] == 0.0 and s[ADAPTIVE] != 0.0:
        progress = accepts(accepted, s[THETA] + margin, s[OBJECTIVE] + margin)
    if s[FREE] != 0.0:
        if s[BLOCKED] >= MANY:  # very short steps call for more centring
            s[BLOCKED] = 0.0
            s[FREE] = 0.0
            set_mu(min(max(average, RECENTRE * s[BOUNDED_ERROR]), max(s[LARGEST_MU], average)), s)
        elif progress != 0:
            add(accepted, s[THETA], s[OBJECTIVE])
        else:
            s[FREE] = 0.0
            set_mu(min(max(HELD_FRACTION * average, s[SMALLEST_MU]), s[LARGEST_MU]), s)
        return
    if progress != 0:
        s[FREE] = 1.0
        add(accepted, s[THETA], s[OBJECTIVE])
        return
    stuck = s[STUCK] != 0.0
    while True:
        mu = s[MU]
        target[0] = mu
        invoke(calls, MEASURE)
        if not (s[ERROR] <= SOLVED * mu or stuck):
            break
        lower = max(s[SMALLEST_MU], min(LINEAR_DECREASE * mu, mu * sqrt(mu)))
        if lower >= mu:
            break
        set_mu(lower, s)
        stuck = False
    target[0] = 0.0


@native
def note_length(length: f64, s: f64s) -> None:
    """The length of the last step: several very short ones in a row call for more centring."""
    s[BLOCKED] = s[BLOCKED] + 1.0 if length < SHORT else 0.0


@native
def wanted(
    gaps: i64, index: i64s, sign: f64s, primal: f64, dual: f64, mu: f64, gap: f64s, z: f64s, dw: f64s, dz: f64s,
    centre: f64s,
) -> None:  # fmt: skip
    """What brings the products of gaps and multipliers near ``mu`` for a step of those lengths."""
    for k in range(gaps):
        product = (gap[k] + primal * (sign[k] * dw[index[k]])) * (z[k] + dual * dz[k])
        near = min(max(product, NEAR_MU_BELOW * mu), NEAR_MU_ABOVE * mu)
        centre[k] = max(near - product, -NEAR_MU_ABOVE * mu) / gap[k]


@native
def longer(
    gaps: i64, index: i64s, sign: f64s, tau: f64, gap: f64s, z: f64s, dw: f64s, dz: f64s, extra_w: f64s, extra_z: f64s,
    s: f64s,
) -> i64:  # fmt: skip
    """Whether a step goes further towards the bounds with what is added to it."""
    fall = 0.0
    fall_z = 0.0
    for k in range(gaps):
        fall = max(fall, -sign[k] * (dw[index[k]] + extra_w[index[k]]) / gap[k])
        fall_z = max(fall_z, -(dz[k] + extra_z[k]) / z[k])
    primal = 1.0 if fall <= tau else tau / fall
    dual = 1.0 if fall_z <= tau else tau / fall_z
    further = primal + dual >= s[PRIMAL_STEP] + s[DUAL_STEP] + GAIN * REACH
    return 1 if further and min(primal, dual) >= min(s[PRIMAL_STEP], s[DUAL_STEP]) else 0


@native(shared=True)
def find_step(
    calls: i64s, size: i64, m: i64, gaps: i64, index: i64s, sign: f64s, gap: f64s, z: f64s, mu: f64s, tau: f64s,
    factor: f64s, centre: f64s, report: f64s, dw: f64s, dy: f64s, dz: f64s, extra_w: f64s, extra_y: f64s,
    extra_z: f64s, s: f64s,
) -> i64:  # fmt: skip
    """Find the step with the factorised system; chooses mu first in the free mode.

    Where the bounds allow only a short step: the same with its worst complementarity products brought back near mu,
    if that lets it go further (J. Gondzio, Multiple centrality corrections in a primal-dual method for linear
    programming, Comput. Optim. Appl. 6, 1996).

    Returns:
        0, or CALL_MISSING, or DOUBTFUL_SOLUTION.
    """
    if s[FREE] == 0.0:
        if calls[2 * NEWTON] == 0:
            return CALL_MISSING
        mu[0] = s[MU]
        tau[0] = s[TAU]
        invoke(calls, CENTRE)
        invoke(calls, NEWTON)
        if report[0] > s[DOUBT]:
            return DOUBTFUL_SOLUTION
        invoke(calls, LENGTHS)
        return 0
    if calls[2 * PREDICT] == 0:
        return CALL_MISSING
    invoke(calls, PREDICT)
    if report[0] > s[DOUBT]:
        return DOUBTFUL_SOLUTION
    average = s[PRODUCTS] / gaps
    # Products far below the error keep steps short. Yet an error that a step has just made, where a function bends
    # sharply, is no reason to raise products that are down already: the next steps would undo, and make it, for ever.
    floor = max(s[SMALLEST_MU], min(ERROR_FRACTION * s[BOUNDED_ERROR], average))
    set_mu(min(max(s[SIGMA] * average, floor), max(floor, s[LARGEST_MU])), s)
    s[CHANGED] = 1.0
    factor[0] = s[MU] / average
    tau[0] = s[TAU]
    invoke(calls, COMBINE)
    primal = s[PRIMAL_STEP]
    dual = s[DUAL_STEP]
    if min(primal, dual) >= LONG:
        return 0
    if calls[2 * CENTRING_STEP] == 0:
        return CALL_MISSING
    further = min(1.0, primal + REACH)
    wanted(gaps, index, sign, further, min(1.0, dual + REACH), s[MU], gap, z, dw, dz, centre)
    invoke(calls, CENTRING_STEP)
    if report[0] > s[DOUBT]:
        return DOUBTFUL_SOLUTION
    if longer(gaps, index, sign, s[TAU], gap, z, dw, dz, extra_w, extra_z, s) != 0:
        for i in range(size):
            dw[i] += extra_w[i]
        for r in range(m):
            dy[r] += extra_y[r]
        for k in range(gaps):
            dz[k] += extra_z[k]
        invoke(calls, LENGTHS)
    return 0
