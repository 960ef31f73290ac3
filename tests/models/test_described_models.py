"""The described models as MuJoCo reads them: what weighs, what moves, what touches, what drives."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np
import pytest

from stc import models
from stc.models import build, luxo

MODELS = ["luxo.xml", "luxo_fixed.xml", "luxo_step.xml", "luxo_hurdle.xml", "arm.xml", "cart_pole.xml"]

ROBOTS = [
    "arm7.xml", "cat.xml", "gymnast.xml", "humanoid.xml", "luxo3d.xml", "quadruped.xml", "quadruped_box.xml",
]  # fmt: skip
"""Models with limits of their own, for specs that name them under `model:`."""


def load(name: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(models.locate(name)))


def measures(name: str) -> Mapping[str, float]:
    (found,) = (d for d in build.descriptions() if d.name == name)
    return {key: measure.value for key, measure in found.measures.items()}


def test_every_described_model_is_tested() -> None:
    assert sorted(name for d in build.descriptions() for name in d.documents) == sorted(MODELS + ROBOTS)


@pytest.mark.parametrize("name", ROBOTS)
def test_robots_have_a_limited_motor_at_every_hinge_but_the_roots(name: str) -> None:
    model = load(name)
    driven = {int(model.actuator_trnid[k, 0]) for k in range(model.nu)}
    undriven = {model.joint(k).name for k in range(model.njnt)} - {model.joint(k).name for k in driven}
    assert undriven <= {"root", "x", "z", "pitch"}
    assert model.actuator_ctrllimited.all()
    assert all(model.jnt_limited[k] for k in driven)


@pytest.mark.parametrize("name", [name for name in ROBOTS if name not in ("arm7.xml", "cat.xml")])
def test_who_stands_touches_the_floor_with_the_feet_and_nothing_else(name: str) -> None:
    model = load(name)
    model.geom_margin[:] = 1e-6  # a height of 1e-17 m still counts as touching
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("stand").id)
    mujoco.mj_forward(model, data)
    floor = model.geom("floor").id
    pairs = [set(contact.geom.tolist()) for contact in data.contact]
    assert pairs
    assert all(floor in pair for pair in pairs)
    assert max(abs(contact.dist) for contact in data.contact) < 1e-9
    feet = {k for k in range(model.ngeom) if model.geom_contype[k]} - {floor}
    assert set().union(*pairs) == feet | {floor}


def test_the_seven_joint_arm_holds_its_ball_on_either_side_of_the_post() -> None:
    model = load("arm7.xml")
    data = mujoco.MjData(model)
    post, found = model.geom("post"), []
    for key in ("left", "right"):
        mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
        mujoco.mj_forward(model, data)
        found.append(data.geom("ball").xpos.copy())
        assert np.hypot(*(found[-1] - post.pos)[:2]) > 2 * (post.size[0] + model.geom("ball").size[0])
    assert found[0][1] == pytest.approx(-found[1][1])
    assert found[0][1] > 0.2


def test_the_gymnast_holds_the_bar_in_the_handstand_and_hanging() -> None:
    model = load("gymnast.xml")
    data = mujoco.MjData(model)
    for key in ("hang", "handstand"):
        mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
        mujoco.mj_forward(model, data)
        assert data.site("grip").xpos == pytest.approx(data.geom("bar").xpos, abs=1e-12)


@pytest.mark.parametrize("name", MODELS)
def test_motors_are_the_only_actuators_and_push_with_their_control(name: str) -> None:
    model = load(name)
    assert model.nu > 0
    data = mujoco.MjData(model)
    for index in range(model.nu):
        data.ctrl[:] = 0.0
        data.ctrl[index] = 1234.5
        mujoco.mj_forward(model, data)
        expected = np.zeros(model.nv)
        expected[model.jnt_dofadr[model.actuator_trnid[index, 0]]] = 1234.5
        np.testing.assert_array_equal(data.qfrc_actuator, expected)
    assert model.na == 0


@pytest.mark.parametrize("name", MODELS)
def test_nothing_but_weight_and_motors_acts(name: str) -> None:
    model = load(name)
    for passive in (model.jnt_stiffness, model.dof_damping, model.dof_frictionloss, model.dof_armature):
        assert not np.any(passive)
    assert not np.any(model.jnt_limited)
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4


@pytest.mark.parametrize("name", MODELS)
def test_only_sole_and_floor_touch(name: str) -> None:
    model = load(name)
    touching = {
        model.geom(k).name for k in range(model.ngeom) if model.geom_contype[k] or model.geom_conaffinity[k]
    }
    expected = {"floor", "foot"} if name.startswith("luxo") else set()
    assert touching == (expected | {"step"} if name == "luxo_step.xml" else expected)


def test_the_lamp_weighs_what_its_design_says() -> None:
    model = load("luxo.xml")
    bodies = ["base", "lower_arm", "upper_arm", "head"]
    assert [model.body(b).mass[0] for b in bodies] == [1.0, 0.25, 0.25, 0.6]
    assert [model.body(b).inertia[1] for b in bodies] == [
        0.0034083333333333344,
        0.0016422756891745437,
        0.0016422756891745437,
        0.0016516092001062825,
    ]
    assert [model.body(b).ipos[2] for b in bodies] == [0.015, 0.14, 0.14, 0.07155771905424202]


def test_the_lamp_stands_with_its_weight_above_the_middle_of_the_sole() -> None:
    model, lamp = load("luxo_fixed.xml"), measures("luxo")
    data = mujoco.MjData(model)
    data.qpos[:] = [lamp["A1"], lamp["A2"], lamp["A3"]]
    mujoco.mj_forward(model, data)
    assert data.subtree_com[0, 0] == pytest.approx(0.0, abs=1e-15)
    assert data.site("mouth").xpos[2] > 0.3


def test_the_lamp_rests_on_the_floor_with_its_sole() -> None:
    model = load("luxo.xml")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon > 0
    for contact in data.contact:
        assert abs(contact.dist) < 1e-12
        assert abs(abs(contact.pos[0]) - luxo.BASE[0] / 2) < 1e-12
    assert data.site("toe").xpos[0] - data.site("heel").xpos[0] == pytest.approx(luxo.BASE[0])


def test_what_is_seen_of_the_lamp_keeps_to_what_weighs() -> None:
    shapes = luxo.shapes()
    sole = shapes["luxo_base"].bounds
    np.testing.assert_allclose(sole[1] - sole[0], luxo.BASE, atol=1e-9)
    shade, socket = shapes["luxo_shade"].bounds, shapes["luxo_socket"].bounds
    assert shade[1, 2] == pytest.approx(luxo.HEAD[3][1])
    assert shade[1, 0] == pytest.approx(luxo.HEAD[3][0], abs=2e-3)
    assert socket[0, 2] == pytest.approx(luxo.HEAD[0][1])


def test_the_lamps_parts_pass_inside_one_another() -> None:
    # Half widths along y at the joints, from the inside out: hip's drum, lower fork, upper fork, head's socket.
    shapes = luxo.shapes()
    eye = 0.005
    assert shapes["luxo_hip"].bounds[1, 1] < luxo.LOWER_GAP - eye + 1e-9
    assert luxo.LOWER_GAP + eye < luxo.UPPER_GAP - eye
    assert shapes["luxo_socket"].section([0, 0, 1], [0, 0, 0]).bounds[1, 1] < luxo.UPPER_GAP - eye


def test_the_arm_is_shorter_than_its_shoulder_is_high() -> None:
    arm, model = measures("arm"), load("arm.xml")
    assert arm["l1"] + arm["l2"] < model.body("upper_arm").pos[2]
    data = mujoco.MjData(model)
    data.qpos[:] = [0.7, 0.4]
    mujoco.mj_forward(model, data)
    reach = data.site("hand").xpos - data.body("upper_arm").xpos
    expected = arm["l1"] * np.array([np.cos(0.7), np.sin(0.7)]) + arm["l2"] * np.array(
        [np.cos(1.1), np.sin(1.1)]
    )
    np.testing.assert_allclose(reach[[0, 2]], expected, atol=1e-15)


def test_the_pole_hangs_at_zero_and_turns_towards_x() -> None:
    model = load("cart_pole.xml")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hanging = data.site("bob").xpos.copy()
    data.qpos[1] = 0.3
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(hanging - data.body("cart").xpos, [0, 0, -0.5], atol=1e-15)
    np.testing.assert_allclose(
        data.site("bob").xpos - hanging, 0.5 * np.array([np.sin(0.3), 0, 1 - np.cos(0.3)]), atol=1e-15
    )
