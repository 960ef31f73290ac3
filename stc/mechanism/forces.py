"""Forces on bodies and on degrees of freedom, and the lengths that forces act along."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from stc.mechanism.tree import Frame
from stc.mechanism.vectors import ORIGIN, Vector, scaled
from stc.records import dataclass, field
from stc.symbolic.expr import ZERO, Expr, add, mul


@dataclass(frozen=True, slots=True)
class Wrench:
    """A force at the origin of a frame, and a torque; both along the world's axes, or those of the frame's segment."""

    frame: Frame
    force: Vector = ORIGIN
    torque: Vector = ORIGIN
    in_segment: bool = False

    def times(self, factor: Expr) -> Wrench:
        """The wrench multiplied by a factor."""
        return replace(self, force=scaled(factor, self.force), torque=scaled(factor, self.torque))


@dataclass(frozen=True, slots=True)
class Transmission:
    """A length, and the effect of a force along it on bodies and degrees of freedom.

    It acts on degrees of freedom directly and on bodies as wrenches.

    Attributes:
        length, rate: m or rad, and per second; the rate is the power of a unit of force.
        moments: by degree of freedom, per unit of force.
        pulls: on bodies, per unit of force.
        period: the period of the length if it is an angle of a rotation in three dimensions; otherwise 0.
    """

    length: Expr
    rate: Expr
    moments: Mapping[int, Expr]
    pulls: tuple[Wrench, ...] = ()
    period: float = 0.0

    def geared(self, gear: Expr) -> Transmission:
        """The same transmission with a gear."""
        return Transmission(
            length=mul(gear, self.length),
            rate=mul(gear, self.rate),
            moments={dof: mul(gear, moment) for dof, moment in self.moments.items()},
            pulls=tuple([pull.times(gear) for pull in self.pulls]),
        )


@dataclass(slots=True)
class Forces:
    """Forces on degrees of freedom, and wrenches on bodies, that act together."""

    on_dofs: dict[int, Expr] = field(default_factory=dict)
    wrenches: list[Wrench] = field(default_factory=list)

    def push(self, dof: int, force: Expr) -> None:
        """Add a force on a degree of freedom."""
        self.on_dofs[dof] = add(self.on_dofs.get(dof, ZERO), force)

    def along(self, line: Transmission, force: Expr) -> None:
        """Add a force along a length."""
        for dof, moment in line.moments.items():
            self.push(dof, mul(moment, force))
        self.wrenches.extend([pull.times(force) for pull in line.pulls])

    def include(self, other: Forces) -> None:
        """Add the forces of another collection to these."""
        for dof, force in other.on_dofs.items():
            self.push(dof, force)
        self.wrenches.extend(other.wrenches)


def together(forces: Iterable[Forces]) -> Forces:
    """The sum of forces."""
    total = Forces()
    for each in forces:
        total.include(each)
    return total
