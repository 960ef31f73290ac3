"""The elastic form of a problem and its linear system, compiled (see :mod:`stc.solver.elastic`).

Unknowns are those of the problem, (n,), then p and q, (m,) each; entries of the Jacobian those of the problem, then the
columns of p and q.
"""

from __future__ import annotations

from stc.codegen.calls import invoke
from stc.codegen.native import f64, f64s, i64, i64s, native
from stc.solver.state import STATED

#: The calls of an attempt to factorise: what comes before, and the attempt of the problem's own system.
ELIMINATE, ATTEMPT, CALLS = 0, 1, 2


@native(fast=True)
def values(
    n: i64, m: i64, price: f64, curvature: f64s, reference: f64s, own_r: f64s, own_status: f64s, x: f64s, f: f64s,
    r: f64s, status: f64s,
) -> None:  # fmt: skip
    """The elastic objective and rows, from the problem's own."""
    away = 0.0
    for k in range(n):
        way = x[k] - reference[k]
        away += curvature[k] * way * way
    total = 0.0
    for k in range(m):
        p = x[n + k]
        q = x[n + m + k]
        r[k] = own_r[k] - p + q
        total += p + q
    f[0] = price * total + 0.5 * away
    status[0] = own_status[0] + 0.0 * f[0]


@native(fast=True)
def derivatives(
    n: i64, entries: i64, free: f64s, curvature: f64s, reference: f64s, own_jac: f64s, x: f64s, gradient: f64s,
    jac: f64s,
) -> None:  # fmt: skip
    """The elastic gradient and Jacobian, but for the parts of p and q, which are constant."""
    for k in range(n):
        gradient[k] = free[k] * curvature[k] * (x[k] - reference[k])
    for k in range(entries):
        jac[k] = own_jac[k]


@native
def state(unit: f64, f: f64s, s: f64s) -> None:
    """Note the problem's own objective in the user's terms."""
    s[STATED] = f[0] / unit


@native(fast=True)
def eliminate(
    n: i64, m: i64, entries: i64, jac: f64s, primal: f64s, dual: f64s, inverse: f64s, own_jac: f64s, own_primal: f64s,
    own_dual: f64s,
) -> None:  # fmt: skip
    """Hand on a matrix without p and q, whose diagonal is inverted, (2 * m,)."""
    for k in range(entries):
        own_jac[k] = jac[k]
    for k in range(n):
        own_primal[k] = primal[k]
    of_p = jac[entries:]
    of_q = jac[entries + m :]
    for k in range(m):
        inverse[k] = 1.0 / primal[n + k]
        inverse[m + k] = 1.0 / primal[n + m + k]
        own_dual[k] = dual[k] + of_p[k] * of_p[k] * inverse[k] + of_q[k] * of_q[k] * inverse[m + k]


@native(shared=True)
def attempt(calls: i64s, m: i64, own_inertia: i64s, inertia: i64s) -> i64:
    """Factorise where all goes as it did before; what the problem's own system says of it."""
    invoke(calls, ELIMINATE)
    ended = invoke(calls, ATTEMPT)
    if ended == 0:
        inertia[0] = own_inertia[0] + 2 * m
        inertia[1] = own_inertia[1]
        inertia[2] = own_inertia[2]
    return ended


@native(fast=True)
def hand_on(n: i64, m: i64, entries: i64, jac: f64s, inverse: f64s, rhs: f64s, own_rhs: f64s) -> None:
    """The right-hand side without p and q."""
    of_p = jac[entries:]
    of_q = jac[entries + m :]
    for k in range(n):
        own_rhs[k] = rhs[k]
    for k in range(m):
        pulls = of_p[k] * inverse[k] * rhs[n + k] + of_q[k] * inverse[m + k] * rhs[n + m + k]
        own_rhs[n + k] = rhs[n + 2 * m + k] - pulls


@native(fast=True)
def complete(
    n: i64, m: i64, entries: i64, jac: f64s, inverse: f64s, rhs: f64s, own_solution: f64s, solution: f64s
) -> None:
    """The solution with p and q."""
    of_p = jac[entries:]
    of_q = jac[entries + m :]
    for k in range(n):
        solution[k] = own_solution[k]
    for k in range(m):
        dy = own_solution[n + k]
        solution[n + k] = inverse[k] * (rhs[n + k] - of_p[k] * dy)
        solution[n + m + k] = inverse[m + k] * (rhs[n + m + k] - of_q[k] * dy)
        solution[n + 2 * m + k] = dy
