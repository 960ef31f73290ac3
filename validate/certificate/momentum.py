"""Flight: while nothing touches the ground, only gravity changes a body's momentum.

Along the solved motion MuJoCo gives linear momentum and angular momentum about the centre of mass.  In flight the first
follows its ballistic line and the second stays what it is, whatever the motors do: a wrong mass, or a torque from
nowhere, shows here without any simulation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.records import dataclass
from stc.validate import limits
from stc.validate.metrics import Metric
from stc.validate.setup import Setup

if TYPE_CHECKING:
    import mujoco

#: Contact forces below this share of their largest count as none.
_NOTHING = 1e-9


@dataclass(frozen=True, slots=True)
class Flight:
    """A stretch without ground forces.

    Attributes:
        first: its first frame.
        last: its last frame.
        linear: largest departure of the momentum from its ballistic line, as a share of the largest momentum.
        angular: largest change of the angular momentum about the centre of mass, as a share of the largest angular
            momentum of a single part of the body about it.
    """

    first: int
    last: int
    linear: float
    angular: float


def flights(setup: Setup) -> list[Flight]:
    """All flights of a motion with ``contact`` lines; none where other outer forces act or joints are not tied."""
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
    times, linear, angular, parts = [], [], [], 0.0
    shares = np.array([0.0, *limits.BETWEEN_SHARES, 1.0])
    for step in range(first, last):
        position, velocity = setup.reference.in_step(step, shares)[:2]
        start, end = setup.solution.time[step : step + 2]
        for k, share in enumerate(shares):
            setup.reference.put(data, [position[k], velocity[k]])
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            mujoco.mj_subtreeVel(model, data)
            times.append(start + share * (end - start))
            linear.append(mass * data.subtree_linvel[0])
            angular.append(data.subtree_angmom[0].copy())
            parts = max(parts, _largest_part(model, data))
    elapsed = (np.array(times) - times[0])[:, None]
    momentum, spin = np.array(linear), np.array(angular)
    ballistic = momentum[0] + mass * np.array(model.opt.gravity) * elapsed
    return Flight(
        first,
        last,
        _share(np.abs(momentum - ballistic).max(), np.abs(momentum).max()),
        _share(np.abs(spin - spin[0]).max(), parts),
    )


def _movable(model: mujoco.MjModel) -> mujoco.MjModel:
    """The model with no mass in what is fixed to the world, which neither falls nor has a part in the flight."""
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
        orbit = np.cross(arm, model.body_mass[body] * (both[3:] - data.subtree_linvel[0]))
        largest = max(largest, float(np.abs(own + orbit).max()))
    return largest


def _share(value: float, scale: float) -> float:
    return float(value / scale) if scale > 0.0 else float(value)


def momentum_metrics(setup: Setup) -> list[Metric]:
    """The metrics of all flights."""
    found = []
    for flight in flights(setup):
        where = f"flight, frames {flight.first} to {flight.last}"
        limit = limits.FLIGHT[setup.solution.method]
        found.append(
            Metric("momentum in flight, against the ballistic line", where, flight.linear, "share", limit)
        )
        found.append(Metric("angular momentum in flight, change", where, flight.angular, "share", limit))
    return found
