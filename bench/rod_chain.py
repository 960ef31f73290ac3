"""A realistic dynamics function: a planar chain of rods, each joint driven by a torque.

Joint angles are relative, so that every equation depends on every joint.  On three frames in a row, with central
differences for velocity and acceleration, the residual of the Euler-Lagrange equations is

    d/dt dL/dq' - dL/dq - u = 0        q' = (q+ - q-) / 2h        q'' = (q+ - 2q + q-) / h^2

The same statement is written for this project's expressions and for CasADi's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from stc.symbolic import expr
from stc.symbolic.differentiate import derivative, hessian, jacobian, total_derivative
from stc.symbolic.expr import Expr


def lagrangian(
    n: int, q: Sequence[Any], v: Sequence[Any], m: Any, l: Any, inertia: Any, g: Any, sin: Any, cos: Any
) -> Any:
    """Kinetic less potential energy of ``n`` rods hanging from a pivot."""
    x_rate = z_rate = height = angle = rate = 0.0
    energy: Any = 0.0
    for i in range(n):
        angle, rate = angle + q[i], rate + v[i]
        s, c = sin(angle), cos(angle)
        half_x, half_z = x_rate + 0.5 * l[i] * c * rate, z_rate + 0.5 * l[i] * s * rate
        energy += 0.5 * m[i] * (half_x * half_x + half_z * half_z) + 0.5 * inertia[i] * rate * rate
        energy -= m[i] * g * (height - 0.5 * l[i] * c)
        x_rate, z_rate = x_rate + l[i] * c * rate, z_rate + l[i] * s * rate
        height = height - l[i] * c
    return energy


@dataclass(frozen=True)
class Stencil:
    """Residual and derivatives on one stencil.

    ``unknowns`` are q-, q, q+ and u (n each); ``constants`` masses, lengths, inertias, g, h; ``multipliers`` one
    per equation.  Jacobian and Hessian (lower triangle, of multipliers times residual) hold nonzeros only.
    """

    unknowns: list[Any]
    constants: list[Any]
    multipliers: list[Any]
    residual: list[Expr]
    jacobian: dict[tuple[int, int], Expr]
    hessian: dict[tuple[int, int], Expr]


def stencil(n: int) -> Stencil:
    """The chain in this project's expressions."""
    q, v, a, before, after, torque, y = (
        [(name, i) for i in range(n)] for name in ("q", "v", "a", "q-", "q+", "u", "y")
    )
    m, l, inertia = ([expr.sym((name, i)) for i in range(n)] for name in ("m", "l", "I"))
    g, h = expr.sym("g"), expr.sym("h")
    symbol: Callable[[Any], Expr] = expr.sym
    energy = lagrangian(
        n,
        [symbol(k) for k in q],
        [symbol(k) for k in v],
        m,
        l,
        inertia,
        g,
        lambda e: expr.call("sin", e),
        lambda e: expr.call("cos", e),
    )
    rates = {k: symbol(d) for k, d in zip((*q, *v), (*v, *a))}
    equations = [
        total_derivative(derivative(energy, v[i]), lambda k: rates.get(k, expr.num(0.0)))
        - derivative(energy, q[i])
        - symbol(torque[i])
        for i in range(n)
    ]
    differences = {v[i]: (symbol(after[i]) - symbol(before[i])) / (2.0 * h) for i in range(n)}
    for i in range(n):
        differences[a[i]] = (symbol(after[i]) - 2.0 * symbol(q[i]) + symbol(before[i])) / (h * h)
    memo: dict[Expr, Expr] = {}
    residual = [expr.substitute(e, differences, memo) for e in equations]
    unknowns = [*before, *q, *after, *torque]
    weighted = expr.sum_of([symbol(k) * e for k, e in zip(y, residual)])
    return Stencil(
        unknowns,
        [*(e.payload for e in (*m, *l, *inertia)), "g", "h"],
        y,
        residual,
        jacobian(residual, unknowns),
        hessian(weighted, unknowns),
    )


def casadi_function(n: int, casadi: Any) -> Any:
    """The chain in CasADi: (unknowns, constants) -> (residual, Jacobian nonzeros by column)."""
    unknowns, constants = casadi.SX.sym("x", 4 * n), casadi.SX.sym("c", 3 * n + 2)
    before, q, after, torque = (unknowns[k * n : (k + 1) * n] for k in range(4))
    m, l, inertia = (constants[k * n : (k + 1) * n] for k in range(3))
    g, h = constants[3 * n], constants[3 * n + 1]
    angle, rate, acceleration = (casadi.SX.sym(name, n) for name in ("q", "v", "a"))
    energy = lagrangian(n, _parts(angle), _parts(rate), m, l, inertia, g, casadi.sin, casadi.cos)
    momentum = casadi.gradient(energy, rate)
    equations = (
        casadi.jtimes(momentum, angle, rate)
        + casadi.jtimes(momentum, rate, acceleration)
        - casadi.gradient(energy, angle)
    )
    residual = casadi.substitute(
        equations,
        casadi.vertcat(angle, rate, acceleration),
        casadi.vertcat(q, (after - before) / (2.0 * h), (after - 2.0 * q + before) / (h * h)),
    )
    residual = residual - torque
    outputs = [residual, casadi.jacobian(residual, unknowns)]
    return casadi.Function("stencil", [unknowns, constants], outputs, {"cse": True})


def _parts(vector: Any) -> list[Any]:
    return [vector[i] for i in range(vector.shape[0])]
