"""What a pose says of a frame: values of coordinates, and the rows that hold a body there."""

from __future__ import annotations

from collections.abc import Sequence

from stc.rates import quaternion_product
from stc.records import dataclass
from stc.symbolic.expr import Expr, neg

#: Values of coordinates by the names of their variables, angular velocities left out.
Values = dict[str, Expr]


@dataclass(frozen=True, slots=True)
class Stated:
    """One row that a pose stands for: of which degree of freedom, and what is 0.

    Attributes:
        dof: the degree of freedom that the row fixes, by its address.
        velocity: whether it is one of velocities.
        body: what is 0.
        text: how it reads.
    """

    dof: int
    velocity: bool
    body: Expr
    text: str


def turn_between(reference: Sequence[Expr], q: Sequence[Expr]) -> list[Expr]:
    """The vector part of conj(reference) q: the sine of half the turn between them, along its axis. (3,)"""
    return quaternion_product([reference[0], *(neg(part) for part in reference[1:])], q)[1:]
