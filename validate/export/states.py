"""The solved motion in MuJoCo's coordinates at any times: what tables, ROS messages and data sets are made of."""

from __future__ import annotations

import numpy as np

from stc.records import dataclass
from stc.validate.export.proportion import intervals, require_proportion
from stc.validate.metrics import FloatArray
from stc.validate.pictures.motion import solved_at
from stc.validate.setup import Setup

__all__ = ["States", "controls", "instants", "states", "velocities"]


@dataclass(slots=True)
class States:
    """The motion at k instants, of a model with nq positions, nv velocities and nu controls.

    Attributes:
        time: seconds, (k,).
        position: ``qpos``, (k, nq).
        velocity: ``qvel``, (k, nv).
        acceleration: ``qacc``, (k, nv); None where the solution does not know all of them.
        control: ``ctrl``, (k, nu).
        torque: what the actuators do to the degrees of freedom, ``qfrc_actuator``, (k, nv), in N or N m.
        contact: forces under ``contact`` in the replay section, in N or N m, (k, c).
        contact_names: of these, such as ``body.base.fx``.
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray | None
    control: FloatArray
    torque: FloatArray
    contact: FloatArray
    contact_names: list[str]


def instants(setup: Setup, rate: float | None, numbers: int) -> FloatArray:
    """Times at a rate, the last one being the end of the motion; without a rate those of the frames.

    Raises:
        UsageError: so many instants of ``numbers`` numbers each are out of proportion.
    """
    solution = setup.solution
    if rate is None or solution.n == 0:
        return solution.time
    require_proportion(solution.duration * rate, numbers, f"a rate of {rate:g} Hz")
    count = max(1, intervals(solution.duration, rate))
    return np.minimum(solution.time[0] + np.arange(count + 1) / rate, solution.time[-1])


def states(setup: Setup, times: FloatArray) -> States:
    """The motion at some times (k,); where something jumps, as it is after the jump."""
    contact = setup.contact
    control = controls(setup, times)
    position, velocity = solved_at(setup, times), velocities(setup, times)
    return States(
        times,
        position,
        velocity,
        _of_joints(setup, times, 2) if setup.reference.has_acceleration else None,
        control,
        _torques(setup, times, position, velocity, control),
        contact.at_times(times),
        [name.removeprefix("contact ") for name in contact.where.names],
    )


def velocities(setup: Setup, times: FloatArray) -> FloatArray:
    """(k, nv) solved velocities; joints that are not tied have none."""
    return _of_joints(setup, times, 1)


def controls(setup: Setup, times: FloatArray) -> FloatArray:
    """(k, nu) solved controls; actuators that are not driven get none."""
    found = np.zeros((len(times), setup.compiled.nu))
    found[:, setup.controls.addresses] = setup.controls.at_times(times)
    return found


def _of_joints(setup: Setup, times: FloatArray, order: int) -> FloatArray:
    """(k, nv) velocities (order 1) or accelerations (order 2) of the tied joints."""
    found = np.zeros((len(times), setup.compiled.nv))
    found[:, setup.reference.velocities] = setup.reference.at_times(times)[order]
    return found


def _torques(
    setup: Setup, times: FloatArray, position: FloatArray, velocity: FloatArray, control: FloatArray
) -> FloatArray:
    """(k, nv) by MuJoCo's own actuators."""
    import mujoco

    model = setup.model(contacts=False)
    data = mujoco.MjData(model)
    activation = setup.activations.at_times(times)
    found = np.zeros((len(times), model.nv))
    for k in range(len(times)):
        data.qpos[:], data.qvel[:], data.ctrl[:] = position[k], velocity[k], control[k]
        data.act[setup.activations.addresses] = activation[k]
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_fwdActuation(model, data)
        found[k] = data.qfrc_actuator
    return found
