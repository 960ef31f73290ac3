"""Cones of contact forces, as expressions that are nonnegative inside."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from stc.symbolic.expr import Expr, mul, num, sub


def sole_cone(
    along: Sequence[Expr],
    up: Expr,
    turning: tuple[Expr, Expr, Expr],
    half: tuple[Expr, Expr],
    friction: Expr,
) -> Iterator[tuple[Expr, str]]:
    """Expressions that are nonnegative for a wrench that a rectangular sole can transmit (Caron, Pham and Nakamura
    2015).

    Args:
        along: tangential forces along the sole's axes.
        up: normal force.
        turning: moments about the sole's two axes and its normal, about its middle.
        half: half lengths of the sole.
        friction: coefficient; friction is a pyramid along the sole's axes.
    """
    tip, tilt, turn = turning
    x, y = half
    for part in along:
        for sign in (1.0, -1.0):
            yield sub(mul(friction, up), mul(num(sign), part)), "does not slip"
    for moment, reach in ((tip, y), (tilt, x)):
        for sign in (1.0, -1.0):
            yield sub(mul(reach, up), mul(num(sign), moment)), "has its pressure inside the sole"
    most = mul(mul(friction, x + y), up)
    for sign in (1.0, -1.0):
        # sign * turn <= most - abs(y fx + sign friction tip) - abs(x fy + sign friction tilt)
        s = num(sign)
        first = mul(y, along[0]) + mul(mul(s, friction), tip)
        second = mul(x, along[1]) + mul(mul(s, friction), tilt)
        for p in (1.0, -1.0):
            for q in (1.0, -1.0):
                yield sub(sub(most, mul(s, turn)), num(p) * first + num(q) * second), "does not turn"
