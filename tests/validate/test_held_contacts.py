"""Linearised motion on the ground: contacts that press hold, against closed forms; hands that grip for a while."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stc
from stc.certification import certify
from stc.validate import Report, validate
from stc.validate.contact import contact_metrics
from stc.validate.linearisation import growth, linearise
from stc.validate.replay import replay
from stc.validate.setup import Setup
from stc.validate.tracking import regulator
from stc.validate.verdict import open_setup

MASS, HEIGHT, RADIUS, INERTIA, GRAVITY = 2.0, 0.5, 0.05, 0.03, 9.81

#: A rod that stands on a ball, its centre of mass so high above the ball's middle.
ROD_MODEL = f"""<mujoco><option timestep="2e-4" gravity="0 0 -{GRAVITY}" cone="elliptic" impratio="100"/><worldbody>
  <geom type="plane" size="0 0 0.1" solref="0.001 1" friction="1" margin="{{margin}}"/>
  <body name="rod" pos="0 0 {RADIUS}">
    <inertial pos="0 0 {HEIGHT}" mass="{MASS}" diaginertia="{INERTIA} {INERTIA} {INERTIA}"/>
    <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
    <joint name="pitch" type="hinge" axis="0 1 0"/>
    <geom name="ball" type="sphere" size="{{size}}" solref="0.001 1" friction="1" margin="{{margin}}"/>
    {{more}}</body></worldbody>{{motors}}</mujoco>"""

ROD = """
constants: n = 20, h = {duration}/n;
variables: x, z, p, fz{names};
method: hermite-simpson;
constraints:
  [0, n]: {mass}*x'' = 0; {mass}*z'' = fz - {mass}*9.81; p'' = 0; fz = {mass}*9.81;{rows}
  [0]: x; z; p; x'; z'; p';
replay:
  model = "rod.xml"; joint x = x; joint z = z; joint pitch = p;
  contact geom.ball.fz = fz;{lines}
"""

#: A wheel at the rod's centre of mass, which a motor turns against it.
WHEEL = 0.01
WHEEL_BODY = (
    f'<body name="wheel" pos="0 0 {HEIGHT}"><inertial pos="0 0 0" mass="0.5" '
    f'diaginertia="{WHEEL} {WHEEL} {WHEEL}"/><joint name="spin" type="hinge" axis="0 1 0"/></body>'
)


def rod(folder: Path, wheel: bool = False, duration: float = 0.5, margin: float = 0.0) -> Setup:
    """The margins of the floor and of the ball add up to how much smaller the ball is."""
    (folder / "rod.xml").write_text(
        ROD_MODEL.format(
            size=RADIUS - 2.0 * margin,
            margin=margin,
            more=WHEEL_BODY if wheel else "",
            motors='<actuator><motor name="m" joint="spin" gear="100"/></actuator>' if wheel else "",
        )
    )
    (folder / "rod.stc").write_text(
        ROD.format(
            duration=duration,
            mass=MASS + 0.5 * wheel,
            names=", s, u" if wheel else "",
            rows=" s'' = 0; u = 0; [0]: s; s';" if wheel else "",
            lines=" joint spin = s; actuator m = u;" if wheel else "",
        )
    )
    return open_setup(stc.load(folder / "rod.stc").solve())


@pytest.mark.parametrize("margin", [0.0, 1e-3])
def test_what_stands_falls_about_the_point_that_holds_it(tmp_path: Path, margin: float) -> None:
    """On a ball that rolls: (I + m (r + L)^2) p'' = m g L p; under a force that stays upright: I p'' = m g L p."""
    setup = rod(tmp_path, margin=margin)
    pitch = np.array([2])
    for held, inertia in ((True, INERTIA + MASS * (RADIUS + HEIGHT) ** 2), (False, INERTIA)):
        rate = np.sqrt(MASS * GRAVITY * HEIGHT / inertia)
        found = growth(linearise(setup, held), pitch)
        assert found == pytest.approx(np.cosh(0.5 * rate), rel=0.02)


def test_growth_begins_anew_where_the_replay_does(tmp_path: Path) -> None:
    setup = rod(tmp_path)
    rate = np.sqrt(MASS * GRAVITY * HEIGHT / INERTIA)
    found = growth(linearise(setup, held=False), np.array([2]), [5, 10])
    assert found == pytest.approx(np.cosh(0.25 * rate), rel=0.02)


def test_a_touching_point_is_not_moved(tmp_path: Path) -> None:
    """No control moves the point that touches, and no velocity of it outlives a step; its place stays."""
    maps = linearise(rod(tmp_path, wheel=True))
    touching = np.array([1.0, 0.0, -RADIUS, 0.0])  # along x: the middle's velocity, and how the ball rolls
    below = np.array([0.0, 1.0, 0.0, 0.0])
    for row in (touching, below):
        assert np.abs(row @ maps.control[3][4:]).max() < 1e-9
        assert np.abs(row @ maps.state[3][4:, 4:]).max() < 1e-6
        np.testing.assert_allclose(row @ maps.state[3][:4, :4], row, atol=1e-6)


def test_a_regulator_balances_what_no_motor_moves(tmp_path: Path) -> None:
    """The wheel's motor holds the rod upright, which a law for the wheel alone does not."""
    setup = rod(tmp_path, wheel=True, duration=2.0)
    law = regulator(setup, linearise(setup))
    assert law is not None
    setup.compiled.opt.gravity[0] = 1e-3  # leans on the rod all the time
    tracked = {
        m.subject: m.value for m in contact_metrics("tracked", setup, replay(setup, 2e-4, feedback=law))
    }
    loose = {m.subject: m.value for m in contact_metrics("tracked", setup, replay(setup, 2e-4))}
    assert tracked["joint pitch"] < 0.5 * loose["joint pitch"]


