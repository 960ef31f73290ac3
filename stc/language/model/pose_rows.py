"""The constraints of a pose at a frame."""

from __future__ import annotations

from collections.abc import Sequence

from stc.records import dataclass
from stc.symbolic.expr import Expr, neg
from stc.time_derivatives import quaternion_product

#: Values of coordinates by the names of their variables, angular velocities left out.
Values = dict[str, Expr]


@dataclass(frozen=True, slots=True)
class Stated:
    """One constraint of a pose: its degree of freedom, and the expression that is 0.

    Attributes:
        dof: the address of the degree of freedom that it fixes.
        velocity: whether it fixes a velocity.
        body: the expression that is 0.
        text: its text in messages.
    """

    dof: int
    velocity: bool
    body: Expr
    text: str


def turn_between(reference: Sequence[Expr], q: Sequence[Expr]) -> list[Expr]:
    """The vector part of conj(reference) q: the sine of half the turn between them, along its axis. (3,)"""
    return quaternion_product([reference[0], *(neg(part) for part in reference[1:])], q)[1:]
