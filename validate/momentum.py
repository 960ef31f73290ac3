"""Flight: while nothing touches the ground, only gravity changes a body's momentum.

Along the solved motion MuJoCo computes the linear momentum and the angular momentum about the centre of mass.  In
flight the first follows its ballistic line and the second is constant, whatever the motors do: a wrong mass, or a
spurious torque, shows without any simulation.

This holds along and about the axes in which the whole model moves freely.  Joints that guide it in other directions
exert forces too, as do jets, motors, springs and dampers between it and the world.  Such forces are found by virtual
power: in a rigid motion of the whole model, internal forces have none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate import limits
from stc.validate.metrics import FloatArray, Metric
from stc.validate.setup import Setup

if TYPE_CHECKING:
    import mujoco

#: Contact forces below this share of their largest count as none, and so do powers of internal forces.
_NOTHING = 1e-9

#: Momentum is compared with no less than this share of what it could be if all parts moved and turned the same way:
#: a share of rounding says nothing.
_STILL = 1e-3

#: Where in a step it is asked what pushes: twice, as a force may be nothing at one place of the step.
_PUSHES_AT = (0.0, 0.625)


@dataclass(frozen=True, slots=True)
class Flight:
    """A stretch without ground forces.

    Attributes:
        first: its first frame.
        last: its last frame.
        linear: largest departure of the momentum from its ballistic line, as a share of the largest momentum; None
            if forces act along every axis.
        angular: largest change of the angular momentum about the centre of mass, as a share of the largest angular
            momentum of a single part of the body about it; None if torques act about every axis.
    """

    first: int
    last: int
    linear: float | None
    angular: float | None


def flights(setup: Setup) -> list[Flight]:
    """All flights of a motion with ``contact`` lines; none if other external forces act or joints are not tied."""
    if not len(setup.contact) or len(setup.applied) or not setup.all_tied:
        return []
    shares = np.array(limits.BETWEEN_SHARES)
    forces = np.array([np.abs(setup.contact.in_step(k, shares)).max() for k in range(setup.solution.n)])
    free = forces <= _NOTHING * float(forces.max(initial=0.0))
    if not free.any() or free.all():
        return []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], free, [False]]).astype(int)))
    return [_flight(setup, int(first), int(last)) for first, last in edges.reshape(-1, 2)]


def _flight(setup: Setup, first: int, last: int) -> Flight:
    import mujoco

    model = _movable(setup.model(contacts=False))
    data = mujoco.MjData(model)
    mass = float(model.body_mass.sum())
    times, linear, angular, parts, could = [], [], [], 0.0, np.zeros(2)
    free = np.ones(6, dtype=bool)
    shares = np.array([0.0, *limits.BETWEEN_SHARES, 1.0])
    for step in range(first, last):
        position, velocity = setup.reference.in_step(step, shares)[:2]
        controls = setup.controls.in_step(step, shares)
        start, end = setup.solution.time[step : step + 2]
        for k, share in enumerate(shares):
            setup.reference.put(data, [position[k], velocity[k]])
            data.ctrl[setup.controls.addresses] = controls[k]
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            mujoco.mj_fwdActuation(model, data)
            mujoco.mj_subtreeVel(model, data)
            times.append(start + share * (end - start))
            linear.append(mass * data.subtree_linvel[0])
            angular.append(data.subtree_angmom[0].copy())
            parts = max(parts, _largest_part(model, data))
            could = np.maximum(could, _at_most(model, data))
            if share in _PUSHES_AT:
                free &= _free(model, data)
    elapsed = (np.array(times) - times[0])[:, None]
    momentum, spin = np.array(linear), np.array(angular)
    away = np.abs(momentum - momentum[0] - mass * np.array(model.opt.gravity) * elapsed)[:, free[:3]]
    change = np.abs(spin - spin[0])[:, free[3:]]
    return Flight(
        first,
        last,
        _share(away.max(), max(np.abs(momentum).max(), _STILL * could[0])) if away.size else None,
        _share(change.max(), max(parts, _STILL * could[1])) if change.size else None,
    )


def _free(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """(6,) the world's axes along and about which the model moves as one rigid body without external forces."""
    import mujoco

    moved = np.flatnonzero(model.body_mass > 0.0)
    jacobians = np.zeros((len(moved), 6, model.nv))
    wanted = np.zeros((len(moved), 6, 6))
    for row, body in enumerate(moved):
        mujoco.mj_jacBodyCom(model, data, jacobians[row, :3], jacobians[row, 3:], body)
        wanted[row] = np.eye(6)
        # A turn about the common centre of mass moves this body's own.
        wanted[row, :3, 3:] = -_cross(data.xipos[body] - data.subtree_com[0])
    jacobian, rigid = jacobians.reshape(-1, model.nv), wanted.reshape(-1, 6)
    speeds = np.linalg.lstsq(jacobian, rigid, rcond=None)[0]
    possible = np.abs(jacobian @ speeds - rigid).max(axis=0) < 1e-9 * max(1.0, float(np.abs(rigid).max()))
    force = data.qfrc_actuator + data.qfrc_passive
    power, largest = np.abs(force @ speeds), np.abs(force) @ np.abs(speeds)
    total = float(np.abs(force).max(initial=0.0))
    return np.asarray(possible & (power <= _NOTHING * np.maximum(largest, total)))


