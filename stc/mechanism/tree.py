"""The tree of segments: each is the rigid part behind one joint, with its inertia in its own frame.

A segment's frame sits on the anchor of its joint.  Its axes are its parent's where the joint is at its reference and
its axis is one of them; otherwise they are turned, as little as possible, until it is.  Bodies without joints belong to
the segment that they are fixed to; of a body with several joints only the last segment has mass.  All constant
rotations are numbers; offsets and inertias may be expressions of numbers that can be set.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from stc.mechanism.mechanism import Body, Joint, Mechanism
from stc.mechanism.numbers import Numbers
from stc.mechanism.vectors import (
    ORIGIN,
    Matrix,
    Vector,
    matrix,
    plus,
    product,
    scaled,
    times,
    transposed,
    vector,
)
from stc.records import dataclass, field
from stc.symbolic.expr import ZERO, Expr, add, is_literal, mul, num, sub, sum_of

Rotation = NDArray[np.float64]
#: Entries of constant rotations this close to 0, 1 or -1 are meant to be these.
_NOISE = 1e-14
WORLD = -1
"""The segment of all fixed bodies."""


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame fixed in a segment: its axes there, as columns, and its origin."""

    segment: int
    turn: Matrix
    at: Vector


@dataclass(frozen=True, slots=True)
class Inertia:
    """Mass, first moments and second moments of mass in a segment's frame: sums of m, m x and m x x^T."""

    mass: Expr
    first: Vector
    second: Matrix


NOTHING = Inertia(ZERO, ORIGIN, (ORIGIN, ORIGIN, ORIGIN))


@dataclass(slots=True)
class Segment:
    """One joint and the rigid part behind it.

    Attributes:
        parent: its parent segment, :data:`WORLD` for none.
        joint: the joint.
        turn, at: its frame in the parent's, where its joint is at its reference.
        axis: the direction of a hinge or slide in its frame.
        inertia: of all its bodies together.
        effective: the inertia of it and its descendants that is counted here; the rest is counted with the parents, see
            :func:`_shared`.
        parts: the inertia of each of its bodies with mass.
    """

    parent: int
    joint: Joint
    turn: Matrix
    at: Vector
    axis: tuple[float, float, float]
    inertia: Inertia = NOTHING
    effective: Inertia = NOTHING
    parts: dict[int, Inertia] = field(default_factory=dict)


