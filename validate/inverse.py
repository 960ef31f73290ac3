"""Inverse dynamics: do the solved forces produce the solved accelerations, instant by instant?

MuJoCo computes from position, velocity and acceleration the generalised force that the motion needs; what
the solved actuators and outer forces deliver is subtracted.  The rest is the residual.  Nothing is
integrated, so an unstable system is judged as sharply as a stable one, and an error in the equations of motion
shows wherever it acts.  Contacts are switched off, and the solved contact forces act in their place.  What an
equality of the model (a closed loop, a gear) can give along what it blocks is no residual: MuJoCo's own inverse has
springs there, which tell nothing of the force that holds a loop exactly.  Dry friction of a joint is Coulomb's: its
whole force against the motion, and at rest as much as is needed up to that.  MuJoCo's own rises with the speed and
brakes softly, so that its inverse has another force wherever a joint is about to stop.  A joint limit gives nothing
by itself: MuJoCo's is a soft spring there, which pushes on a motion that just touches the limit.  A force that a
solution takes from its end stop is stated as one, with an ``apply`` or ``contact`` line on the joint.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate import limits
from stc.validate.equalities import Equalities
from stc.validate.metrics import FloatArray
from stc.validate.progress import steps

if TYPE_CHECKING:
    from stc.validate.setup import Setup


#: A joint that is slower (m/s or rad/s) is at rest for its dry friction.
_AT_REST = 1e-9


@dataclass(frozen=True, slots=True)
class InverseDynamics:
    """Largest residuals of a motion.

    Attributes:
        at_nodes: (k,) per tied joint, N or N m, where the transcription imposes the equations of motion.
        between: (k,) in between, where only the transcription's polynomials say how the motion goes.
        scale: the motion's largest generalised force: needed, delivered or due to gravity and velocity; at least
            what gives it its momentum within its duration, so that gliding, which takes no force, is measured too.
    """

    at_nodes: FloatArray
    between: FloatArray
    scale: float

    def share(self, residual: FloatArray) -> FloatArray:
        """(k,) residuals as a share of the scale."""
        return residual / self.scale if self.scale > 0.0 else residual


def inverse_dynamics(setup: Setup) -> InverseDynamics | None:
    """Residuals along a motion.

    At nodes these are the frames (both sides of those that jump) and, for hermite-simpson, the midpoints; for
    central only frames whose stencils were not clipped.

    Returns:
        None where it cannot be said: a joint of the model is not tied, the solution lacks an acceleration,
        or an actuator has a state of its own.
    """
    solution, model = setup.solution, setup.model(contacts=False)
    duration = solution.duration
    if not setup.all_tied or model.na or not setup.reference.has_acceleration:
        return None
    import mujoco

    flags = mujoco.mjtDisableBit
    model.opt.disableflags |= int(flags.mjDSBL_EQUALITY) | int(flags.mjDSBL_LIMIT)
    loss = np.zeros(model.nv)
    if not model.tendon_frictionloss.any():  # where it is, MuJoCo's own law has to do for all
        model.opt.disableflags |= int(flags.mjDSBL_FRICTIONLOSS)
        loss = model.dof_frictionloss
    data = mujoco.MjData(model)
    ties = Equalities(setup.model(contacts=False))
    outer = setup.all_forces
    scale, momentum = 0.0, np.zeros(model.nv)

    def residual(state: list[FloatArray], control: FloatArray, force: FloatArray) -> FloatArray:
        nonlocal scale
        setup.reference.put(data, state)
        data.ctrl[setup.controls.addresses] = control
        outer.apply(model, data, force)
        mujoco.mj_inverse(model, data)
        needed = data.qfrc_inverse.copy()
        mujoco.mj_fwdActuation(model, data)
        delivered = data.qfrc_actuator + data.qfrc_applied
        mujoco.mj_mulM(model, data, momentum, data.qvel)
        gathered = momentum / duration if duration > 0.0 else momentum
        scale = max(scale, *(float(np.abs(f).max()) for f in (needed, delivered, data.qfrc_bias, gathered)))
        left = ties.without(data.qpos, needed - delivered)
        return np.abs(_without_dry_friction(left, data.qvel, loss))

    first, last = solution.force_frames or (0, solution.n)
    at_nodes, between = np.zeros(model.nv), np.zeros(model.nv)
    for part, index in _nodes(first, last, solution.method):
        state, control = setup.reference.at(part, index), setup.controls.at(part, index)
        at_nodes = np.maximum(at_nodes, residual(state, control, outer.at(part, index)))
    shares = np.array(limits.BETWEEN_SHARES)
    for done in steps("inverse dynamics", last - first):
        step = first + done
        states, controls = setup.reference.in_step(step, shares), setup.controls.in_step(step, shares)
        forces = outer.in_step(step, shares)
        for k in range(len(shares)):
            found = residual([part[k] for part in states], controls[k], forces[k])
            between = np.maximum(between, found)
    order = setup.reference.velocities
    return InverseDynamics(at_nodes[order], between[order], scale)


def _without_dry_friction(force: FloatArray, velocity: FloatArray, loss: FloatArray) -> FloatArray:
    """(nv,) what is left of a generalised force without the joints' dry friction, at most ``loss`` each."""
    at_rest = np.abs(velocity) <= _AT_REST
    friction = np.where(at_rest, np.clip(force, -loss, loss), -loss * np.sign(velocity))
    return np.asarray(force - friction)


def _nodes(first: int, last: int, method: str) -> list[tuple[str, int]]:
    """Sides of frames and midpoints: what lies before the first frame or after the last one is left out."""
    found = [("after", k) for k in range(first, max(last, first + 1))]
    found += [("before", k) for k in range(first + 1, last + 1)]
    if method == "hermite-simpson":
        found += [("mid", k) for k in range(first, last)]
    return found
