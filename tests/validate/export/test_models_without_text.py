"""Keyframes of models of which there is no text: URDFs, and models with parts that are added, repeated or attached."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import stc
from stc.cli.main import run
from stc.validate.verdict import open_setup

THIRD = 1.0 / 3.0
URDF = f"""<robot name="arm"><link name="base"/><joint name="elbow" type="revolute"><parent link="base"/>
  <child link="arm"/><origin xyz="{THIRD} 0 1" rpy="{THIRD} .2 .3"/><axis xyz="0 1 {THIRD}"/>
  <limit lower="-{THIRD}" upper="2" effort="{20 + THIRD}" velocity="3"/><dynamics damping="{THIRD}"/></joint>
  <joint name="wrist" type="revolute"><parent link="arm"/><child link="hand"/><mimic joint="elbow"
  multiplier="{THIRD}"/>
  <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="3"/></joint>
  <link name="arm"><inertial><origin xyz="0 0 -{THIRD}" rpy="{THIRD} 0 0"/><mass value="{1 + THIRD}"/>
  <inertia ixx="{THIRD}" iyy=".4" izz=".3" ixy=".01" ixz="0" iyz="0"/></inertial></link>
  <link name="hand"><inertial><mass value=".1"/><inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0"
  iyz="0"/></inertial>
  <collision><origin xyz="0 0 -{THIRD}"/><geometry><sphere radius=".03"/></geometry></collision></link></robot>"""
MJCF = f"""<mujoco><compiler angle="degree"/><default><joint damping=".1234567891"/></default><worldbody>
  <body name="leg" pos="0 0 {1 + THIRD}"><joint axis="0 1 {THIRD}" range="-100 {100 * THIRD}"/>
    <geom type="capsule" fromto="0 0 0 0 0 {THIRD}" size=".05"/>
    <body pos="0 0 {THIRD}"><joint name="s" type="slide" ref=".1234567891"/><geom size=".01234567891"/></body></body>
  </worldbody><tendon><fixed name="t" stiffness="1.23456789"><joint joint="s"
  coef="{THIRD}"/></fixed></tendon></mujoco>"""
REPEATED = f"""<mujoco><asset><model name="hand" file="hand.xml"/>
  <mesh name="wedge" vertex="0 0 0 .2 0 0 0 .3 0 0 0 .4"/></asset><worldbody><replicate count="2" offset="{THIRD} 0 0"
  euler="0 0 {100 * THIRD}"><body name="arm"><joint name="j" axis="0 1 0"/><geom size=".1" pos="0 0 -{THIRD}"/>
  </body></replicate><frame pos="0 0 {THIRD}" euler="{100 * THIRD} 0 0"><geom type="mesh" mesh="wedge" contype="0"
  conaffinity="0"/><site name="mark"/><camera name="eye" pos="{THIRD} 0 0"/><light pos="1 0 0"/></frame>
  <attach model="hand" prefix="L"/></worldbody><actuator><motor joint="j0"/><motor joint="j1"/></actuator></mujoco>"""
HAND = f"""<mujoco><worldbody><body name="hand" pos="0 1 0"><joint name="finger" pos="0 0 {THIRD}"/><geom size=".1"/>
  </body></worldbody></mujoco>"""
FIELDS = (
    "body_mass", "body_inertia", "body_iquat", "body_quat", "jnt_axis", "jnt_range", "dof_damping", "geom_pos",
    "geom_quat", "site_pos", "site_quat", "cam_pos", "cam_quat", "light_pos", "light_dir", "geom_size", "qpos0",
    "actuator_ctrlrange", "wrap_prm", "tendon_stiffness",
)  # fmt: skip


@pytest.mark.parametrize(
    ("file", "content", "words", "joint", "body"),
    [
        ("arm.urdf", URDF, " with motors, floor", "elbow", "arm"),
        ("leg.xml", MJCF, " with motors, floor", "leg", "leg"),
        ("arms.xml", REPEATED, "", "j0", "arm0"),
    ],
)
def test_keyframes_have_the_whole_model(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    file: str,
    content: str,
    words: str,
    joint: str,
    body: str,
) -> None:
    """With the added motors and floor, and with all digits; a mass that the spec sets is in it."""
    monkeypatch.chdir(tmp_path)
    Path(file).write_text(content, encoding="utf-8")
    Path("hand.xml").write_text(HAND, encoding="utf-8")
    Path("move.stc").write_text(
        f"""constants: n = 6, T = 1, h = T/n, body.{body}.mass = 2.3456789012345;
        model: "{file}"{words};
        constraints: [0]: joint.{joint}; rest; [n]: joint.{joint} = .3; rest;
        objective: [0, n]: integral(effort);"""
    )
    solution = stc.load("move.stc").solve()
    solution.save("move.npz")
    assert run(["export", "move.npz", "--format", "keyframes", "-o", "keys.xml"]) == 0
    found = mujoco.MjModel.from_xml_path("keys.xml")
    wanted = open_setup(solution).compiled
    for field in FIELDS:
        assert np.allclose(getattr(found, field), getattr(wanted, field), rtol=1e-12, atol=1e-14), field
    assert np.array_equal(found.eq_data[:, :5], wanted.eq_data[:, :5])
    assert found.body(body).mass == pytest.approx(2.3456789012345, rel=1e-12)
    assert ("floor" in words) == any(found.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
    assert np.allclose(
        found.key_qpos[:, found.joint(joint).qposadr[0]], solution[f"joint.{joint}"], atol=1e-12
    )
    assert np.allclose(found.key_ctrl[0, 0], solution[f"actuator.{joint}"][0], atol=1e-12)