#: A weight that hangs on a hook and is let go.
HANGING_MODEL = """<mujoco><option timestep="2e-4" gravity="0 0 -9.81"/><worldbody>
  <geom type="plane" size="0 0 0.1" pos="0 0 -5"/><site name="hook" pos="0 0 1"/>
  <body name="weight" pos="0 0 1"><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
    <geom name="ball" type="sphere" size="0.05" mass="2"/><site name="hand"/></body></worldbody>{equality}</mujoco>"""
GRIP = '<equality><connect site1="hand" site2="hook" active="false" solref="0.001 1"/></equality>'
HANGING = """
constants: n = 30, h = 0.6/n;
model: "hanging.xml";
contact:
  hand = pin(site.hand);
  [0, 20]: hand at 0, 0, 1;
constraints: [0]: keyframe.reference; rest;
"""


def hanging(folder: Path, equality: str, touching: str = "") -> Report:
    text = HANGING_MODEL.format(equality=equality).replace('size="0.05"', 'size="0.05"' + touching)
    (folder / "hanging.xml").write_text(text)
    (folder / "hanging.stc").write_text(HANGING)
    return validate(stc.load(folder / "hanging.stc").solve())


def largest(report: Report, name: str) -> float:
    return max(metric.value for metric in report.metrics if metric.name == name)


@pytest.mark.parametrize("touching", ["", ' contype="0" conaffinity="0"'])
def test_a_grip_holds_until_it_is_let_go(touching: str, tmp_path: Path) -> None:
    """No geom needs to be able to touch another."""
    report = hanging(tmp_path, GRIP, touching)
    assert report.passed, [m for m in report.metrics if m.verdict == "fail"]
    assert largest(report, "open-loop drift, largest") < 1e-3  # of a fall of 0.2 m
    assert largest(report, "contact force, MuJoCo's against solved, median") < 1e-3


def test_a_missing_grip_is_told_once_and_a_soft_one_is_seen(tmp_path: Path) -> None:
    hanging(tmp_path, "")
    told = certify(stc.load(tmp_path / "hanging.stc").solve()).next_steps
    assert sum('<connect site1="..." site2="..." active="false"/>' in step for step in told) == 1
    hanging(tmp_path, GRIP.replace('solref="0.001 1"', 'solref="0.1 1"'))
    told = certify(stc.load(tmp_path / "hanging.stc").solve()).next_steps
    assert told
    assert not any("nothing touches" in step for step in told)
    assert any("equality constraints stiffer" in step for step in told)


def test_what_nothing_grips_falls(tmp_path: Path) -> None:
    report = hanging(tmp_path, "")
    assert not report.passed
    assert largest(report, "contact force, MuJoCo's against solved, median") == pytest.approx(1.0, abs=1e-6)
