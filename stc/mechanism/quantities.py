"""Sums over the bodies of a mechanism: centre of mass, momenta, energies.

They are summed from the outermost segments inwards, each in its own axes, like the forces.
"""

from __future__ import annotations

from collections.abc import Mapping

from stc.mechanism.kinematics import Kinematics
from stc.mechanism.tree import NOTHING, WORLD, Inertia, Tree, total
from stc.mechanism.vectors import ORIGIN, Matrix, Vector, cross, dot, minus, plus, scaled, times
from stc.records import dataclass
from stc.symbolic.expr import ONE, ZERO, Expr, add, div, mul, neg, num

Loads = Mapping[int, Inertia]
"""Inertias by segment, in the segment's frame."""


@dataclass(frozen=True, slots=True)
class Sums:
    """Sums over the bodies below a frame, in this frame, with velocities relative to its base.

    Attributes:
        mass: the total mass.
        first: the sum of mass times position.
        momentum: the sum of mass times velocity.
        angular: the sum of mass times position cross velocity.
    """

    mass: Expr = ZERO
    first: Vector = ORIGIN
    momentum: Vector = ORIGIN
    angular: Vector = ORIGIN

    def plus(self, other: Sums) -> Sums:
        """The quantities of two sets of bodies together: their sums."""
        return Sums(
            mass=add(self.mass, other.mass),
            first=plus(self.first, other.first),
            momentum=plus(self.momentum, other.momentum),
            angular=plus(self.angular, other.angular),
        )

    def moved(self, turn: Matrix, at: Vector, velocity: Vector = ORIGIN) -> Sums:
        """The sums in another frame, from this frame's axes, origin and base velocity there."""
        first, momentum = times(turn, self.first), times(turn, self.momentum)
        angular = plus(times(turn, self.angular), cross(at, momentum))
        first = plus(first, scaled(self.mass, at))
        angular = plus(angular, cross(first, velocity))
        return Sums(self.mass, first, plus(momentum, scaled(self.mass, velocity)), angular)


def loads(tree: Tree, body: int) -> dict[int, Inertia]:
    """The inertias of a body and all its descendants, summed within each segment; for the world, of everything."""
    found: dict[int, Inertia] = {}
    if body == 0:
        found.update({index: segment.effective for index, segment in enumerate(tree.segments)})
        found[WORLD] = tree.ground
    else:
        wanted = set(tree.mechanism.below(body))
        for index, segment in enumerate(tree.segments):
            own = [part for each, part in segment.parts.items() if each in wanted]
            found[index] = segment.inertia if len(own) == len(segment.parts) else total(own)
        found[WORLD] = total([part for each, part in tree.fixed.items() if each in wanted])
    return {segment: inertia for segment, inertia in found.items() if inertia != NOTHING}


def total_mass(parts: Loads) -> Expr:
    """The sum of the masses of some bodies, in kg."""
    return total(parts.values()).mass


def _in_world(kinematics: Kinematics, parts: Loads) -> Sums:
    """Mass, first moment and momenta of some bodies, in the axes of the world."""
    whole = Sums()
    for root, sums in _by_roots(kinematics, parts).items():
        turn, at = kinematics.locals[root]
        whole = whole.plus(sums.moved(turn, at, kinematics.base_velocity(root)))
    fixed = parts.get(WORLD, NOTHING)
    return whole.plus(Sums(fixed.mass, fixed.first))


def _by_roots(kinematics: Kinematics, parts: Loads) -> dict[int, Sums]:
    """The same, in the frames of the segments that are attached to the world."""
    segments = kinematics.tree.segments
    found: dict[int, Sums] = {}
    for index in reversed(range(len(segments))):
        if index in parts:
            own = _own(kinematics, index, parts[index])
            found[index] = found[index].plus(own) if index in found else own
        parent = segments[index].parent
        if index in found and parent != WORLD:
            carried = found.pop(index).moved(*kinematics.locals[index])
            found[parent] = found[parent].plus(carried) if parent in found else carried
    return found


def _own(kinematics: Kinematics, index: int, inertia: Inertia) -> Sums:
    """The sums of one segment alone, in its frame."""
    w, v = kinematics.rate(index), kinematics.velocity(index)
    momentum = plus(scaled(inertia.mass, v), cross(w, inertia.first))
    angular = plus(_turned(inertia.second, w), cross(inertia.first, v))
    return Sums(inertia.mass, inertia.first, momentum, angular)


def _turned(second: Matrix, w: Vector) -> Vector:
    """The moments of inertia that belong to second moments of mass, times an angular velocity."""
    trace = add(add(second[0][0], second[1][1]), second[2][2])
    return minus(scaled(trace, w), times(second, w))


def centre_of_mass(kinematics: Kinematics, parts: Loads) -> Vector:
    """The centre of mass, in the world.

    Raises:
        ValueError: nothing has mass.
    """
    return _over_mass(_in_world(kinematics, parts).first, total_mass(parts))


def centre_velocity(kinematics: Kinematics, parts: Loads) -> Vector:
    """The velocity of the centre of mass, in the world.

    Raises:
        ValueError: nothing has mass.
    """
    return _over_mass(momentum(kinematics, parts), total_mass(parts))


def _over_mass(v: Vector, mass: Expr) -> Vector:
    if mass is ZERO:
        raise ValueError("bodies without mass have no centre of mass")
    return scaled(div(ONE, mass), v)


def momentum(kinematics: Kinematics, parts: Loads) -> Vector:
    """Linear momentum, in the world."""
    return _in_world(kinematics, parts).momentum


def angular_momentum(kinematics: Kinematics, parts: Loads) -> Vector:
    """Angular momentum about the centre of mass, along the world's axes."""
    roots = _by_roots(kinematics, parts)
    if (
        len(roots) == 1 and WORLD not in parts
    ):  # where the root is, and how fast its origin moves, does not matter
        ((root, sums),) = roots.items()
        return times(kinematics.locals[root][0], _about_centre(sums))
    return _about_centre(_in_world(kinematics, parts))


def _about_centre(sums: Sums) -> Vector:
    return minus(sums.angular, cross(_over_mass(sums.first, sums.mass), sums.momentum))


def kinetic_energy(kinematics: Kinematics, parts: Loads) -> Expr:
    """Kinetic energy of the bodies; that of armatures is not in it."""
    doubled: Expr = ZERO
    for index, inertia in parts.items():
        if index != WORLD:
            sums, v = _own(kinematics, index, inertia), kinematics.velocity(index)
            doubled = add(doubled, add(dot(v, sums.momentum), dot(kinematics.rate(index), sums.angular)))
    for root, sums in _by_roots(kinematics, parts).items():
        v = kinematics.base_velocity(root)
        carried = times(kinematics.locals[root][0], sums.momentum)
        doubled = add(doubled, add(mul(num(2.0), dot(v, carried)), mul(sums.mass, dot(v, v))))
    return mul(num(0.5), doubled)


def weight_energy(kinematics: Kinematics, parts: Loads) -> Expr:
    """Potential energy of the bodies' weight; 0 at the world's origin."""
    return neg(dot(kinematics.gravity, _in_world(kinematics, parts).first))
