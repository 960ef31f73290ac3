"""Energy balance: between frames the model's mechanical energy must change by the work done on it.

Energy and power are computed by MuJoCo along the solved motion: kinetic energy and the potentials of gravity and
springs on one side; actuators, dampers, media, dry friction and external forces on the other.  At a jump of velocities
the balance ends and starts again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate.dry_friction import DryFriction
from stc.validate.progress import steps

if TYPE_CHECKING:
    import mujoco

    from stc.validate.metrics import FloatArray
    from stc.validate.setup import Setup

#: Gauss-Legendre nodes of the work integral in each step.
_NODES = 5

#: Motions smaller or slower than this, in m, rad or per second, count as that large: where nothing moves, all that
#: passes through the books is rounding, and a share of that says nothing.
_STILL = 1e-3


@dataclass(frozen=True, slots=True)
class EnergyBalance:
    """The energy balance of a motion, in J.

    Attributes:
        defect: largest absolute value of the accumulated difference between energy and work.
        turnover: the scale of the balance: the largest of the absolute work, the kinetic energy, the change of
            potential energy and that of both together.  In a free flight and a free pendulum no work is done, but one
            kind of energy is exchanged for the other.
        jumps: energy that appears (positive) or disappears where velocities jump, largest in size.
    """

    defect: float
    turnover: float
    jumps: float

    @property
    def share(self) -> float:
        """The defect as a share of the turnover."""
        return self.defect / self.turnover if self.turnover > 0.0 else self.defect


def energy_balance(setup: Setup) -> EnergyBalance | None:
    """The energy balance of a solved motion.

    Returns:
        None if it cannot be computed: the motion of an untied joint is not known, an actuator has a
        state that the solution does not contain, or the motion has one frame only.
    """
    import mujoco

    solution = setup.solution
    untied = setup.untied
    if not (setup.all_tied or untied) or not setup.knows_activations or solution.n == 0:
        return None
    model = setup.model(contacts=False)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    model.actuator_actearly[:] = 0  # states are those of the same instant
    data = mujoco.MjData(model)
    outer, dry = setup.all_forces, DryFriction(model)
    points, weights = np.polynomial.legendre.leggauss(_NODES)
    shares, weights = 0.5 * (points + 1.0), 0.5 * weights

    def energies(part: str, frame: int) -> FloatArray:
        """(2,) potential and kinetic."""
        if untied is not None:
            untied.put(data, untied.at(part, frame))
        setup.reference.put(data, setup.reference.at(part, frame)[:2])
        mujoco.mj_forward(model, data)
        return np.array(data.energy)

    starts = np.array([energies("after", k) for k in range(solution.n)])
    ends = np.array([energies("before", k) for k in range(1, solution.n + 1)])
    after, before = starts.sum(axis=1), ends.sum(axis=1)
    work, unknown, effort, force = np.zeros(solution.n), np.zeros(solution.n), 0.0, 0.0
    durations = np.diff(solution.time)
    for step in steps("energy balance", solution.n):
        duration = durations[step]
        states = setup.reference.in_step(step, shares)
        controls, forces = setup.controls.in_step(step, shares), outer.in_step(step, shares)
        activations = setup.activations.in_step(step, shares)
        rests = [] if untied is None else untied.in_step(step, shares)
        for k, weight in enumerate(weights):
            if untied is not None:
                untied.put(data, rests[k])
            setup.reference.put(data, [part[k] for part in states])
            acceleration = data.qacc.copy()
            friction = dry.force(data.qvel, acceleration)
            data.ctrl[setup.controls.addresses] = controls[k]
            data.act[setup.activations.addresses] = activations[k]
            outer.apply(model, data, forces[k])
            mujoco.mj_forward(model, data)
            power = _powers(model, data, friction)
            work[step] += duration * weight * float(power.sum())
            missing = dry.missing(data.qvel, acceleration)
            unknown[step] += duration * weight * float(missing * dry.loss @ np.abs(data.qvel))
            effort += duration * weight * float(np.abs(power).sum())
            force = max(force, *(float(np.abs(part).max()) for part in (data.qfrc_bias, data.qfrc_smooth)))
    # What the friction of joints takes is known as well as that friction itself.
    books = np.maximum(0.0, np.abs(np.cumsum(before - after - work)) - np.cumsum(unknown))
    levels = np.concatenate([after, before])
    jumps = after[1:] - before[:-1]
    largest = float(jumps[np.argmax(np.abs(jumps))]) if len(jumps) else 0.0
    potential, kinetic = np.concatenate([starts, ends]).T
    least = max(_STILL * force, _STILL**2 * float(model.body_mass.sum()))
    turnover = max(effort, float(np.ptp(levels)), float(np.ptp(potential)), float(kinetic.max()), least)
    return EnergyBalance(float(np.abs(books).max()), turnover, largest)


def _powers(model: mujoco.MjModel, data: mujoco.MjData, friction: FloatArray) -> FloatArray:
    """(nv + tendons,) power of all forces except inertia and potentials, per degree of freedom and tendon, in W."""
    # MuJoCo counts gravity and springs as potentials, and compensated gravity not at all.  Where actuators
    # compensate it, it is among their forces already.
    compensated = np.where(model.jnt_actgravcomp[model.dof_jntid], 0.0, data.qfrc_gravcomp)
    force = data.qfrc_actuator + data.qfrc_applied + data.qfrc_damper + compensated + data.qfrc_fluid
    joints = (force + friction) * data.qvel
    return np.concatenate([joints, -model.tendon_frictionloss * np.abs(data.ten_velocity)])
