"""The connections of a model's joints to a spec: coordinates along or about one axis, and orientations.

A slide or hinge joint is one coordinate, ``joint NAME``.  A free joint is three of them, where its body is in the
world, and an orientation; a ball joint is an orientation.  Each has lines of its own in the replay section:

==========================  =====================================================================================
``joint NAME.x .y .z``      place of a free joint's body in the world, m
``joint NAME.qw`` to        unit quaternion of a free or ball joint
``joint NAME.qz``
``joint NAME.wx .wy .wz``   angular velocity along the body's own axes, rad/s; its rate is the angular acceleration
==========================  =====================================================================================

Orientations are compared by the angle of the rotation between them, so that q and -q are the same.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from stc.solution import ReplayChannel, Solution
from stc.trajectory import Channel
from stc.validate.metrics import FloatArray
from stc.validate.model import ModelError, joint_names, lines_of, nearest
from stc.validate.rotations import angle_between, normalised

if TYPE_CHECKING:
    import mujoco

PLACE = ("x", "y", "z")
QUATERNION = ("qw", "qx", "qy", "qz")
TURNING = ("wx", "wy", "wz")

#: A curve over the motion: node values of a quantity and its derivatives by their order, and the order that is meant.
Source = tuple[Mapping[int, Channel], int]


class Tie(ABC):
    """A part of a joint that is tied to the spec and compared as one quantity.

    Attributes:
        name: its name in messages: the joint's name, and for parts of a free joint a suffix.
        unit: ``m`` or ``rad``.
        joint: index of its joint in the model.
        positions: its indices in ``qpos``.
        velocities: its indices in ``qvel``.
        dofs: names of its degrees of freedom.
        sources: curves of its entries in ``qpos``, in ``qvel`` and in ``qacc``; the last are empty if the solution
            does not contain them.
    """

    name: str
    unit: str
    joint: int
    positions: tuple[int, ...]
    velocities: tuple[int, ...]
    dofs: tuple[str, ...]
    sources: tuple[list[Source], list[Source], list[Source]]

    @property
    def knows_acceleration(self) -> bool:
        """Whether the solution contains its acceleration."""
        return bool(self.sources[2])

    def channels(self, part: int) -> list[Channel]:
        """Node values of its positions (0), velocities (1) or accelerations (2)."""
        return [orders[order] for orders, order in self.sources[part]]

    def solved(self) -> tuple[FloatArray, FloatArray]:
        """(n+1, k) its positions at the frames, before and after them."""
        channels = self.channels(0)
        return np.stack([c.before for c in channels], axis=-1), np.stack([c.after for c in channels], axis=-1)

    def distances(self, positions: FloatArray) -> FloatArray:
        """(..., n+1) distance from the solved motion at the frames; where that jumps, from the nearer side.

        Args:
            positions: (..., n+1, nq) of replays.
        """
        found = positions[..., list(self.positions)]
        before, after = self.solved()
        return np.minimum(np.abs(self.gap(before, found)), np.abs(self.gap(after, found)))

    @abstractmethod
    def gap(self, start: FloatArray, end: FloatArray) -> FloatArray:
        """(...) the distance from one position (..., k) to another; signed for a coordinate."""

    @abstractmethod
    def shown(self, positions: FloatArray) -> FloatArray:
        """(m,) the number that a plot shows of positions (m, k)."""

    @property
    @abstractmethod
    def extent(self) -> float:
        """The largest distance between two of its positions at the frames."""

    @abstractmethod
    def largest_jump(self, limited: bool) -> float:
        """The largest distance of its values before and after a frame; ``limited``: whether its range is enabled."""

    @abstractmethod
    def beyond(self, lower: float, upper: float) -> tuple[float, float, float]:
        """The largest distance beyond its range at the nodes, its value there and the end of the range."""


class Coordinate(Tie):
    """A slide or hinge joint, or one coordinate of a free joint's position.

    Attributes:
        position: its index in ``qpos``.
        velocity: its index in ``qvel``.
        line: the replay line.
        axis: the axis of the world for a free joint; None if the joint has its own axis.
    """

    def __init__(
        self,
        name: str,
        joint: int,
        address: tuple[int, int],
        unit: str,
        line: ReplayChannel,
        axis: int | None = None,
    ) -> None:
        """Take over a line; ``address`` is its index in ``qpos`` and in ``qvel``.

        Raises:
            ModelError: the solution lacks its velocity.
        """
        if line.rate is None:
            raise ModelError(f"joint {line.name}: the solution has no velocity for it at the start")
        self.name, self.unit, self.joint, self.line, self.axis = name, unit, joint, line, axis
        self.position, self.velocity = address
        self.positions, self.velocities, self.dofs = (self.position,), (self.velocity,), (name,)
        orders = _orders(line)
        self.sources = [(orders, 0)], [(orders, 1)], [(orders, 2)] if 2 in orders else []

    def gap(self, start: FloatArray, end: FloatArray) -> FloatArray:
        """(...) the signed difference of positions (..., 1), in m or rad."""
        return np.asarray(end[..., 0] - start[..., 0])

    def shown(self, positions: FloatArray) -> FloatArray:
        """(...) the coordinate itself, in m or rad, of positions (..., 1)."""
        return np.asarray(positions[..., 0])

    @property
    def extent(self) -> float:
        """See :attr:`Tie.extent`."""
        return float(np.ptp([self.line.value.before, self.line.value.after]))

    def direction(self, data: mujoco.MjData) -> FloatArray:
        """(3,) its axis in the world, in the pose of ``data``."""
        return np.array(data.xaxis[self.joint]) if self.axis is None else np.eye(3)[self.axis]

    def largest_jump(self, limited: bool) -> float:
        """See :meth:`Tie.largest_jump`.

        Inside the motion the replay distinguishes whole turns.  At its ends nothing does: for a hinge without a range,
        a change by whole turns is not a jump.
        """
        jump = self.line.value.after - self.line.value.before
        if self.unit == "rad" and not limited:
            jump = np.concatenate([_less_turns(jump[:1]), jump[1:-1], _less_turns(jump[-1:])])
        return float(np.abs(jump).max(initial=0.0))

    def beyond(self, lower: float, upper: float) -> tuple[float, float, float]:
        """See :meth:`Tie.beyond`."""
        values = _at_nodes(self.line.value)
        least, most = float(values.min()), float(values.max())
        return max((lower - least, least, lower), (most - upper, most, upper))


class Orientation(Tie):
    """A ball joint, or the orientation of a free joint's body."""

    unit = "rad"

    def __init__(
        self, name: str, joint: int, address: tuple[int, int], called: str, lines: Mapping[str, ReplayChannel]
    ) -> None:
        """Take over seven lines by their parts.

        Args:
            name: the joint's.
            joint: its index.
            address: of the quaternion in ``qpos`` and of the angular velocity in ``qvel``.
            called: its name in messages.
            lines: by :data:`QUATERNION` and :data:`TURNING`.
        """
        self.name, self.joint = called, joint
        self.positions = tuple(address[0] + k for k in range(4))
        self.velocities = tuple(address[1] + k for k in range(3))
        self.dofs = tuple(f"{name}.{part}" for part in TURNING)
        turning = [_orders(lines[part], 1) for part in TURNING]
        self.sources = (
            [(orders, 0) for orders in _of_one_sign([_orders(lines[part]) for part in QUATERNION])],
            [(orders, 0) for orders in turning],
            [(orders, 1) for orders in turning] if all(1 in orders for orders in turning) else [],
        )

    def gap(self, start: FloatArray, end: FloatArray) -> FloatArray:
        """(...) the angle of the rotation between orientations (..., 4), in rad."""
        return angle_between(start, end)

    def shown(self, positions: FloatArray) -> FloatArray:
        """(k,) the angle since the first of orientations (k, 4), in rad: 0 to 2 pi where none changes suddenly."""
        start, turned = normalised(positions[:1]), normalised(positions)
        sine = np.sin(0.5 * angle_between(np.broadcast_to(start, turned.shape), turned))
        return np.asarray(2.0 * np.arctan2(sine, np.sum(start * turned, axis=-1)))

    @property
    def extent(self) -> float:
        """See :attr:`Tie.extent`."""
        places = normalised(np.concatenate(self.solved()))
        return float(2.0 * np.arccos(np.clip(np.abs(places @ places.T).min(), 0.0, 1.0)))

    def largest_jump(self, limited: bool) -> float:
        """See :meth:`Tie.largest_jump`."""
        return float(self.gap(*self.solved()).max(initial=0.0))

    def beyond(self, lower: float, upper: float) -> tuple[float, float, float]:
        """See :meth:`Tie.beyond`: what has a range is the angle from where the joint is at rest."""
        nodes = np.stack([_at_nodes(channel) for channel in self.channels(0)], axis=-1)
        most = float(angle_between(np.broadcast_to([1.0, 0.0, 0.0, 0.0], nodes.shape), nodes).max())
        return most - upper, most, upper