def _at_most(model: mujoco.MjModel, data: mujoco.MjData) -> FloatArray:
    """(2,) the momentum and the angular momentum about the centre of mass if the speeds of all parts had the same
    direction.
    """
    import mujoco

    found, both = np.zeros(2), np.zeros(6)
    for body in range(1, model.nbody):
        mass = float(model.body_mass[body])
        if mass == 0.0:
            continue
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, both, 0)
        speed, turn = np.linalg.norm(both[3:]), np.linalg.norm(both[:3])
        largest = float(model.body_inertia[body].max())
        reach = np.linalg.norm(data.xipos[body] - data.subtree_com[0]) + np.sqrt(largest / mass)
        found += [mass * speed, mass * speed * reach + largest * turn]
    return found


def _movable(model: mujoco.MjModel) -> mujoco.MjModel:
    """The model without the mass of parts that are fixed to the world."""
    import mujoco

    fixed = model.body_weldid == 0
    if model.body_mass[fixed].any():
        model.body_mass[fixed] = 0.0
        model.body_inertia[fixed] = 0.0
        mujoco.mj_setConst(model, mujoco.MjData(model))
    return model


def _largest_part(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """The largest angular momentum of one body about the common centre of mass, in kg m^2/s."""
    import mujoco

    largest = 0.0
    both = np.zeros(6)
    for body in range(1, model.nbody):
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, both, 0)
        turn = data.ximat[body].reshape(3, 3)
        own = turn @ (model.body_inertia[body] * (turn.T @ both[:3]))
        arm = data.xipos[body] - data.subtree_com[0]
        orbit = _cross(arm) @ (model.body_mass[body] * (both[3:] - data.subtree_linvel[0]))
        largest = max(largest, float(np.abs(own + orbit).max()))
    return largest


def _cross(left: FloatArray) -> FloatArray:
    """(3, 3) the matrix that multiplies a vector by this one, which stands on the left."""
    x, y, z = left
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _share(value: float, scale: float) -> float:
    return float(value / scale) if scale > 0.0 else float(value)


def momentum_metrics(setup: Setup) -> list[Metric]:
    """The metrics of all flights; without a momentum that external forces change along every axis."""
    found = []
    for flight in flights(setup):
        where = f"flight, frames {flight.first} to {flight.last}"
        limit = limits.FLIGHT[setup.solution.method]
        for name, share in (
            ("momentum in flight, against the ballistic line", flight.linear),
            ("angular momentum in flight, change", flight.angular),
        ):
            if share is not None:
                found.append(Metric(name, where, share, "share", limit))
    return found
