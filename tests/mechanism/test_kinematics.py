"""Places, axes, velocities and accelerations of frames against MuJoCo's."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from mechanism_models import TREES as MODELS
from mechanism_states import Compared


def frames(both: Compared) -> list:  # type: ignore[type-arg]
    """All bodies, sites and geoms, and what MuJoCo calls them."""
    dyn, m = both.dynamics, both.mechanism
    return [
        *[(mujoco.mjtObj.mjOBJ_XBODY, k, dyn.body(k)) for k in range(len(m.bodies))],
        *[(mujoco.mjtObj.mjOBJ_SITE, k, frame) for k, frame in enumerate(dyn.sites)],
        *[(mujoco.mjtObj.mjOBJ_GEOM, k, frame) for k, frame in enumerate(dyn.geoms)],
    ]


def numbers_of(kind: int, d: mujoco.MjData, index: int) -> tuple[np.ndarray, np.ndarray]:
    places = {
        mujoco.mjtObj.mjOBJ_XBODY: (d.xpos, d.xmat),
        mujoco.mjtObj.mjOBJ_SITE: (d.site_xpos, d.site_xmat),
        mujoco.mjtObj.mjOBJ_GEOM: (d.geom_xpos, d.geom_xmat),
    }
    place, axes = places[kind]
    return place[index], axes[index]


@pytest.mark.parametrize("name", MODELS)
def test_places_and_axes(name: str) -> None:
    """Of all bodies, sites and geoms, in the world."""
    both = Compared(MODELS[name], states=100)
    know, every = both.dynamics.kinematics, frames(both)
    found = both.values(
        [e for _, _, f in every for e in [*know.place_of(f), *[e for row in know.axes_of(f) for e in row]]]
    )
    wanted = both.in_mujoco(
        lambda m, d: np.concatenate([np.concatenate(numbers_of(kind, d, index)) for kind, index, _ in every])
    )
    assert np.abs(found - wanted).max() < 1e-12


@pytest.mark.parametrize("name", MODELS)
def test_velocities_and_accelerations(name: str) -> None:
    """Linear and angular, along the world's axes."""
    both = Compared(MODELS[name], states=100)
    know, every = both.dynamics.kinematics, frames(both)
    asked = [
        e
        for _, _, f in every
        for e in [*know.rate_of(f), *know.velocity_of(f), *know.turning_of(f), *know.acceleration_of(f)]
    ]

    def ask(m: mujoco.MjModel, d: mujoco.MjData) -> np.ndarray:
        mujoco.mj_rnePostConstraint(m, d)
        velocity, acceleration, rows = np.zeros(6), np.zeros(6), []
        for kind, index, _ in every:
            mujoco.mj_objectVelocity(m, d, kind, index, velocity, 0)
            mujoco.mj_objectAcceleration(m, d, kind, index, acceleration, 0)
            acceleration[3:] += m.opt.gravity  # MuJoCo's is what an accelerometer feels
            if m.body_weldid[_body(m, kind, index)] == 0:
                acceleration[3:] = 0.0
            rows += [*velocity, *acceleration]
        return np.array(rows)

    wanted = both.in_mujoco(ask)
    assert np.abs(both.values(asked) - wanted).max() < 1e-10 * np.abs(wanted).max()


def _body(m: mujoco.MjModel, kind: int, index: int) -> int:
    of = {mujoco.mjtObj.mjOBJ_SITE: m.site_bodyid, mujoco.mjtObj.mjOBJ_GEOM: m.geom_bodyid}
    return int(of[kind][index]) if kind in of else index


def test_a_point_of_a_body() -> None:
    """A point by its place in the body is where the body's frame says."""
    both = Compared(MODELS["on a free body"], states=20)
    body = len(both.mechanism.bodies) - 1
    point = both.dynamics.point(body, (0.3, -0.2, 0.1))
    wanted = both.in_mujoco(lambda m, d: d.xpos[body] + d.xmat[body].reshape(3, 3) @ (0.3, -0.2, 0.1))
    assert np.abs(both.values(both.dynamics.kinematics.place_of(point)) - wanted).max() < 1e-12


def test_the_velocity_of_a_free_body_is_its_coordinates() -> None:
    """What is known of a free body's origin is not turned forth and back."""
    both = Compared(MODELS["on a free body"], states=1)
    dyn = both.dynamics
    assert dyn.kinematics.velocity_of(dyn.body(1)) == tuple(dyn.motion.v[:3])
    assert dyn.kinematics.acceleration_of(dyn.body(1)) == tuple(dyn.motion.a[:3])
