"""Dry friction of joints against MuJoCo's inverse dynamics and against Coulomb's law."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from stc.validate.dry_friction import DryFriction
from stc.validate.equalities import Equalities

ARM = """<mujoco><option timestep="{timestep}"/><worldbody><body><joint name="hip" axis="0 1 0" frictionloss="0.3"
  solreffriction="{solref}" solimpfriction="0.8 0.97 0.001 0.5 2"/>
  <geom type="capsule" fromto="0 0 0 0 0 -1" size=".1"/>
  <body pos="0 0 -1"><joint name="knee" axis="0 1 0" armature="0.1" frictionloss="0.1"/>
  <geom type="capsule" fromto="0 0 0 0 0 -1" size=".05"/></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize(("timestep", "solref"), [(0.002, "0.02 1"), (0.02, "0.02 1"), (0.002, "-100 -40")])
def test_friction_is_that_of_mujoco(timestep: float, solref: str) -> None:
    model = mujoco.MjModel.from_xml_string(ARM.format(timestep=timestep, solref=solref))
    data, rng = mujoco.MjData(model), np.random.default_rng(3)
    dry = DryFriction(model)
    loose = 0
    for _ in range(100):
        data.qpos[:], data.qvel[:] = rng.normal(size=2), rng.normal(size=2, scale=3e-5)
        data.qacc[:] = rng.normal(size=2, scale=5e-3)
        mujoco.mj_inverse(model, data)
        assert dry.force(data.qvel, data.qacc) == pytest.approx(data.qfrc_constraint, abs=1e-12)
        loose += int((np.abs(data.qfrc_constraint) < model.dof_frictionloss - 1e-6).sum())
        assert np.abs(dry.without(data.qfrc_constraint.copy(), data.qvel, data.qacc)).max() < 1e-12
    assert 10 < loose < 190


def test_what_is_no_friction_is_left() -> None:
    dry = DryFriction(mujoco.MjModel.from_xml_string(ARM.format(timestep=0.002, solref="0.02 1")))
    steady, still, none = np.array([1.0, -1.0]), np.zeros(2), np.zeros(2)
    coulomb = np.array([-0.3, 0.1])
    assert not dry.without(coulomb, steady, none).any()
    assert dry.without(np.zeros(2), steady, none) == pytest.approx(-coulomb, rel=1e-6)
    assert dry.without(-coulomb, steady, none) == pytest.approx(-2.0 * coulomb, rel=1e-6)
    assert not dry.without(-coulomb, still, none).any()
    assert dry.without(2.0 * coulomb, still, none) == pytest.approx(coulomb)


def test_rounded_corners_are_friction_but_not_much_less_than_the_bound() -> None:
    dry = DryFriction(mujoco.MjModel.from_xml_string(ARM.format(timestep=0.002, solref="0.02 1")))
    still = np.zeros(2)
    for pull in (0.1, 0.9, 1.1, 2.1, 5.0, 30.0):  # of what it takes to have the bound
        velocity = pull * dry.bound / dry.damping
        corners = [np.sqrt((pull + side) ** 2 + 0.09) for side in (1.0, -1.0)]
        force = -dry.loss * (corners[0] - corners[1]) / 2.0
        assert not dry.without(force, velocity, still).any()
        if pull > 2.0:
            assert dry.without(0.97 * force, velocity, still).all()


def test_friction_of_joints_that_an_equality_couples_is_seen_through_it() -> None:
    """Two sliders move alike: of a force between them nothing is left, of a friction on one a half on each."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint name="a" type="slide" frictionloss="0.3"/><geom size=".1" mass="1"/></body>
        <body><joint name="b" type="slide"/><geom size=".1" mass="1"/></body></worldbody>
        <equality><joint joint1="a" joint2="b"/></equality></mujoco>"""
    )
    dry, ties, at = DryFriction(model), Equalities(model), np.zeros(2)
    moving, steady = np.array([1.0, 1.0]), np.zeros(2)
    passed = ties.without(at, np.eye(2))
    left = dry.without(ties.without(at, np.array([-0.3 + 7.0, -7.0])), moving, steady, passed)
    assert left == pytest.approx(0.0, abs=1e-12)
    left = dry.without(ties.without(at, np.array([-0.4, 0.0])), moving, steady, passed)
    assert left == pytest.approx(-0.05)
