"""Feedback that holds a replay on the solved motion: a time-varying linear-quadratic regulator, or PD.

The regulator minimises, for the linearised deviations x from the solved motion and the corrections u of the
controls, the sum over time of x'Qx + u'Ru with the weights of Bryson's rule: each entry of Q and R is one
over the square of the deviation or correction that is thought tolerable (:mod:`stc.validate.limits`).  Its
gains follow from the Riccati recursion backwards in time (Anderson and Moore, Optimal Control: Linear
Quadratic Methods, 1990, section 2.4).

Where that cannot be had (the solution does not tell how every coordinate moves, contacts make the linear map
meaningless, or the recursion breaks down) each actuator that moves one tied joint gets a proportional-
derivative law for that joint, tuned to the inertia that it has on the way.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate import limits
from stc.validate.dynamics import mass_matrices
from stc.validate.linearisation import Linearisation
from stc.validate.metrics import FloatArray
from stc.validate.transmissions import joint_dof

if TYPE_CHECKING:
    import mujoco

    from stc.validate.setup import Setup


@dataclass(frozen=True, slots=True)
class Law:
    """Feedback inside one frame step; k tied joints, m actuators, p instants.

    Attributes:
        gains: (p, m, 2k) corrections per deviation of positions, then velocities.
        targets: (p, 2k) the solved positions and velocities.
        positions: (k,) indices of the joints in ``qpos``.
        velocities: (k,) indices in ``qvel``.
    """

    gains: FloatArray
    targets: FloatArray
    positions: np.ndarray
    velocities: np.ndarray

    def correction(self, part: int, data: mujoco.MjData) -> FloatArray:
        """What to add to the controls, (m,), given the state at instant ``part``."""
        state = np.concatenate([data.qpos[self.positions], data.qvel[self.velocities]])
        return np.asarray(self.gains[part] @ (self.targets[part] - state))


@dataclass(frozen=True, slots=True)
class Feedback:
    """A feedback law along the whole motion.

    Attributes:
        kind: ``LQR`` or ``PD``.
        setup: the motion that is tracked.
        gains: function of a frame step and shares of it (p,), giving gains (p, m, 2k).
    """

    kind: str
    setup: Setup
    gains: Callable[[int, FloatArray], FloatArray]

    def in_step(self, frame: int, shares: FloatArray) -> Law:
        """The law at the given shares (p,) of a frame step."""
        reference = self.setup.reference
        motion = reference.in_step(frame, shares)
        targets = np.concatenate([motion[0], motion[1]], axis=1)
        return Law(self.gains(frame, shares), targets, reference.positions, reference.velocities)


def regulator(setup: Setup, maps: Linearisation) -> Feedback | None:
    """The time-varying linear-quadratic regulator; None where there is nothing to steer or no finite gain."""
    gains = _riccati(maps, _control_scales(setup))
    if gains is None:
        return None
    # Gains are for the model's order of coordinates, targets come in the order of the ties.
    order = np.concatenate(
        [setup.reference.velocities, maps.state.shape[1] // 2 + setup.reference.velocities]
    )
    gains = gains[:, :, order]
    return Feedback("LQR", setup, lambda frame, shares: gains[maps.index(frame, shares)])


def _control_scales(setup: Setup) -> FloatArray:
    """(m,) the largest value of each control along the motion; one that is never used gets the largest."""
    largest = np.array([max(np.abs(c.before).max(), np.abs(c.after).max()) for c in setup.controls.channels])
    if not len(largest):
        return largest
    top = float(largest.max()) or 1.0
    return np.where(largest > 1e-3 * top, largest, top)


def _riccati(maps: Linearisation, scales: FloatArray) -> FloatArray | None:
    """Gains (K, m, 2 nv) of the regulator, or None."""
    if not len(scales) or not len(maps.step):
        return None
    nv = maps.state.shape[1] // 2
    tolerable = np.concatenate(
        [np.full(nv, limits.TRACKING_POSITION), np.full(nv, limits.TRACKING_POSITION * limits.TRACKING_RATE)]
    )
    state_weight = np.diag(1.0 / tolerable**2)
    cost = state_weight / limits.TRACKING_RATE
    gains = np.zeros((len(maps.step), len(scales), 2 * nv))
    with np.errstate(all="ignore"):
        control_weight = np.diag(1.0 / (limits.TRACKING_CONTROL * scales) ** 2)
        for k in range(len(maps.step) - 1, -1, -1):
            A, B, h = maps.state[k], maps.control[k], maps.step[k]
            steer = B.T @ cost
            try:
                gain = np.linalg.solve(h * control_weight + steer @ B, steer @ A)
            except np.linalg.LinAlgError:
                return None
            closed = A - B @ gain
            # The symmetric form of the update keeps the cost positive whatever rounding does.
            cost = h * state_weight + closed.T @ cost @ closed + h * gain.T @ control_weight @ gain
            gains[k] = gain
    return gains if np.all(np.isfinite(gains)) else None


def proportional(setup: Setup) -> Feedback | None:
    """A proportional-derivative law for every actuator that moves one tied joint; None where there is none."""
    model, k = setup.compiled, len(setup.ties)
    gain = np.zeros((len(setup.controls), 2 * k))
    inertia = np.mean([mass.diagonal() for mass in mass_matrices(setup, 20)], axis=0)
    joints = {int(dof): j for j, dof in enumerate(setup.reference.velocities)}
    for row, actuator in enumerate(setup.controls.actuators):
        dof = joint_dof(model, actuator)
        if dof is None:
            continue
        strength = model.actuator_gear[actuator, 0] * model.actuator_gainprm[actuator, 0]
        if dof in joints and strength != 0.0:
            stiffness = inertia[dof] * limits.PD_RATE**2 / strength
            gain[row, joints[dof]] = stiffness
            gain[row, k + joints[dof]] = 2.0 * limits.PD_DAMPING * stiffness / limits.PD_RATE
    if not gain.any():
        return None
    return Feedback("PD", setup, lambda _, shares: np.broadcast_to(gain, (len(shares), *gain.shape)))


def strengths(setup: Setup) -> FloatArray:
    """(m,) the largest generalised force, in N or N m, that one unit of each control gives where the motion starts."""
    import mujoco

    model = setup.model(contacts=False)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    data = mujoco.MjData(model)
    setup.reference.put(data, setup.reference.at("after", 0)[:2])
    mujoco.mj_forward(model, data)
    idle, found = data.qfrc_actuator.copy(), np.zeros(len(setup.controls))
    for k, address in enumerate(setup.controls.addresses):
        data.ctrl[:] = 0.0
        data.ctrl[address] = 1.0
        mujoco.mj_forward(model, data)
        found[k] = np.abs(data.qfrc_actuator - idle).max(initial=0.0)
    return found


def contact_effort(setup: Setup) -> FloatArray:
    """(m,) what the solved contact forces give to the joint of each actuator, as the integral of a control's magnitude.

    Zero for actuators that act on no single joint.
    """
    import mujoco

    found = np.zeros(len(setup.controls))
    if not len(setup.contact) or not setup.solution.n:
        return found
    model = setup.model(contacts=False)
    data = mujoco.MjData(model)
    forces = np.zeros((setup.solution.n + 1, model.nv))
    for frame, force in enumerate(forces):
        part = "after" if frame < setup.solution.n else "before"
        setup.reference.put(data, setup.reference.at(part, frame)[:2])
        setup.contact.apply(model, data, setup.contact.at(part, frame))
        force[:] = data.qfrc_applied
    sizes = np.abs(forces)
    effort = np.diff(setup.solution.time) @ (sizes[1:] + sizes[:-1]) / 2.0
    for row, actuator in enumerate(setup.controls.actuators):
        dof = joint_dof(model, actuator)
        strength = abs(float(model.actuator_gear[actuator, 0] * model.actuator_gainprm[actuator, 0]))
        if dof is not None and strength > 0.0:
            found[row] = effort[dof] / strength
    return found
