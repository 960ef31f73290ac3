"""Sums over the bodies of a mechanism: centre of mass, momenta, energies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from stc.mechanism.kinematics import Kinematics
from stc.mechanism.tree import WORLD, Inertia, Tree
from stc.mechanism.vectors import ORIGIN, Matrix, Vector, cross, dot, minus, plus, scaled, times
from stc.symbolic.expr import ONE, ZERO, Expr, add, div, mul, num, sub

Loads = Mapping[int, Inertia]
"""Inertias by segment, in the segment's frame."""


def loads(tree: Tree, bodies: Iterable[int]) -> dict[int, Inertia]:
    """The inertias of some bodies, those of one segment added up."""
    wanted = set(bodies)
    found: dict[int, Inertia] = {}
    for index, segment in enumerate(tree.segments):
        own = [part for body, part in segment.parts.items() if body in wanted]
        if len(own) == len(segment.parts):
            found[index] = segment.inertia
        else:
            found[index] = _together(own)
    found[WORLD] = _together([part for body, part in tree.fixed.items() if body in wanted])
    return {segment: inertia for segment, inertia in found.items() if inertia.mass is not ZERO}


def _together(parts: Iterable[Inertia]) -> Inertia:
    mass, first, second = ZERO, ORIGIN, (ORIGIN, ORIGIN, ORIGIN)
    for part in parts:
        mass, first = add(mass, part.mass), plus(first, part.first)
        x, y, z = [plus(a, b) for a, b in zip(second, part.second, strict=True)]
        second = (x, y, z)
    return Inertia(mass, first, second)


def total_mass(parts: Loads) -> Expr:
    """The mass."""
    total: Expr = ZERO
    for inertia in parts.values():
        total = add(total, inertia.mass)
    return total


def first_moment(kinematics: Kinematics, parts: Loads) -> Vector:
    """The sum of mass times place, in the world."""
    total = ORIGIN
    for segment, inertia in parts.items():
        reach = times(kinematics.axes(segment), inertia.first)
        total = plus(total, plus(scaled(inertia.mass, kinematics.origin(segment)), reach))
    return total


def momentum(kinematics: Kinematics, parts: Loads) -> Vector:
    """Linear momentum, in the world."""
    total = ORIGIN
    for segment, inertia in parts.items():
        total = plus(total, _momentum(kinematics, segment, inertia))
    return total


def _momentum(kinematics: Kinematics, segment: int, inertia: Inertia) -> Vector:
    turned = times(kinematics.axes(segment), cross(kinematics.rate(segment), inertia.first))
    return plus(scaled(inertia.mass, kinematics.velocity(segment)), turned)


def centre_of_mass(kinematics: Kinematics, parts: Loads) -> Vector:
    """The centre of mass, in the world.

    Raises:
        ValueError: nothing has mass.
    """
    return _over_mass(first_moment(kinematics, parts), parts)


def centre_velocity(kinematics: Kinematics, parts: Loads) -> Vector:
    """The velocity of the centre of mass, in the world.

    Raises:
        ValueError: nothing has mass.
    """
    return _over_mass(momentum(kinematics, parts), parts)


def _over_mass(v: Vector, parts: Loads) -> Vector:
    mass = total_mass(parts)
    if mass is ZERO:
        raise ValueError("the centre of mass of what has no mass")
    return scaled(div(ONE, mass), v)


def angular_momentum(kinematics: Kinematics, parts: Loads) -> Vector:
    """Angular momentum about the centre of mass, along the world's axes."""
    total = ORIGIN
    for segment, inertia in parts.items():
        axes, w = kinematics.axes(segment), kinematics.rate(segment)
        reach = times(axes, inertia.first)
        own = times(axes, _turned(inertia.second, w))
        carried = cross(kinematics.origin(segment), _momentum(kinematics, segment, inertia))
        total = plus(total, plus(plus(own, cross(reach, kinematics.velocity(segment))), carried))
    centre = centre_of_mass(kinematics, parts)
    return minus(total, cross(centre, momentum(kinematics, parts)))


def _turned(second: Matrix, w: Vector) -> Vector:
    """The moments of inertia that belong to second moments of mass, times an angular velocity."""
    trace = add(add(second[0][0], second[1][1]), second[2][2])
    return minus(scaled(trace, w), times(second, w))


def kinetic_energy(kinematics: Kinematics, parts: Loads) -> Expr:
    """Kinetic energy of the bodies; that of armatures is not in it."""
    doubled: Expr = ZERO
    for segment, inertia in parts.items():
        if segment == WORLD:
            continue
        axes, w, v = kinematics.axes(segment), kinematics.rate(segment), kinematics.velocity(segment)
        turned = times(axes, cross(w, inertia.first))
        doubled = add(doubled, mul(inertia.mass, dot(v, v)))
        doubled = add(doubled, mul(num(2.0), dot(v, turned)))
        doubled = add(doubled, dot(w, _turned(inertia.second, w)))
    return mul(num(0.5), doubled)


def weight_energy(kinematics: Kinematics, parts: Loads) -> Expr:
    """Potential energy of the bodies' weight; 0 at the world's origin."""
    return sub(ZERO, dot(kinematics.gravity, first_moment(kinematics, parts)))
