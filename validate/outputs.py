"""The outputs of a model that a spec can compare: ``compare site.tip.x = expression;`` and similar lines.

=======================================  ====================================================================
path                                     output
=======================================  ====================================================================
``joint.NAME``                           position of a joint, m or rad
``joint.NAME.velocity``                  its velocity, m/s or rad/s
``joint.NAME.x`` (``.y``, ``.z``)        place of a free joint's body in the world, m
``joint.NAME.qw`` to ``.qz``             quaternion of a free or ball joint, with either sign
``joint.NAME.wx`` (``.wy``, ``.wz``)     angular velocity along its body's axes, rad/s
``body.NAME.x`` (``.y``, ``.z``)         world position of a body's frame, m; likewise ``geom`` and ``site``
``body.NAME.vx`` (``.vy``, ``.vz``)      its world velocity, m/s
``body.NAME.wx`` (``.wy``, ``.wz``)      its angular velocity along the world's axes, rad/s
``body.NAME.xaxis.x`` to ``.zaxis.z``    the axes of its frame in the world
``com.NAME.x`` (``.y``, ``.z``)          world centre of mass of a body and all its descendants, m
``com.x``, ``com.vx``, ...               of everything; ``com.NAME.vx``: its velocity, m/s
``sensor.NAME``                          a sensor with one value, in the sensor's unit
=======================================  ====================================================================
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.solution import ReplayChannel, Solution
from stc.validate.metrics import FloatArray
from stc.validate.model import ModelError, find_object, lines_of, nearest
from stc.validate.ties import PLACE, QUATERNION, TURNING, joint_dof, parts_of

if TYPE_CHECKING:
    import mujoco

_AXES = {"x": 0, "y": 1, "z": 2}
_VELOCITIES = {"vx": 0, "vy": 1, "vz": 2}
_TURNING = {"wx": 0, "wy": 1, "wz": 2}
_FRAME_AXES = {"xaxis": 0, "yaxis": 1, "zaxis": 2}

#: Finds a value in a simulation whose derived quantities are up to date.
Read = Callable[["mujoco.MjModel", "mujoco.MjData"], float]


@dataclass(frozen=True, slots=True)
class Output:
    """One compared output.

    Attributes:
        line: the replay line with the solved values.
        unit: of the output, "" for a sensor, a component of an axis or a quaternion.
        read: finds its value in a simulation whose derived quantities are up to date.
        either_sign: whether a value and its negative are the same, as for quaternions.
    """

    line: ReplayChannel
    unit: str
    read: Read
    either_sign: bool = False

    def distances(self, values: FloatArray) -> FloatArray:
        """(n+1,) distance of replayed values (n+1,) from the solved ones, from the nearer side where these jump."""
        solved = self.line.value
        found = np.minimum(np.abs(values - solved.before), np.abs(values - solved.after))
        if self.either_sign:
            found = np.minimum(
                found, np.minimum(np.abs(values + solved.before), np.abs(values + solved.after))
            )
        return found


def compared_outputs(model: mujoco.MjModel, solution: Solution) -> list[Output]:
    """The outputs in the spec's ``compare`` lines.

    Raises:
        ModelError: an unknown path.
    """
    return [
        Output(
            line,
            *find_output(model, line.path),
            either_sign=line.path[0] == "joint" and line.path[-1] in QUATERNION,
        )
        for line in lines_of(solution, "compare")
    ]


def find_output(model: mujoco.MjModel, path: tuple[str, ...]) -> tuple[str, Read]:
    """The unit of the output that a ``compare`` line names, "" for a sensor, and the function that reads it.

    Raises:
        ModelError: an unknown path.
    """
    written = f"compare {'.'.join(path)}"
    kind, *rest = path
    if kind not in ("joint", "sensor", "com", "body", "geom", "site"):
        known = ["joint", "body", "geom", "site", "com", "sensor"]
        raise ModelError(f"{written}: {kind} cannot be compared{nearest(kind, known)}")
    if not rest:
        raise ModelError(f"{written}: the name of the {kind} is missing")
    if kind == "com" and len(rest) == 1 and rest[0] in (*_AXES, *_VELOCITIES):
        return _point(written, kind, 0, rest)
    index = find_object(model, "body" if kind == "com" else kind, rest[0], written)
    if kind == "joint":
        return _joint(model, written, index, rest[1:])
    if kind == "sensor":
        return _sensor(model, written, index, rest[1:])
    return _point(written, kind, index, rest[1:])


def _joint(model: mujoco.MjModel, written: str, index: int, rest: list[str]) -> tuple[str, Read]:
    import mujoco

    units = {int(mujoco.mjtJoint.mjJNT_SLIDE): "m", int(mujoco.mjtJoint.mjJNT_HINGE): "rad"}
    unit = units.get(int(model.jnt_type[index]))
    position, velocity = int(model.jnt_qposadr[index]), int(model.jnt_dofadr[index])
    if unit is None:
        return _part(model, written, index, rest)
    if not rest:
        return unit, (lambda _, data: float(data.qpos[position]))
    if rest == ["velocity"]:
        return f"{unit}/s", (lambda _, data: float(data.qvel[velocity]))
    raise ModelError(f"{written}: a joint has its position and .velocity, but no .{'.'.join(rest)}")


def _part(model: mujoco.MjModel, written: str, joint: int, rest: list[str]) -> tuple[str, Read]:
    """A component of a free or ball joint."""
    parts = parts_of(model, joint)
    if len(rest) != 1 or rest[0] not in parts:
        raise ModelError(
            f"{written}: a ball or free joint has several coordinates: write its .{', .'.join(parts)}"
        )
    if rest[0] in TURNING:
        dof = joint_dof(model, joint, rest[0])
        return "rad/s", (lambda _, data: float(data.qvel[dof]))
    address = int(model.jnt_qposadr[joint]) + parts.index(rest[0])
    return "m" if rest[0] in PLACE else "", (lambda _, data: float(data.qpos[address]))


def _sensor(model: mujoco.MjModel, written: str, index: int, rest: list[str]) -> tuple[str, Read]:
    if rest or model.sensor_dim[index] != 1:
        raise ModelError(f"{written}: only a sensor with one value can be compared")
    address = int(model.sensor_adr[index])
    return "", (lambda _, data: float(data.sensordata[address]))


def _point(written: str, kind: str, index: int, rest: list[str]) -> tuple[str, Read]:
    """A world coordinate of a body, geom, site or centre of mass, or its velocity."""
    if len(rest) == 1 and rest[0] in _AXES:
        array = {"body": "xpos", "geom": "geom_xpos", "site": "site_xpos", "com": "subtree_com"}[kind]
        axis = _AXES[rest[0]]
        return "m", (lambda _, data: float(getattr(data, array)[index, axis]))
    if len(rest) == 1 and rest[0] in _VELOCITIES:
        axis = _VELOCITIES[rest[0]]
        if kind == "com":
            return "m/s", (lambda model, data: _velocity_of_centre(model, data, index, axis))
        return "m/s", (lambda model, data: _velocity(model, data, kind, index, 3 + axis))
    if kind != "com" and len(rest) == 1 and rest[0] in _TURNING:
        axis = _TURNING[rest[0]]
        return "rad/s", (lambda model, data: _velocity(model, data, kind, index, axis))
    if kind != "com" and len(rest) == 2 and rest[0] in _FRAME_AXES and rest[1] in _AXES:
        array = {"body": "xmat", "geom": "geom_xmat", "site": "site_xmat"}[kind]
        entry = 3 * _AXES[rest[1]] + _FRAME_AXES[rest[0]]
        return "", (lambda _, data: float(getattr(data, array)[index].reshape(-1)[entry]))
    parts = ".x, .y, .z, .vx, .vy, .vz" + ("" if kind == "com" else ", .wx, .wy, .wz or an axis, as .xaxis.x")
    raise ModelError(f"{written}: end the path in one of {parts}")


def _velocity_of_centre(model: mujoco.MjModel, data: mujoco.MjData, index: int, axis: int) -> float:
    """The velocity of the centre of mass of a body with all its descendants."""
    import mujoco

    mujoco.mj_subtreeVel(model, data)
    return float(data.subtree_linvel[index, axis])


def _velocity(model: mujoco.MjModel, data: mujoco.MjData, kind: str, index: int, part: int) -> float:
    """One of an object's angular and linear velocity along the world's axes, in this order."""
    import mujoco

    # mjOBJ_BODY would be the centre of mass; XBODY is the body's frame, as xpos is.
    types = {"body": "mjOBJ_XBODY", "geom": "mjOBJ_GEOM", "site": "mjOBJ_SITE"}
    both = np.zeros(6)  # angular, then linear
    mujoco.mj_objectVelocity(model, data, int(getattr(mujoco.mjtObj, types[kind])), index, both, 0)
    return float(both[part])
