"""Time derivatives and one-sided values of expressions whose symbols are the references of a problem."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from stc.problem import DefinitionRef, Rotation, TimeRef, VariableRef
from stc.symbolic.differentiate import total_derivative
from stc.symbolic.expr import ONE, ZERO, Expr, substitute, sym, symbols


def rate(key: object) -> Expr:
    """The time derivative of a symbol, as the language defines primes.

    A variable, at whatever frame, gives its next derivative there; ``t`` gives 1, constants and parameters 0.
    The index of the frame has none; elaboration refuses its prime, so it counts as 0 here.
    """
    if isinstance(key, VariableRef | DefinitionRef):
        return sym(replace(key, order=key.order + 1))
    return ONE if isinstance(key, TimeRef) else ZERO


def rate_with(rotations: Iterable[Rotation]) -> Callable[[object], Expr]:
    """As :func:`rate`, where some variables are components of unit quaternions: their rate is q (0, w) / 2."""
    turning = {name: (rotation, k) for rotation in rotations for k, name in enumerate(rotation.quaternion)}
    if not turning:
        return rate

    def rate_of(key: object) -> Expr:
        if isinstance(key, VariableRef) and key.name in turning and key.order == 0:
            rotation, component = turning[key.name]
            q = [sym(replace(key, name=name)) for name in rotation.quaternion]
            w = [sym(replace(key, name=name)) for name in rotation.velocity]
            return 0.5 * quaternion_product(q, [ZERO, *w])[component]
        return rate(key)

    return rate_of


def quaternion_product(a: Sequence[Expr], b: Sequence[Expr]) -> list[Expr]:
    """The product a b of two quaternions (w, x, y, z)."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]


def time_derivative(e: Expr, order: int, rotations: Iterable[Rotation] = ()) -> Expr:
    """The total time derivative of the given order, by the chain rule.

    Args:
        rotations: the orientations of the problem that ``e`` belongs to.
    """
    of_symbol = rate_with(rotations)
    for _ in range(order):
        e = total_derivative(e, of_symbol)
    return e


def one_sided(e: Expr, side: str) -> Expr:
    """``before(e)`` or ``after(e)``: every variable and ranged definition in it read on that side."""
    keys = [k for k in symbols(e) if isinstance(k, VariableRef | DefinitionRef) and k.side != side]
    return substitute(e, {k: sym(replace(k, side=side)) for k in keys}) if keys else e