def tied_joints(model: mujoco.MjModel, solution: Solution) -> list[Tie]:
    """The joints with ``joint`` lines in the spec, in their order.

    Raises:
        ModelError: an unknown joint, parts that are missing or that a joint does not have, or a velocity that the
            solution lacks.
    """
    found: dict[int, dict[str, ReplayChannel]] = {}
    names = joint_names(model)
    for line in lines_of(solution, "joint"):
        joint, part = joint_part(model, line.path, names)
        found.setdefault(joint, {})[part] = line
    return [tie for joint, lines in found.items() for tie in _ties(model, joint, names[joint], lines)]


def joint_part(
    model: mujoco.MjModel, path: tuple[str, ...], names: Sequence[str] | None = None
) -> tuple[int, str]:
    """The joint that a path names, and its part: "" for a slide or hinge joint.

    Args:
        model: that has the joint.
        path: the name, and that of the part.
        names: of all joints, if they are at hand.

    Raises:
        ModelError: there is no such joint, or it has no such part.
    """
    written, names = f"joint {'.'.join(path)}", names or joint_names(model)
    whole, owner = ".".join(path), ".".join(path[:-1])
    if whole in names:
        joint, part = names.index(whole), ""
    elif owner in names and len(path) > 1:
        joint, part = names.index(owner), path[-1]
    else:
        raise ModelError(f"{written}: the model has no joint {whole}{nearest(whole, names)}")
    parts = parts_of(model, joint)
    if part not in parts:
        if parts == ("",):
            raise ModelError(f"{written}: a slide or hinge joint has no parts: write joint {names[joint]}")
        kind = "ball" if parts[0] == QUATERNION[0] else "free"
        raise ModelError(f"{written}: a {kind} joint has several coordinates: write its .{', .'.join(parts)}")
    return joint, part


