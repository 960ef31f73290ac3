"""Centres of mass, momenta and energies against MuJoCo's, and forces on bodies against its Jacobians."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from mechanism_models import TERMS, TREES
from mechanism_states import Compared, relative_error

from stc.mechanism.forces import Wrench
from stc.symbolic.expr import num, symbols

WITH_SPRINGS = (
    "positions that the file does not draw at zero", "springs of ball and free joints", "polynomial stiffness",
    "polynomial stiffness of a free joint", "a fixed tendon", "a tendon that is slack in a range", "a tendon in space",
    "drives with damping and armature", "damping and armature of all joints", "no gravity, springs",
)  # fmt: skip
MODELS = TREES | {
    "bodies that nothing moves": TREES["on the world"].replace(
        "<worldbody>", '<worldbody><body pos="1 2 3"><geom size=".2"/></body>', 1
    )
}


@pytest.mark.parametrize("name", MODELS)
def test_sums_over_subtrees(name: str) -> None:
    """Centre of mass, its velocity, and angular momentum about it, of every body and what hangs on it."""
    both = Compared(MODELS[name], states=100)
    dyn, m = both.dynamics, both.model
    bodies = [k for k in range(m.nbody) if m.body_subtreemass[k] > 0]
    asked = [
        e
        for k in bodies
        for e in [*dyn.centre_of_mass(k), *dyn.centre_velocity(k), *dyn.angular_momentum(k), *dyn.momentum(k)]
    ]

    def ask(m: mujoco.MjModel, d: mujoco.MjData) -> np.ndarray:
        mujoco.mj_subtreeVel(m, d)
        return np.concatenate(
            [
                np.concatenate(
                    [
                        d.subtree_com[k],
                        d.subtree_linvel[k],
                        d.subtree_angmom[k],
                        m.body_subtreemass[k] * d.subtree_linvel[k],
                    ]
                )
                for k in bodies
            ]
        )

    wanted = both.in_mujoco(ask)
    assert np.abs(both.values(asked) - wanted).max() < 1e-11 * np.abs(wanted).max()
    masses = both.values([dyn.mass(k) for k in bodies])[:, 0]
    assert masses == pytest.approx(m.body_subtreemass[bodies], rel=1e-12)


def test_angular_momentum_does_not_depend_on_where_a_free_body_is() -> None:
    """Nor on how fast its origin moves: neither is in the expression."""
    both = Compared(MODELS["on a free body"], states=1)
    known = {key for e in both.dynamics.angular_momentum() for key in symbols(e)}
    assert not known & {"q0", "q1", "q2", "v0", "v1", "v2"}
    assert {"q3", "v3"} <= known


def test_nothing_with_mass_has_no_centre() -> None:
    """Asking for it is a mistake, not a division by 0."""
    both = Compared('<mujoco><worldbody><body name="b"/></worldbody></mujoco>', states=1)
    with pytest.raises(ValueError, match="without mass"):
        both.dynamics.centre_of_mass(1)


@pytest.mark.parametrize("name", WITH_SPRINGS)
def test_energies(name: str) -> None:
    """Kinetic energy with that of drives, potential energy with that of springs."""
    both = Compared(TERMS[name], states=200)

    def ask(m: mujoco.MjModel, d: mujoco.MjData) -> np.ndarray:
        mujoco.mj_energyPos(m, d)
        mujoco.mj_energyVel(m, d)
        return d.energy.copy()

    found = both.values([both.dynamics.potential_energy(), both.dynamics.kinetic_energy()])
    wanted = both.in_mujoco(ask)
    assert relative_error(found[:1], wanted[:1]) < 1e-9
    assert relative_error(found[1:], wanted[1:]) < 1e-10


@pytest.mark.parametrize("name", ["on a free body", "on the world", "two free bodies"])
def test_forces_on_bodies(name: str) -> None:
    """A wrench on a body takes J^T f off the forces that the motion needs."""
    both = Compared(MODELS[name], states=50)
    dyn, body = both.dynamics, len(both.mechanism.bodies) - 1
    force, torque, at = np.array([1.0, -2.0, 3.0]), np.array([0.5, 0.25, -1.0]), np.array([0.3, 0.1, -0.2])
    as_vector = lambda v: tuple(num(entry) for entry in v)
    wrench = Wrench(dyn.point(body, at), as_vector(force), as_vector(torque))
    found = both.values([a - b for a, b in zip(dyn.inverse(), dyn.inverse([wrench]), strict=True)])

    def ask(m: mujoco.MjModel, d: mujoco.MjData) -> np.ndarray:
        applied = np.zeros(m.nv)
        place = d.xpos[body] + d.xmat[body].reshape(3, 3) @ at
        mujoco.mj_applyFT(m, d, force, torque, place, body, applied)
        return applied

    assert np.abs(found - both.in_mujoco(ask)).max() < 1e-10
