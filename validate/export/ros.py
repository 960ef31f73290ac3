"""A motion as ROS 2's ``trajectory_msgs/msg/JointTrajectory``, in YAML.

    ros2 topic pub --once TOPIC trajectory_msgs/msg/JointTrajectory --yaml-file motion.yaml

sends it (where that option is missing, ``"$(cat motion.yaml)"`` in its place); scripts read it with any YAML reader.
The message is about joints with one coordinate that motors move, which is what controllers take.  What else moves, the
base of a robot that walks, is named in a comment.  ``effort`` is what the actuators do to each joint, in N or N m.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from stc.atomic import replacing
from stc.errors import UsageError
from stc.validate.export.states import States, instants, states
from stc.validate.metrics import FloatArray
from stc.validate.model import joint_names
from stc.validate.setup import Setup
from stc.validate.ties import parts_of

_NANOSECONDS = 1_000_000_000


def write(setup: Setup, path: Path, rate: float | None = None) -> None:
    """Write the message.

    Args:
        setup: the motion and its model.
        path: of the file, ``.yaml``.
        rate: points per second; None takes the frames.

    Raises:
        UsageError: there are no such joints, or with this rate the file is out of proportion.
        OSError: the file cannot be written.
    """
    model = setup.compiled
    names = joint_names(model)
    found = states(setup, instants(setup, rate, 4 * model.njnt))
    left = _left_out(setup, found)
    if len(left) == model.njnt:
        raise UsageError(
            f"no motor of {setup.path.name} moves a joint of one coordinate, which is what a JointTrajectory tells of",
            "--format joints writes all joints as a table",
        )
    joints = [joint for joint in range(model.njnt) if joint not in left]
    places, dofs = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
    nanoseconds = np.round((found.time - found.time[0]) * _NANOSECONDS).astype(int)
    lines = [f"# {setup.solution.name}, solved by stc, of {setup.path.name}; s, rad or m, and N m or N"]
    lines += [f"# not in here: {names[joint]}, {why}" for joint, why in left.items()]
    lines += ["header: {stamp: {sec: 0, nanosec: 0}, frame_id: ''}", "joint_names:"]
    lines += [f"- {json.dumps(names[joint])}" for joint in joints]
    lines.append("points:")
    for k, time in enumerate(nanoseconds.tolist()):
        acceleration = [] if found.acceleration is None else found.acceleration[k, dofs]
        lines += [
            f"- positions: {_listed(found.position[k, places])}",
            f"  velocities: {_listed(found.velocity[k, dofs])}",
            f"  accelerations: {_listed(acceleration)}",
            f"  effort: {_listed(found.torque[k, dofs])}",
            f"  time_from_start: {{sec: {time // _NANOSECONDS}, nanosec: {time % _NANOSECONDS}}}",
        ]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _left_out(setup: Setup, found: States) -> dict[int, str]:
    """The joints that the message has no place for, and those that no motor moves, which no controller takes."""
    import mujoco

    model, kinds = setup.compiled, mujoco.mjtTrn
    direct = np.isin(model.actuator_trntype, (int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT)))
    driven = set(model.actuator_trnid[direct, 0].tolist())
    driven |= {int(model.dof_jntid[dof]) for dof in np.flatnonzero(np.abs(found.torque).max(axis=0))}
    left = {}
    for joint in range(model.njnt):
        if parts_of(model, joint) != ("",):
            left[joint] = "which has several coordinates"
        elif joint not in driven:
            left[joint] = "which no motor moves"
    return left


def _listed(values: FloatArray | list[float]) -> str:
    """Numbers that every reader of YAML 1.1 takes for such: with a point, and a sign after the e."""
    return f"[{', '.join(_number(float(value)) for value in values)}]"


def _number(value: float) -> str:
    mantissa, e, exponent = repr(value).partition("e")
    return f"{mantissa}{'' if '.' in mantissa else '.0'}{e}{exponent}"
