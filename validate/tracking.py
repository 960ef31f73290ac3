"""Feedback that stabilises a replay about the solved motion: a time-varying linear-quadratic regulator, or PD.

The regulator minimises, for the linearised deviations x from the solved motion and the corrections u of the
controls, the sum over time of x'Qx + u'Ru with the weights of Bryson's rule: each entry of Q and R is one
over the square of the deviation or correction that is thought tolerable (:mod:`stc.validate.limits`).  Its
gains follow from the Riccati recursion backwards in time (Anderson and Moore, Optimal Control: Linear
Quadratic Methods, 1990, section 2.4).

If there is no regulator (the motion of a coordinate is not known, contacts make the linear map meaningless, or the
recursion breaks down), each actuator that moves a tied joint, or several by a fixed tendon, gets a
proportional-derivative law for these, tuned to their inertia along the motion.
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
from stc.validate.transmissions import own_pull, pulls

if TYPE_CHECKING:
    from stc.validate.reference import Reference
    from stc.validate.setup import Setup


@dataclass(frozen=True, slots=True)
class Law:
    """Feedback inside one frame step; p tied positions, v tied velocities, m actuators, s instants.

    Attributes:
        gains: (s, m, 2v) corrections per deviation of positions, then velocities.
        poses: (s, p) the solved positions.
        rates: (s, v) the solved velocities.
        reference: the motion that is tracked.
    """

    gains: FloatArray
    poses: FloatArray
    rates: FloatArray
    reference: Reference

    def correction(self, part: int, qpos: FloatArray, qvel: FloatArray) -> FloatArray:
        """The correction of the controls, (..., m), for states (..., nq) and (..., nv) at instant ``part``."""
        reference = self.reference
        way = reference.deviation(qpos[..., reference.positions], self.poses[part])
        change = self.rates[part] - qvel[..., reference.velocities]
        return np.asarray(np.concatenate([way, change], axis=-1) @ self.gains[part].T)


@dataclass(frozen=True, slots=True)
class Feedback:
    """A feedback law along the whole motion.

    Attributes:
        kind: ``LQR`` or ``PD``.
        setup: the motion that is tracked.
        gains: function of a frame step and shares of it (s,), giving gains (s, m, 2v).
    """

    kind: str
    setup: Setup
    gains: Callable[[int, FloatArray], FloatArray]

    def in_step(self, frame: int, shares: FloatArray) -> Law:
        """The law at the given shares (s,) of a frame step."""
        reference = self.setup.reference
        pose, rate = reference.in_step(frame, shares)[:2]
        return Law(self.gains(frame, shares), pose, rate, reference)


def regulator(setup: Setup, maps: Linearisation) -> Feedback | None:
    """The time-varying linear-quadratic regulator; None if no actuator can steer or a gain is not finite."""
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
    """(m,) the largest value of each control along the motion, and as much of the largest one of all as it is judged by
    at least; 1 where no control is used.
    """
    largest = np.array([max(np.abs(c.before).max(), np.abs(c.after).max()) for c in setup.controls.channels])
    top = float(largest.max(initial=0.0))
    return np.maximum(largest, limits.HARDLY_USED * top) if top else np.ones(len(largest))


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
    """A proportional-derivative law for every actuator with tied joints of its own; None if there is none.

    For an actuator that acts along a direction e of the generalised forces, with the strength s, the gains make the
    deviation along e an oscillator of :data:`limits.PD_RATE` with the model's inertia along e.
    """
    tied = setup.reference.velocities
    gain = np.zeros((len(setup.controls), 2 * len(tied)))
    inertia = np.mean(list(mass_matrices(setup, 20)), axis=0)
    for row, pull in enumerate(own_pull(setup)):
        strength = float(np.linalg.norm(pull))
        if strength == 0.0 or not set(np.flatnonzero(pull)) <= set(tied.tolist()):
            continue
        along = pull / strength
        stiffness = float(along @ inertia @ along) * limits.PD_RATE**2 / strength
        gain[row, : len(tied)] = stiffness * along[tied]
        gain[row, len(tied) :] = 2.0 * limits.PD_DAMPING / limits.PD_RATE * stiffness * along[tied]
    if not gain.any():
        return None
    return Feedback("PD", setup, lambda _, shares: np.broadcast_to(gain, (len(shares), *gain.shape)))


def strengths(setup: Setup) -> FloatArray:
    """(m,) the largest generalised force, in N or N m, of one unit of each control at the start of the motion."""
    return np.abs(pulls(setup)).max(axis=1, initial=0.0)


def contact_effort(setup: Setup) -> FloatArray:
    """(m,) the integral of the solved contact forces on the joints of each actuator, for comparison with its effort.

    Zero for actuators without joints of their own.
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
    for row, pull in enumerate(own_pull(setup)):
        strength = float(np.linalg.norm(pull))
        if strength > 0.0:
            # What a control has to give along its own direction: exactly, where that is one joint's.
            found[row] = np.abs(pull) @ effort / strength**2
    return found