def find_joint(model: mujoco.MjModel, name: str) -> tuple[int, int, str]:
    """A slide or hinge joint: its index in ``qpos``, its index in ``qvel``, its unit.

    Raises:
        ModelError: there is none of this name, or it has several coordinates.
    """
    joint, _ = joint_part(model, (name,))
    return int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint]), _unit(model, joint)


def _unit(model: mujoco.MjModel, joint: int) -> str:
    """The unit of a slide or hinge joint's coordinate."""
    import mujoco

    return "m" if int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_SLIDE) else "rad"


def parts_of(model: mujoco.MjModel, joint: int) -> tuple[str, ...]:
    """The suffixes of the lines of a joint; "" for slide and hinge joints, which have one line."""
    import mujoco

    kinds = mujoco.mjtJoint
    return {
        int(kinds.mjJNT_FREE): (*PLACE, *QUATERNION, *TURNING),
        int(kinds.mjJNT_BALL): (*QUATERNION, *TURNING),
    }.get(int(model.jnt_type[joint]), ("",))


def joint_dof(model: mujoco.MjModel, joint: int, part: str) -> int | None:
    """The degree of freedom of a part of a joint; None for a component of a quaternion."""
    first = int(model.jnt_dofadr[joint])
    parts = [one for one in parts_of(model, joint) if one not in QUATERNION]
    return first + parts.index(part) if part in parts else None


def _ties(model: mujoco.MjModel, joint: int, name: str, lines: Mapping[str, ReplayChannel]) -> list[Tie]:
    """The ties of one joint."""
    parts = parts_of(model, joint)
    missing = [part for part in parts if part not in lines]
    if missing:
        raise ModelError(f"joint {name}: the replay section lacks its .{', .'.join(missing)}")
    position, velocity = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
    if parts == ("",):
        return [Coordinate(name, joint, (position, velocity), _unit(model, joint), lines[""])]
    places: list[Tie] = [
        Coordinate(f"{name}.{part}", joint, (position + k, velocity + k), "m", lines[part], k)
        for k, part in enumerate(part for part in parts if part in PLACE)
    ]
    address = position + len(places), velocity + len(places)
    return [*places, Orientation(name, joint, address, f"{name}.rotation" if places else name, lines)]


def _orders(line: ReplayChannel, most: int = 2) -> dict[int, Channel]:
    """A line's value and its derivatives up to an order, as far as they are known."""
    found: dict[int, Channel] = {}
    for order, channel in enumerate((line.value, line.rate, line.acceleration)[: most + 1]):
        if channel is None:
            break
        found[order] = channel
    return found


def _of_one_sign(quaternion: Sequence[Mapping[int, Channel]]) -> list[dict[int, Channel]]:
    """The components of a quaternion and their derivatives, with signs that do not change abruptly."""
    value = [component[0] for component in quaternion]
    before, after = (np.stack([getattr(c, side) for c in value]) for side in ("before", "after"))
    mid = None if value[0].mid is None else np.stack([c.mid for c in value if c.mid is not None])
    steps = after.shape[1] - 1
    left, right, middle = np.ones(steps + 1), np.ones(steps + 1), np.ones(steps)
    last = before[:, 0]
    for frame in range(steps + 1):
        left[frame] = _sign(last, before[:, frame])
        right[frame] = _sign(left[frame] * before[:, frame], after[:, frame])
        last = right[frame] * after[:, frame]
        if mid is not None and frame < steps:
            middle[frame] = _sign(last, mid[:, frame])
            last = middle[frame] * mid[:, frame]
    return [
        {
            order: Channel(left * c.before, right * c.after, None if c.mid is None else middle * c.mid)
            for order, c in component.items()
        }
        for component in quaternion
    ]


def _sign(last: FloatArray, now: FloatArray) -> float:
    return -1.0 if float(last @ now) < 0.0 else 1.0


def _at_nodes(channel: Channel) -> FloatArray:
    return np.concatenate([channel.before, channel.after, [] if channel.mid is None else channel.mid])


def _less_turns(angle: FloatArray) -> FloatArray:
    return np.asarray(angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi)))