class Tree:
    """The segments of a mechanism, parents first, and the frames of its bodies in them.

    Attributes
    ----------
    segments
        In the order of the joints.
    frames
        Of every body.
    fixed
        Inertias of bodies that nothing moves, in the world's frame, by body.
    ground
        Their sum with what segments have handed down to the world.
    """

    def __init__(self, mechanism: Mechanism, numbers: Numbers) -> None:
        self.mechanism = mechanism
        self.numbers = numbers
        self.segments: list[Segment] = []
        self.fixed: dict[int, Inertia] = {}
        self._placed: list[tuple[int, Rotation, Vector]] = [(WORLD, np.eye(3), ORIGIN)]
        for index, body in enumerate(mechanism.bodies):
            if index:
                self._place(body)
                self._load(index, body)
        self._merge()
        self.frames = [Frame(s, matrix(_clean(turn)), at) for s, turn, at in self._placed]

    def frame(self, body: int, pos: Vector, quat: Sequence[float] = (1.0, 0.0, 0.0, 0.0)) -> Frame:
        """A frame fixed in a body, from its position and axes in the body's frame."""
        segment, turn, at = self._placed[body]
        return Frame(
            segment, matrix(_clean(turn @ rotation(quat))), plus(at, times(matrix(_clean(turn)), pos))
        )

    def vector_of(self, path: tuple[str, ...], values: Sequence[float]) -> Vector:
        """A vector of numbers that can be set."""
        x, y, z = [self.numbers.number(value, *path, axis) for axis, value in zip("xyz", values, strict=True)]
        return x, y, z

    def _place(self, body: Body) -> None:
        joints = [self.mechanism.joints[index] for index in body.joints]
        segment, turn, at = self._placed[body.parent]
        if not any(joint.kind == "free" for joint in joints):
            at = plus(at, times(matrix(_clean(turn)), self.vector_of(("body", body.name, "pos"), body.pos)))
            turn = turn @ rotation(body.quat)
        for joint in joints:
            if joint.kind == "free":
                turn, at = np.eye(3), ORIGIN
            axes, axis = _axes(joint, turn)
            there = at
            if joint.kind in ("hinge", "ball"):
                there = plus(at, times(matrix(_clean(turn)), vector(joint.anchor)))
            self.segments.append(
                Segment(
                    parent=segment,
                    joint=joint,
                    turn=matrix(_clean(axes)),
                    at=self._derived(there, "joint", joint.name, "at"),
                    axis=axis,
                )
            )
            segment, turn = len(self.segments) - 1, axes.T @ turn
            at = ORIGIN
            if joint.kind in ("hinge", "ball"):
                at = times(matrix(_clean(-turn)), vector(joint.anchor))
        self._placed.append((segment, turn, at))

    def _load(self, index: int, body: Body) -> None:
        """Add a body's inertia to its segment."""
        number = self.numbers.number
        mass = number(body.mass, "body", body.name, "mass")
        moments = self.vector_of(("body", body.name, "inertia"), body.inertia)
        segment, turn, at = self._placed[index]
        com = plus(at, times(matrix(_clean(turn)), self.vector_of(("body", body.name, "com"), body.com)))
        axes = matrix(_clean(turn @ rotation(body.inertia_quat)))
        half = num(0.5)
        x, y, z = moments
        spread = (
            mul(half, sub(add(y, z), x)),
            mul(half, sub(add(z, x), y)),
            mul(half, sub(add(x, y), z)),
        )
        first = scaled(mass, com)

        def second(i: int, j: int) -> Expr:
            own = sum_of([mul(mul(axes[i][k], axes[j][k]), spread[k]) for k in range(3)])
            return add(own, mul(first[i], com[j]))

        inertia = Inertia(mass, first, _symmetric([[second(i, j) for j in range(i + 1)] for i in range(3)]))
        if is_literal(mass, 0.0) and all(is_literal(moment, 0.0) for moment in moments):
            return
        (self.fixed if segment == WORLD else self.segments[segment].parts)[index] = inertia

    def _merge(self) -> None:
        """Sum the inertias of the bodies of each segment, and pass on what its parent can take over."""
        carried = [[*segment.parts.values()] for segment in self.segments]
        ground = [*self.fixed.values()]
        for index in reversed(range(len(self.segments))):
            segment = self.segments[index]
            segment.inertia = self._named(total(segment.parts.values()), "joint", segment.joint.name)
            kept, handed = _shared(segment, total(carried[index]))
            segment.effective = self._named(kept, "joint", segment.joint.name, "effective")
            (carried[segment.parent] if segment.parent != WORLD else ground).append(handed)
        self.ground = total(ground)

    def _named(self, inertia: Inertia, *name: str) -> Inertia:
        x, y, z = inertia.second
        settled = iter(_without_noise([x[0], y[0], y[1], *z]))
        lower = [
            [self.numbers.derive(next(settled), *name, "second", "xyz"[i] + "xyz"[j]) for j in range(i + 1)]
            for i in range(3)
        ]
        return Inertia(
            mass=self.numbers.derive(inertia.mass, *name, "mass"),
            first=self._derived(inertia.first, *name, "first"),
            second=_symmetric(lower),
        )

    def _derived(self, v: Vector, *name: str) -> Vector:
        settled = zip("xyz", _without_noise(v), strict=True)
        x, y, z = [self.numbers.derive(e, *name, axis) for axis, e in settled]
        return x, y, z


def _without_noise(entries: Sequence[Expr]) -> list[Expr]:
    """Related numbers, with values that are zero up to rounding replaced by zero."""
    sizes = [abs(e.payload) if e.op == "num" else 0.0 for e in entries]
    least = _NOISE * max(sizes)
    return [ZERO if e.op == "num" and size < least else e for e, size in zip(entries, sizes, strict=True)]


def total(parts: Iterable[Inertia]) -> Inertia:
    """The inertia of several bodies as one rigid body; all are in the same frame."""
    mass, first, second = ZERO, ORIGIN, NOTHING.second
    for part in parts:
        mass, first = add(mass, part.mass), plus(first, part.first)
        x, y, z = [plus(a, b) for a, b in zip(second, part.second, strict=True)]
        second = (x, y, z)
    return Inertia(mass, first, second)


