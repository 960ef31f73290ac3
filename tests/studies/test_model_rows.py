"""Equations that a spec has of its model, against MuJoCo: right ones agree, planted faults are named."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc.errors import Source
from stc.language.elaborate import elaborate
from stc.language.parser import parse
from stc.studies.equation_report import EquationReport
from stc.studies.equations import check_equations

ROBOT = """<mujoco><compiler autolimits="true"/><worldbody><body name="trunk"><freejoint name="root"/>
  <geom type="box" size=".1 .2 .3" mass="2"/><site name="foot" pos="0 0 -.3"/>
  <body name="arm" pos="0 0 .4"><joint name="hip" type="ball" damping=".05" armature=".01"/>
    <geom type="capsule" fromto="0 0 0 .1 0 .4" size=".03" mass="1"/>
    <body name="hand" pos=".1 0 .4"><joint name="wrist" axis="0 1 0" pos="0 0 .02" stiffness="2" frictionloss=".1"/>
      <geom type="capsule" fromto="0 0 0 0 0 .2" size=".02" mass=".3"/></body></body></body></worldbody>
  <actuator><motor name="hx" joint="hip" gear="1 0 0"/><position name="w" joint="wrist" kp="3" kv=".2"/>
  <general name="slow" joint="wrist" dyntype="filter" dynprm=".1" gainprm="2"/></actuator></mujoco>"""
SPEC = """constants: n = 10, T = 1, h = T/n;
model: "robot.xml";
contact: F = point(site.foot);
constraints: [0]: keyframe.reference; rest;
"""


def compared(folder: Path, spec: str = SPEC, model: str = ROBOT) -> EquationReport:
    """A spec of the robot against a model that may be another one."""
    (folder / "robot.xml").write_text(ROBOT, encoding="utf-8")
    (folder / "other.xml").write_text(model, encoding="utf-8")
    problem = elaborate(parse(Source("motion.stc", spec, str(folder / "motion.stc"))))
    return check_equations(problem, str(folder / "other.xml"), states=50)


def test_all_joints_agree(tmp_path: Path) -> None:
    report = compared(tmp_path)
    assert report.passed
    assert not report.findings
    subjects = {m.subject.split(",")[0] for m in report.metrics}
    assert {"joint root.x", "joint root.wz", "joint hip.wy", "joint wrist"} <= subjects
    assert max(m.value for m in report.metrics) < 1e-11


FAULTS = {
    "a swapped axis": ('axis="0 1 0"', 'axis="1 0 0"', "joint wrist"),
    "a joint elsewhere": ('pos="0 0 .02"', 'pos="0 0 .05"', "joint wrist"),
    "a servo's gain": ('kp="3"', 'kp="4"', "joint wrist: static force"),
    "a motor in other axes": ('joint="hip" gear', 'jointinparent="hip" gear', "force of actuator.hx"),
    "another gain of a slow actuator": (
        'gainprm="2"',
        'gainprm="-2"',
        "joint wrist: force of actuator.slow.activation",
    ),
    "a foot elsewhere": ('pos="0 0 -.3"', 'pos="0 .1 -.3"', "force of F_f"),
    "an arm elsewhere": ('name="arm" pos="0 0 .4"', 'name="arm" pos="0 .1 .4"', "mass matrix entry"),
}


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_named(tmp_path: Path, fault: str) -> None:
    right, wrong, words = FAULTS[fault]
    assert right in ROBOT
    report = compared(tmp_path, model=ROBOT.replace(right, wrong))
    assert not report.passed
    assert any(words in finding for finding in report.findings[:4])


def test_a_force_that_the_model_does_not_have_is_named(tmp_path: Path) -> None:
    report = compared(tmp_path, f"{SPEC}forces: joint.hip.wz: -0.3*joint.hip.wz;")
    assert not report.passed
    assert report.findings[0].startswith("joint hip.wz: damping by hip.wz'")


def test_a_model_with_other_joints_is_refused(tmp_path: Path) -> None:
    with pytest.raises(stc.errors.StcError, match="has no joint wrist"):
        compared(tmp_path, model=ROBOT.replace('"wrist"', '"waist"'))
