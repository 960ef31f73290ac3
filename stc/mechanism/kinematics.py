"""Positions, velocities and accelerations of the segments of a mechanism, as expressions of its motion.

Recursions carry vectors along a chain in each segment's own axes, which needs the fewest operations, since these differ
by one joint at a time.  Vectors are transformed to the world on request.  Velocities and accelerations of points are
relative to the origin of the free body that carries the segment, whose own are coordinates in the world; without a free
body they are relative to the world.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

from stc.mechanism.mechanism import Joint
from stc.mechanism.tree import WORLD, Frame, Segment, Tree
from stc.mechanism.vectors import (
    ORIGIN,
    Matrix,
    Vector,
    cross,
    minus,
    negative,
    plus,
    product,
    rotation_about,
    rotation_of,
    scaled,
    times,
    transposed,
    vector,
)
from stc.records import dataclass
from stc.symbolic.expr import Expr, add, call, mul, neg, num, sub


@dataclass(frozen=True, slots=True)
class Motion:
    """A state of motion: coordinates in the order of ``qpos``, velocities and accelerations in that of ``qvel``."""

    q: Sequence[Expr]
    v: Sequence[Expr]
    a: Sequence[Expr]


@dataclass(frozen=True, slots=True)
class Turning:
    """The rotation of a segment about its own axes: angular velocity, angular acceleration, and their acceleration
    field.

    Attributes:
        velocity, acceleration: angular velocity and angular acceleration.
        field: the matrix that maps a position in the segment to its acceleration relative to the origin.
    """

    velocity: Vector
    acceleration: Vector
    field: Matrix


STILL = Turning(ORIGIN, ORIGIN, (ORIGIN, ORIGIN, ORIGIN))


def _field(w: Vector, r: Vector) -> Matrix:
    """The matrix of r x + w (w x)."""
    xx, yy, zz = mul(w[0], w[0]), mul(w[1], w[1]), mul(w[2], w[2])
    xy, yz, zx = mul(w[0], w[1]), mul(w[1], w[2]), mul(w[2], w[0])
    return (
        (neg(add(yy, zz)), sub(xy, r[2]), add(zx, r[1])),
        (add(xy, r[2]), neg(add(xx, zz)), sub(yz, r[0])),
        (sub(zx, r[1]), add(yz, r[0]), neg(add(xx, yy))),
    )


class Kinematics:
    """Expressions of one motion of a tree, built on request.

    Parameters
    ----------
    tree
        What moves.
    motion
        How it moves.
    gravity
        In the world.
    """

    def __init__(self, tree: Tree, motion: Motion, gravity: Vector) -> None:
        self.tree = tree
        self.motion = motion
        self.gravity = gravity
        self._rates: dict[int, Vector] = {WORLD: ORIGIN}
        self._velocities: dict[int, Vector] = {WORLD: ORIGIN}
        self._turnings: dict[int, Turning] = {WORLD: STILL}
        self._accelerations: dict[int, Vector] = {WORLD: ORIGIN}
        self._felt: dict[int, Vector] = {WORLD: negative(gravity)}
        self._turned: dict[tuple[int, Vector], Vector] = {}

    @cached_property
    def locals(self) -> list[tuple[Matrix, Vector]]:
        """The axes of every segment in its parent's, as columns, and its origin there."""
        return [self._local(segment) for segment in self.tree.segments]

    def _local(self, segment: Segment) -> tuple[Matrix, Vector]:
        joint, q = segment.joint, self.motion.q
        first = joint.qpos
        if joint.kind == "free":
            return rotation_of(q[first + 3 : first + 7]), (q[first], q[first + 1], q[first + 2])
        if joint.kind == "ball":
            return product(segment.turn, rotation_of(q[first : first + 4])), segment.at
        way = sub(q[first], num(joint.reference[0]))
        if joint.kind == "slide":
            return segment.turn, plus(segment.at, scaled(way, times(segment.turn, vector(segment.axis))))
        turned = rotation_about(segment.axis, call("sin", way), call("cos", way))
        return product(segment.turn, turned), segment.at

    def _along(self, segment: int, known: Mapping[int, object]) -> list[int]:
        """The segments on the path to one whose quantity is not known yet, the innermost first."""
        missing = []
        while segment not in known:
            missing.append(segment)
            segment = self.tree.segments[segment].parent
        return missing[::-1]

    def common(self, first: int, second: int) -> int:
        """The outermost common ancestor of two segments (possibly one of them); :data:`WORLD` if there is none."""
        while first != second:
            if first > second:
                first = self.tree.segments[first].parent
            else:
                second = self.tree.segments[second].parent
        return first

    # --- turning -------------------------------------------------------------------------------------------------

    def rate(self, segment: int) -> Vector:
        """The angular velocity of a segment, in its own axes."""
        v, found = self.motion.v, self._rates
        for index in self._along(segment, found):
            each = self.tree.segments[index]
            d, kind = each.joint.dof, each.joint.kind
            if kind == "free":
                found[index] = v[d + 3], v[d + 4], v[d + 5]
                continue
            w = times(transposed(self.locals[index][0]), found[each.parent])
            if kind == "hinge":
                w = plus(w, scaled(v[d], vector(each.axis)))
            elif kind == "ball":
                w = plus(w, (v[d], v[d + 1], v[d + 2]))
            found[index] = w
        return found[segment]

    def turning(self, segment: int) -> Turning:
        """The rotation of a segment, in its own axes."""
        v, a, found = self.motion.v, self.motion.a, self._turnings
        for index in self._along(segment, found):
            each = self.tree.segments[index]
            d, kind, w = each.joint.dof, each.joint.kind, self.rate(index)
            if kind == "free":
                turned: Vector = (a[d + 3], a[d + 4], a[d + 5])
            else:
                back = transposed(self.locals[index][0])
                turned = times(back, found[each.parent].acceleration)
                own: Vector = ORIGIN
                if kind == "hinge":
                    own, turned = (
                        scaled(v[d], vector(each.axis)),
                        plus(turned, scaled(a[d], vector(each.axis))),
                    )
                elif kind == "ball":
                    own, turned = (v[d], v[d + 1], v[d + 2]), plus(turned, (a[d], a[d + 1], a[d + 2]))
                turned = plus(turned, cross(times(back, found[each.parent].velocity), own))
            found[index] = Turning(w, turned, _field(w, turned))
        return found[segment]

    # --- places --------------------------------------------------------------------------------------------------

    def velocity(self, segment: int) -> Vector:
        """The velocity of a segment's origin relative to its base, in its own axes."""
        found = self._velocities
        for index in self._along(segment, found):
            each = self.tree.segments[index]
            turn, at = self.locals[index]
            if each.joint.kind == "free":
                found[index] = ORIGIN
                continue
            moved = times(transposed(turn), plus(found[each.parent], cross(self.rate(each.parent), at)))
            if each.joint.kind == "slide":
                moved = plus(moved, scaled(self.motion.v[each.joint.dof], vector(each.axis)))
            found[index] = moved
        return found[segment]

    def acceleration(self, segment: int) -> Vector:
        """The acceleration of a segment's origin relative to its base, in its own axes."""
        for index in self._along(segment, self._accelerations):
            free = self.tree.segments[index].joint.kind == "free"
            self._accelerations[index] = ORIGIN if free else self._accelerated(index, self._accelerations)
        return self._accelerations[segment]

    def felt(self, segment: int) -> Vector:
        """The acceleration of a segment's origin minus the gravity acceleration, in its own axes."""
        a = self.motion.a
        for index in self._along(segment, self._felt):
            joint = self.tree.segments[index].joint
            d = joint.dof
            if joint.kind == "free":
                above = minus((a[d], a[d + 1], a[d + 2]), self.gravity)
                self._felt[index] = times(transposed(self.locals[index][0]), above)
            else:
                self._felt[index] = self._accelerated(index, self._felt)
        return self._felt[segment]

    def _accelerated(self, index: int, known: Mapping[int, Vector]) -> Vector:
        """The acceleration of a segment's origin from that of its parent's."""
        segment = self.tree.segments[index]
        turn, at = self.locals[index]
        back, parent, d = transposed(turn), segment.parent, segment.joint.dof
        moved = times(back, plus(known[parent], times(self.turning(parent).field, at)))
        if segment.joint.kind == "slide":
            axis = vector(segment.axis)
            across = cross(times(back, self.rate(parent)), axis)
            moved = plus(moved, scaled(self.motion.a[d], axis))
            moved = plus(moved, scaled(mul(num(2.0), self.motion.v[d]), across))
        return moved

    # --- in the world --------------------------------------------------------------------------------------------

    def base(self, segment: int) -> Joint | None:
        """The free joint that carries a segment."""
        while segment != WORLD:
            joint = self.tree.segments[segment].joint
            if joint.kind == "free":
                return joint
            segment = self.tree.segments[segment].parent
        return None

    def base_velocity(self, segment: int) -> Vector:
        """The velocity of the origin of the free body that carries a segment, in the world."""
        return self._of_base(segment, self.motion.v)

    def base_acceleration(self, segment: int) -> Vector:
        """The acceleration of the origin of the free body that carries a segment, in the world."""
        return self._of_base(segment, self.motion.a)

    def _of_base(self, segment: int, rates: Sequence[Expr]) -> Vector:
        joint = self.base(segment)
        return ORIGIN if joint is None else (rates[joint.dof], rates[joint.dof + 1], rates[joint.dof + 2])

    def to_world(self, segment: int, v: Vector) -> Vector:
        """A vector in a segment's axes, along the world's."""
        while segment != WORLD:
            v = times(self.locals[segment][0], v)
            segment = self.tree.segments[segment].parent
        return v

    def to_segment(self, segment: int, v: Vector) -> Vector:
        """A vector along the world's axes, in a segment's."""
        way = []
        while segment != WORLD and (segment, v) not in self._turned:
            way.append(segment)
            segment = self.tree.segments[segment].parent
        found = v if segment == WORLD else self._turned[segment, v]
        for index in reversed(way):
            found = times(transposed(self.locals[index][0]), found)
            self._turned[index, v] = found
        return found

    # --- frames --------------------------------------------------------------------------------------------------

    def place_of(self, frame: Frame) -> Vector:
        """The origin of a frame in the world."""
        segment, at = frame.segment, frame.at
        while segment != WORLD:
            turn, origin = self.locals[segment]
            at = plus(origin, times(turn, at))
            segment = self.tree.segments[segment].parent
        return at

    def axes_of(self, frame: Frame) -> Matrix:
        """The axes of a frame in the world, as columns."""
        x, y, z = [self.to_world(frame.segment, axis) for axis in transposed(frame.turn)]
        return transposed((x, y, z))

    def velocity_of(self, frame: Frame) -> Vector:
        """The velocity of a frame's origin, in the world."""
        moved = plus(self.velocity(frame.segment), cross(self.rate(frame.segment), frame.at))
        return plus(self.base_velocity(frame.segment), self.to_world(frame.segment, moved))

    def rate_of(self, frame: Frame) -> Vector:
        """The angular velocity of a frame, in the world."""
        return self.to_world(frame.segment, self.rate(frame.segment))

    def acceleration_of(self, frame: Frame) -> Vector:
        """The acceleration of a frame's origin, in the world."""
        field = self.turning(frame.segment).field
        moved = plus(self.acceleration(frame.segment), times(field, frame.at))
        return plus(self.base_acceleration(frame.segment), self.to_world(frame.segment, moved))

    def turning_of(self, frame: Frame) -> Vector:
        """The angular acceleration of a frame, in the world."""
        return self.to_world(frame.segment, self.turning(frame.segment).acceleration)