def _shared(segment: Segment, inertia: Inertia) -> tuple[Inertia, Inertia]:
    """The part of an inertia that a segment keeps, in its frame, and the part that its parent takes over, in the
    parent's.

    Mass on the axis of a hinge moves with the parent as well, and so does mass at the centre of a ball joint; how a
    slide's segment turns is how its parent turns.  The parent takes over as much of this as makes mass, first moment
    and second moment along the axis vanish, which leaves fewer operations and the same motion of all mass
    [Khalil & Dombre 2002, chapter 9].
    """
    kind, mass, first, second = segment.joint.kind, inertia.mass, inertia.first, inertia.second
    if kind == "free":
        return inertia, NOTHING
    if kind == "slide":
        x, y, z = product(product(segment.turn, second), transposed(segment.turn))
        return Inertia(mass, first, NOTHING.second), Inertia(ZERO, ORIGIN, (x, y, z))
    if kind == "ball":
        return Inertia(ZERO, first, second), _moved(mass, ORIGIN, ZERO, segment.at)
    k = next(index for index in range(3) if segment.axis[index])
    along = transposed(segment.turn)[k]
    kept = Inertia(ZERO, _without(first, k), _symmetric_without(second, k))
    return kept, _moved(mass, scaled(first[k], along), second[k][k], segment.at, along)


def _without(v: Vector, k: int) -> Vector:
    x, y, z = [ZERO if i == k else entry for i, entry in enumerate(v)]
    return x, y, z


def _symmetric_without(a: Matrix, k: int) -> Matrix:
    x, y, z = [_without(row, k) if i == k else row for i, row in enumerate(a)]
    return x, y, z


def _moved(mass: Expr, first: Vector, second: Expr, at: Vector, along: Vector = ORIGIN) -> Inertia:
    """The inertia of mass on a line through a point, from its moments about this point."""

    def entry(i: int, j: int) -> Expr:
        of_line = mul(mul(along[i], along[j]), second)
        return sum_of([mul(mass, mul(at[i], at[j])), mul(at[i], first[j]), mul(first[i], at[j]), of_line])

    lower = [[entry(i, j) for j in range(i + 1)] for i in range(3)]
    return Inertia(mass, plus(scaled(mass, at), first), _symmetric(lower))


def _symmetric(lower: Sequence[Sequence[Expr]]) -> Matrix:
    (xx,), (yx, yy), (zx, zy, zz) = lower
    return (xx, yx, zx), (yx, yy, zy), (zx, zy, zz)


def _axes(joint: Joint, turn: Rotation) -> tuple[Rotation, tuple[float, float, float]]:
    """The axes of a joint's segment in its parent's, and the joint's direction in them.

    Args:
        joint: any.
        turn: the axes of its body in the parent's segment.
    """
    if joint.kind == "ball":
        return turn, (0.0, 0.0, 1.0)
    direction = np.array(_clean(turn @ joint.axis))
    if joint.kind in ("slide", "free"):
        x, y, z = direction.tolist()
        return np.eye(3), (x, y, z)
    if np.count_nonzero(direction) == 1:
        x, y, z = np.sign(direction).tolist()
        return np.eye(3), (x, y, z)
    # One axis of the parent's stays where the direction is at right angles to one.
    k = int(np.argmax(np.abs(direction)))
    m = int(np.argmin(np.abs(direction)))
    axes = np.zeros((3, 3))
    axes[:, k] = direction / np.linalg.norm(direction)
    axes[:, m] = np.eye(3)[m] - axes[m, k] * axes[:, k]
    axes[:, m] /= np.linalg.norm(axes[:, m])
    j = 3 - k - m
    axes[:, j] = np.cross(axes[:, (j + 1) % 3], axes[:, (j + 2) % 3])
    x, y, z = np.eye(3)[k].tolist()
    return axes, (x, y, z)


def drawn_pose(mechanism: Mechanism, body: int) -> tuple[Rotation, NDArray[np.float64]]:
    """Axes, as columns, and position of a body in the world, in the pose of the model file."""
    chain = []
    while body:
        chain.append(mechanism.bodies[body])
        body = mechanism.bodies[body].parent
    turn, at = np.eye(3), np.zeros(3)
    for one in reversed(chain):
        at = at + turn @ np.array(one.pos)
        turn = turn @ rotation(one.quat)
    return turn, at


def rotation(quaternion: Sequence[float]) -> Rotation:
    """The rotation matrix of a quaternion of numbers, its real part first."""
    w, x, y, z = np.array(quaternion, dtype=float) / math.sqrt(sum(value * value for value in quaternion))
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


def _clean(values: Rotation) -> list:
    values = np.where(np.abs(values) < _NOISE, 0.0, values)
    return np.where(np.abs(np.abs(values) - 1.0) < _NOISE, np.sign(values), values).tolist()
