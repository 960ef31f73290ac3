"""Inverse dynamics: whether the solved forces produce the solved accelerations at each instant.

From position, velocity and acceleration MuJoCo computes the generalised force that the motion needs.  The forces of the
solved actuators and the external forces are subtracted; the remainder is the residual.  Nothing is integrated, so that
an unstable system is judged as strictly as a stable one, and an error in the equations of motion shows wherever it
acts.

- Contacts are switched off, and the solved contact forces act in their place.
- The force that an equality of the model (a closed loop, a gear) can give along the directions it blocks is not part
  of the residual: MuJoCo's own inverse has springs there, which say nothing about the force that holds a loop exactly.
- Dry friction of a joint is Coulomb's: its full force against the motion, and at rest any force up to that.  MuJoCo's
  own rises with the speed, so that its inverse differs wherever a joint is about to stop.
- A joint limit gives no force: MuJoCo's is a soft spring, which acts on a motion that just touches the limit.  The
  force of an end stop is stated by an ``apply`` or ``contact`` line on the joint.
- Joints that the spec does not tie move as in :mod:`stc.validate.untied`; the result includes the effect on the forces
  on the tied ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate import limits
from stc.validate.dry_friction import DryFriction
from stc.validate.equalities import Equalities
from stc.validate.metrics import FloatArray
from stc.validate.progress import steps

if TYPE_CHECKING:
    import mujoco

    from stc.validate.setup import Setup
    from stc.validate.untied import State


#: Controls, and states of actuators.
Drive = tuple[FloatArray, FloatArray]

#: What hangs on joints that the spec does not tie may be too light to be in its equations: up to this share of the
#: largest force.
_NEGLIGIBLE = 1e-6

#: A control or force may be beyond its range by this share of it.
_OVERSTEPPED = 1e-8

#: What moves by less, in m or rad, is at rest.
_STILL = 1e-6


@dataclass(frozen=True, slots=True)
class InverseDynamics:
    """Largest residuals of a motion.

    Attributes:
        at_nodes: (k,) per tied joint, N or N m, at the nodes, where the transcription imposes the equations of motion.
        between: (k,) between the nodes, where the motion follows the transcription's polynomials.
        scale: the motion's largest generalised force: needed, delivered or due to gravity and velocity; at least
            the force that gives it its momentum within its duration, for motions that need no force, or the force
            that moves a joint by :data:`_STILL` within it, for rest without any force.
        untied: (k,) the change of the force on each tied joint if the untied joints are held at the model's initial
            positions; None if all are tied.
        guessed: whether the model's constraints act on untied joints, so that they may move differently.
        nothing: (k,) the force on each joint that moves it by :data:`_STILL` within the motion, where the scale is no
            force of the motion but the one for rest: each joint then rests by its own inertia.
    """

    at_nodes: FloatArray
    between: FloatArray
    scale: float
    untied: FloatArray | None
    guessed: bool = False
    nothing: FloatArray | None = None

    def share(self, residual: FloatArray) -> FloatArray:
        """(k,) residuals as a share of the scale."""
        return residual / self.scale if self.scale > 0.0 else residual

    def limits(self, method: str) -> FloatArray:
        """(k,) limits of the shares at the nodes.

        Untied joints follow the transcription's polynomials, whose error reaches the nodes through them.
        """
        sharp = np.full(len(self.at_nodes), limits.INVERSE_DYNAMICS)
        if self.nothing is not None:
            sharp = np.maximum(sharp, self.share(self.nothing))
        if self.untied is None:
            return sharp
        part = 1.0 if self.guessed else limits.INVERSE_DYNAMICS_BETWEEN[method]
        return np.maximum(_NEGLIGIBLE, part * self.share(self.untied))


def inverse_dynamics(setup: Setup) -> InverseDynamics | None:
    """Residuals along a motion.

    At nodes these are the frames (both sides of those that jump) and, for hermite-simpson, the midpoints; for
    central only frames whose stencils were not clipped.

    Returns:
        None if they cannot be computed: the motion of an untied joint is not known, the solution lacks an
        acceleration, or an actuator has a state that the solution does not contain.
    """
    solution, model = setup.solution, setup.model(contacts=False)
    duration = solution.duration
    untied = setup.untied
    known = setup.all_tied or untied
    if not known or not setup.knows_activations or not setup.reference.has_acceleration:
        return None
    import mujoco

    flags = mujoco.mjtDisableBit
    model.opt.disableflags |= int(flags.mjDSBL_EQUALITY) | int(flags.mjDSBL_LIMIT)
    dry = None
    if not model.tendon_frictionloss.any():  # where it is, MuJoCo's own law has to do for all
        model.opt.disableflags |= int(flags.mjDSBL_FRICTIONLOSS)
        dry = DryFriction(model)
    model.actuator_actearly[:] = 0  # states are those of the same instant
    # MuJoCo clamps what a solver oversteps by its tolerance, and a stiff servo makes much of little.
    for ends in (model.actuator_ctrlrange, model.actuator_forcerange):
        ends += _OVERSTEPPED * np.abs(ends).max(axis=1, keepdims=True) * (-1.0, 1.0)
    data = mujoco.MjData(model)
    ties = Equalities(setup.model(contacts=False))
    outer = setup.all_forces
    order = setup.reference.velocities
    momentum, mass = np.zeros(model.nv), np.zeros((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass)
    # A force f moves an inertia m by f t^2/(2 m).
    nothing = 2.0 * _STILL * mass.diagonal()[order] / duration**2 if duration > 0.0 else np.zeros(len(order))
    scale = at_rest = float(nothing.max(initial=0.0))
    moved = np.zeros(model.nv)

    def forces_at(state: list[FloatArray], drive: Drive, force: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(nv,) the generalised force that the motion needs, with free joints unaccelerated, and the acting force."""
        setup.reference.put(data, state)
        data.ctrl[setup.controls.addresses], data.act[setup.activations.addresses] = drive
        outer.apply(model, data, force)
        mujoco.mj_inverse(model, data)
        needed = data.qfrc_inverse.copy()
        mujoco.mj_fwdActuation(model, data)
        return needed, data.qfrc_actuator + data.qfrc_applied

    def residual(state: list[FloatArray], drive: Drive, force: FloatArray, rest: State | None) -> FloatArray:
        nonlocal scale, moved
        if untied is not None and rest is not None:
            held = np.subtract(*_held(model, data, lambda: forces_at(state, drive, force)))
            untied.put(data, rest)
        needed, delivered = forces_at(state, drive, force)
        if untied is not None and rest is not None:
            mujoco.mj_fullM(model, data, mass)
            needed = needed + mass @ untied.acceleration(mass, delivered - needed)
            moved = np.maximum(moved, np.abs(needed - delivered - held))
            # Where friction holds a joint with more than it has, it slips, and how is not known.
            slips = np.abs(needed - delivered) - model.dof_frictionloss
            moved = np.maximum(moved, float(slips[untied.stuck].max(initial=0.0)))
            # Nobody asks for the forces on untied joints.
            needed, delivered = _only(order, needed), _only(order, delivered)
        mujoco.mj_mulM(model, data, momentum, data.qvel)
        gathered = momentum / duration if duration > 0.0 else momentum
        scale = max(
            scale, *(float(np.abs(f[order]).max()) for f in (needed, delivered, data.qfrc_bias, gathered))
        )
        left = ties.without(data.qpos, needed - delivered)
        if dry is not None:
            passed = ties.without(data.qpos, np.eye(model.nv)) if model.neq else None
            left = dry.without(left, data.qvel, data.qacc, passed)
        return np.abs(left)

    first, last = solution.force_frames or (0, solution.n)
    at_nodes, between = np.zeros(model.nv), np.zeros(model.nv)
    for part, index in places_of(first, last, solution.method):
        state = setup.reference.at(part, index)
        drive = setup.controls.at(part, index), setup.activations.at(part, index)
        rest = None if untied is None else untied.at(part, index)
        at_nodes = np.maximum(at_nodes, residual(state, drive, outer.at(part, index), rest))
    shares = np.array(limits.BETWEEN_SHARES)
    for done in steps("inverse dynamics", last - first):
        step = first + done
        states, controls = setup.reference.in_step(step, shares), setup.controls.in_step(step, shares)
        activations = setup.activations.in_step(step, shares)
        forces = outer.in_step(step, shares)
        rests = [None] * len(shares) if untied is None else untied.in_step(step, shares)
        for k in range(len(shares)):
            drive = controls[k], activations[k]
            found = residual([part[k] for part in states], drive, forces[k], rests[k])
            between = np.maximum(between, found)
    all_tied = InverseDynamics(at_nodes[order], between[order], scale, None)
    if scale == at_rest:
        all_tied = replace(all_tied, nothing=nothing)
    if untied is None:
        return all_tied
    return replace(all_tied, untied=moved[order], guessed=untied.constrained or len(untied.stuck) > 0)


def _held(
    model: mujoco.MjModel, data: mujoco.MjData, forces: Callable[[], tuple[FloatArray, FloatArray]]
) -> tuple[FloatArray, FloatArray]:
    """The result of ``forces`` with all joints that it does not move at the model's initial positions."""
    data.qpos[:], data.qvel[:], data.qacc[:] = model.qpos0, 0.0, 0.0
    return forces()


def _only(chosen: np.ndarray, force: FloatArray) -> FloatArray:
    """The chosen entries of a force; all others are zero."""
    found = np.zeros_like(force)
    found[chosen] = force[chosen]
    return found


def places_of(first: int, last: int, method: str) -> list[tuple[str, int]]:
    """The nodes of a method: sides of frames and midpoints, none before the first frame or after the last one."""
    found = [("after", k) for k in range(first, max(last, first + 1))]
    found += [("before", k) for k in range(first + 1, last + 1)]
    if method == "hermite-simpson":
        found += [("mid", k) for k in range(first, last)]
    return found
