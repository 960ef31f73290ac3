"""How far the barrier parameter mu goes down at each iteration, and the step that goes with it, compiled.

While the iterates make progress, mu is chosen anew at each one from a model of the optimality error after the
step (J. Nocedal, A. Waechter and R. A. Waltz, Adaptive barrier update strategies for nonlinear interior
methods, SIAM J. Optim. 19, 2009: the quality function).  When they don't, it is held until the barrier problem
is solved and then reduced superlinearly (Fiacco and McCormick), which is what the convergence theory covers.

See :mod:`stc.solver.state` for the numbers ``s`` and the calls.
"""

from __future__ import annotations

from stc.codegen.calls import invoke
from stc.codegen.native import f64, f64s, i64, i64s, isfinite, native, sqrt
from stc.solver.filter import accepts, add
from stc.solver.state import (
    ADAPTIVE,
    CENTRE,
    CHANGED,
    COMBINE,
    DOUBT,
    ERROR,
    FREE,
    LARGEST_MU,
    LENGTHS,
    MEASURE,
    MU,
    NEWTON,
    OBJECTIVE,
    PREDICT,
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
    if gaps == 0:
        return
    average = s[PRODUCTS] / gaps
    if not isfinite(s[LARGEST_MU]):
        s[LARGEST_MU] = LARGEST_GROWTH * max(average, s[SMALLEST_MU])
    margin = MARGIN * min(1.0, s[ERROR])
    progress = 0
    if s[STUCK] == 0.0 and s[ADAPTIVE] != 0.0:
        progress = accepts(accepted, s[THETA] + margin, s[OBJECTIVE] + margin)
    if s[FREE] != 0.0:
        if progress != 0:
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


@native(shared=True)
def find_step(calls: i64s, gaps: i64, mu: f64s, tau: f64s, factor: f64s, report: f64s, s: f64s) -> i64:
    """Find the step with the factorised system; chooses mu first in the free mode.

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
    mu_now = max(s[SIGMA] * average, s[SMALLEST_MU])
    set_mu(min(mu_now, max(s[SMALLEST_MU], s[LARGEST_MU])), s)
    s[CHANGED] = 1.0
    factor[0] = s[MU] / average
    tau[0] = s[TAU]
    invoke(calls, COMBINE)
    return 0
