"""Where the segments of a mechanism are, how they move and accelerate, as expressions of its motion.

Angular velocities, angular accelerations and accelerations are in each segment's own axes, where recursions along a
chain take the fewest operations; places, linear velocities and whole rotations are the world's.  Accelerations include
that of a world that falls upwards, so that weight needs no terms of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from stc.mechanism.tree import WORLD, Frame, Segment, Tree
from stc.mechanism.vectors import (
    IDENTITY,
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
    """How a segment turns, in its own axes.

    Attributes:
        velocity, acceleration: of the angle.
        field: the matrix that takes a place in the segment to its acceleration relative to the origin.
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
    """Expressions of one motion of a tree, made when they are asked for."""

    def __init__(self, tree: Tree, motion: Motion, gravity: Vector) -> None:
        self.tree = tree
        self.motion = motion
        self.gravity = gravity

    @cached_property
    def locals(self) -> list[tuple[Matrix, Vector]]:
        """Of every segment its axes in its parent's, as columns, and its origin there."""
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

    @cached_property
    def _poses(self) -> list[tuple[Matrix, Vector]]:
        found: list[tuple[Matrix, Vector]] = []
        for segment, (turn, at) in zip(self.tree.segments, self.locals, strict=True):
            if segment.parent != WORLD:
                axes, origin = found[segment.parent]
                turn, at = product(axes, turn), plus(origin, times(axes, at))
            found.append((turn, at))
        return found

    def axes(self, segment: int) -> Matrix:
        """The axes of a segment in the world, as columns."""
        return IDENTITY if segment == WORLD else self._poses[segment][0]

    def origin(self, segment: int) -> Vector:
        """The origin of a segment in the world."""
        return ORIGIN if segment == WORLD else self._poses[segment][1]

    @cached_property
    def _rates(self) -> list[Vector]:
        """Of every segment its angular velocity, in its own axes."""
        v, found = self.motion.v, list[Vector]()
        for segment, (turn, _) in zip(self.tree.segments, self.locals, strict=True):
            d, kind = segment.joint.dof, segment.joint.kind
            if kind == "free":
                found.append((v[d + 3], v[d + 4], v[d + 5]))
                continue
            w = ORIGIN if segment.parent == WORLD else times(transposed(turn), found[segment.parent])
            if kind == "hinge":
                w = plus(w, scaled(v[d], vector(segment.axis)))
            elif kind == "ball":
                w = plus(w, (v[d], v[d + 1], v[d + 2]))
            found.append(w)
        return found

    def rate(self, segment: int) -> Vector:
        """The angular velocity of a segment, in its own axes."""
        return ORIGIN if segment == WORLD else self._rates[segment]

    @cached_property
    def _velocities(self) -> list[Vector]:
        """Of every segment the velocity of its origin, in the world."""
        v, found = self.motion.v, list[Vector]()
        for segment, (_, at) in zip(self.tree.segments, self.locals, strict=True):
            d, kind, parent = segment.joint.dof, segment.joint.kind, segment.parent
            if kind == "free":
                found.append((v[d], v[d + 1], v[d + 2]))
                continue
            moved = cross(self.rate(parent), at)
            if kind == "slide":
                moved = plus(moved, scaled(v[d], times(segment.turn, vector(segment.axis))))
            moved = times(self.axes(parent), moved)
            found.append(moved if parent == WORLD else plus(found[parent], moved))
        return found

    def velocity(self, segment: int) -> Vector:
        """The velocity of a segment's origin, in the world."""
        return ORIGIN if segment == WORLD else self._velocities[segment]

    @cached_property
    def _accelerations(self) -> list[tuple[Turning, Vector]]:
        """Of every segment how it turns, and the acceleration of its origin less gravity's, in its own axes."""
        v, a, found = self.motion.v, self.motion.a, list[tuple[Turning, Vector]]()
        for index, segment in enumerate(self.tree.segments):
            turn, at = self.locals[index]
            back = transposed(turn)
            d, kind, w = segment.joint.dof, segment.joint.kind, self.rate(index)
            if kind == "free":
                turned: Vector = (a[d + 3], a[d + 4], a[d + 5])
                moved = times(back, minus((a[d], a[d + 1], a[d + 2]), self.gravity))
                found.append((Turning(w, turned, _field(w, turned)), moved))
                continue
            outer = segment.parent
            turning, moved = (STILL, negative(self.gravity)) if outer == WORLD else found[outer]
            carried = times(back, self.rate(segment.parent))
            moved = times(back, plus(moved, times(turning.field, at)))
            turned = times(back, turning.acceleration)
            if kind == "ball":
                own: Vector = (v[d], v[d + 1], v[d + 2])
                turned = plus(turned, plus((a[d], a[d + 1], a[d + 2]), cross(carried, own)))
            else:
                axis = vector(segment.axis)
                across = cross(carried, axis)
                if kind == "hinge":
                    turned = plus(turned, plus(scaled(a[d], axis), scaled(v[d], across)))
                else:
                    along = plus(scaled(a[d], axis), scaled(mul(num(2.0), v[d]), across))
                    moved = plus(moved, along)
            found.append((Turning(w, turned, _field(w, turned)), moved))
        return found

    def acceleration(self, segment: int) -> tuple[Turning, Vector]:
        """How a segment turns, and the acceleration of its origin less gravity's, both in its own axes."""
        return (STILL, negative(self.gravity)) if segment == WORLD else self._accelerations[segment]

    def place_of(self, frame: Frame) -> Vector:
        """The origin of a frame in the world."""
        return plus(self.origin(frame.segment), times(self.axes(frame.segment), frame.at))

    def axes_of(self, frame: Frame) -> Matrix:
        """The axes of a frame in the world, as columns."""
        return product(self.axes(frame.segment), frame.turn)

    def velocity_of(self, frame: Frame) -> Vector:
        """The velocity of a frame's origin, in the world."""
        turned = times(self.axes(frame.segment), cross(self.rate(frame.segment), frame.at))
        return plus(self.velocity(frame.segment), turned)

    def rate_of(self, frame: Frame) -> Vector:
        """The angular velocity of a frame, in the world."""
        return times(self.axes(frame.segment), self.rate(frame.segment))

    def acceleration_of(self, frame: Frame) -> Vector:
        """The acceleration of a frame's origin, in the world."""
        if frame.segment == WORLD:
            return ORIGIN
        turning, moved = self.acceleration(frame.segment)
        felt = times(self.axes(frame.segment), plus(moved, times(turning.field, frame.at)))
        return plus(felt, self.gravity)

    def turning_of(self, frame: Frame) -> Vector:
        """The angular acceleration of a frame, in the world."""
        return times(self.axes(frame.segment), self.acceleration(frame.segment)[0].acceleration)
