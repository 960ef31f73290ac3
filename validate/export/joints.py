"""A motion as a plain table of joints, torques, controls and contact forces, with units in its header.

A row per instant.  Columns are ``time [s]``; for each coordinate its position, velocity and acceleration, such as
``joint.knee [rad]``, ``joint.knee' [rad/s]``, ``joint.knee'' [rad/s^2]``, those of a free joint with the parts that
the language has for them (``.x``, ``.qw``, ``.wx``); ``torque.knee [N m]``, what the actuators do to the joint;
``actuator.knee [ctrl]``, the control as MuJoCo takes it; and ``contact.body.base.fx [N]``.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from stc.atomic import replacing
from stc.validate.export.states import States, instants, states
from stc.validate.metrics import FloatArray
from stc.validate.model import joint_names
from stc.validate.setup import Setup
from stc.validate.ties import PLACE, QUATERNION, TURNING, joint_dof, parts_of

if TYPE_CHECKING:
    import mujoco


def write(setup: Setup, path: Path, rate: float | None = None) -> None:
    """Write the table.

    Args:
        setup: the motion and its model.
        path: of the file, ``.csv``.
        rate: instants per second; None takes the frames.

    Raises:
        UsageError: with this rate the table is out of proportion.
        OSError: the file cannot be written.
    """
    model = setup.compiled
    times = instants(setup, rate, 1 + model.nq + 3 * model.nv + model.nu + len(setup.contact))
    columns = dict(_columns(setup, states(setup, times)))
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([repr(float(value)) for value in row] for row in zip(*columns.values()))


def _columns(setup: Setup, found: States) -> Iterator[tuple[str, FloatArray]]:
    model = setup.compiled
    yield "time [s]", found.time
    for joint, name in enumerate(joint_names(model)):
        yield from _of_joint(model, joint, name, found)
    for name, address in zip(setup.controls.names, setup.controls.addresses):
        yield f"actuator.{name} [ctrl]", found.control[:, address]
    for name, values in zip(found.contact_names, found.contact.T):
        yield f"contact.{name} [{'N' if name[-2] == 'f' else 'N m'}]", values


def _of_joint(
    model: mujoco.MjModel, joint: int, name: str, found: States
) -> Iterator[tuple[str, FloatArray]]:
    """The columns of one joint: all of its parts, then their rates, then torques."""
    place, first = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
    parts = parts_of(model, joint)
    for k, part in enumerate(part for part in parts if part not in TURNING):
        label = f"joint.{name}{'.' * bool(part)}{part}"
        yield f"{label} [{position_unit(model, joint, part)}]", found.position[:, place + k]
    rates = [part for part in parts if part not in QUATERNION]
    for part in rates:
        dof, label = joint_dof(model, joint, part), f"joint.{name}{'.' * bool(part)}{part}"
        unit, prime = ("rad", "") if part in TURNING else (position_unit(model, joint, part), "'")
        yield f"{label}{prime} [{unit}/s]", found.velocity[:, dof]
        if found.acceleration is not None:
            yield f"{label}{prime}' [{unit}/s^2]", found.acceleration[:, dof]
    for k, part in enumerate(rates):
        straight = position_unit(model, joint, part) == "m"
        label = f"torque.{name}{'.' * bool(part)}{part}"
        yield f"{label} [{'N' if straight else 'N m'}]", found.torque[:, first + k]


def position_unit(model: mujoco.MjModel, joint: int, part: str) -> str:
    """The unit of a part of a joint: m, rad, or 1 for a component of a quaternion."""
    import mujoco

    if part in PLACE or int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_SLIDE):
        return "m"
    return "1" if part in QUATERNION else "rad"
