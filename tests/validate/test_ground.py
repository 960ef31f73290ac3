"""Motions on the ground: every joint is judged, whatever moves it, and what no contact gives is found."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc.certification import certify
from stc.studies.verified import solve_until_verified
from stc.validate import Report, validate
from stc.validate.metrics import Metric
from stc.validate.robustness import robustness
from stc.validate.verdict import open_setup

BALL_MODEL = """<mujoco><option timestep="0.001" gravity="0 0 -9.81"/><worldbody>
  <geom name="floor" type="plane" size="0 0 0.1" condim="1" solref="0.004 1"/>
  <body name="ball" pos="0 0 0.1"><inertial pos="0 0 0" mass="1" diaginertia="0.004 0.004 0.004"/>
    <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
    <joint name="pitch" type="hinge" axis="0 1 0"/>
    <geom type="sphere" size="0.1" condim="1" solref="0.004 1"/></body></worldbody></mujoco>"""

#: A frictionless floor cannot turn the ball.
BALL = """
constants: n = 30, h = 1/n, I = 0.004, top = {torque};
variables: x, z, p, fz, tau;
method: hermite-simpson;
constraints:
  [0, n]: x'' = 0; z'' = fz - 9.81; I*p'' = tau; fz = 9.81; tau = top*t*(1 - t);
  [0]: x; z; p; x'; z'; p';
replay:
  model = "ball.xml"; joint x = x; joint z = z; joint pitch = p;
  contact body.ball.fz = fz; contact body.ball.my = tau;
"""


def ball(folder: Path, torque: float) -> Path:
    (folder / "ball.xml").write_text(BALL_MODEL)
    (folder / "ball.stc").write_text(BALL.format(torque=torque))
    return folder / "ball.stc"


def on_the_ground(report: Report) -> dict[tuple[str, str], Metric]:
    """Rows by replay and subject, those over the whole motion."""
    found = {}
    for metric in report.metrics:
        if metric.name.endswith("error on the ground, RMS"):
            found[metric.name.split()[0], metric.subject] = metric
    return found


def test_a_torque_that_no_floor_gives_is_found(tmp_path: Path) -> None:
    report = validate(stc.load(ball(tmp_path, 0.01)).solve())
    pitch = on_the_ground(report)["open-loop", "joint pitch"]
    assert pitch.verdict == "fail"
    last = next(m for m in report.metrics if m.name.endswith("at the end") and m.subject == "joint pitch")
    assert last.value == pytest.approx(0.01 / 0.004 / 12, rel=1e-3)  # the whole angle: MuJoCo's ball rests
    assert not report.passed


@pytest.mark.nightly
def test_until_verified_does_not_believe_it_either(tmp_path: Path) -> None:
    found = solve_until_verified(stc.load(ball(tmp_path, 0.01)), 1e-3)
    assert not found.verified
    assert found.message.startswith("with MuJoCo's own contacts joint pitch is 0.21 away")


def test_a_ball_at_rest_passes_and_has_no_empty_rows(tmp_path: Path) -> None:
    certificate = certify(stc.load(ball(tmp_path, 0.0)).solve())
    assert certificate.passed, certificate.headline
    assert {subject for _, subject in on_the_ground(certificate.report)} == {"base", "joint pitch"}
    assert solve_until_verified(stc.load(tmp_path / "ball.stc"), 1e-3).verified


SLIDER_MODEL = """<mujoco><option timestep="0.001" gravity="0 0 -9.81"/><worldbody>
  <geom type="plane" size="0 0 0.1" solref="0.004 1"/>
  <body name="base" pos="0 0 0.1"><inertial pos="0 0 0" mass="1" diaginertia="0.004 0.004 0.004"/>
    <joint name="z" type="slide" axis="0 0 1"/><geom type="box" size="0.1 0.1 0.1" solref="0.004 1"/>
    <body name="slider" pos="0 0 0.2"><inertial pos="0 0 0" mass="0.01" diaginertia="1e-5 1e-5 1e-5"/>
      <joint name="y" type="slide" axis="0 1 0"/></body></body></worldbody>
  <actuator><motor name="push" joint="y"/></actuator></mujoco>"""

#: A slider on a standing box: the ground is said to push it along, which touches the box alone.
SLIDER = """
constants: n = 30, h = 1/n, top = {top};
variables: z, y, fz, fy, fg;
method: hermite-simpson;
constraints:
  [0, n]: 1.01*z'' = fz - 1.01*9.81; 0.01*y'' = fy + fg; fz = 1.01*9.81; fy = 0.05*sin(2*pi*t); fg = top*t*(1 - t);
  [0]: z; y; z'; y';
replay:
  model = "slider.xml"; joint z = z; joint y = y; actuator push = fy;
  contact body.base.fz = fz; contact joint.y = fg;
"""


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(("top", "verdict"), [(0.005, "fail"), (0.0, "pass")])
def test_a_driven_slide_is_judged_open_loop(tmp_path: Path, top: float, verdict: str) -> None:
    (tmp_path / "slider.xml").write_text(SLIDER_MODEL)
    (tmp_path / "slider.stc").write_text(SLIDER.format(top=top))
    rows = on_the_ground(validate(stc.load(tmp_path / "slider.stc").solve()))
    assert {subject for replay, subject in rows if replay == "open-loop"} == {"base", "joint y"}
    assert rows["open-loop", "joint y"].unit == "m"
    assert rows["open-loop", "joint y"].verdict == verdict


@pytest.mark.parametrize(("top", "verified"), [(0.0, True), (0.005, False)])
def test_feedback_does_not_verify_what_no_contact_gives(tmp_path: Path, top: float, verified: bool) -> None:
    (tmp_path / "slider.xml").write_text(SLIDER_MODEL)
    (tmp_path / "slider.stc").write_text(SLIDER.format(top=top))
    found = solve_until_verified(stc.load(tmp_path / "slider.stc"), 1e-3)
    assert found.verified is verified, found.message
    assert verified or found.message.startswith("with MuJoCo's own contacts joint y is")


#: More sites than joints, as an index among the sites is no index among the joints.
JET_MODEL = """<mujoco><option timestep="0.001"/><worldbody><geom type="plane" size="5 5 0.1" solref="0.004 1"/>
  <body name="b" pos="0 0 0.1">
    <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
    <geom type="sphere" size="0.1" mass="1" solref="0.004 1"/>
    <site name="a"/><site name="c"/><site name="j"/>
    <body name="tail" pos="0.3 0 0"><inertial pos="0 0 0" mass="0.01" diaginertia="1e-3 1e-3 1e-3"/>
      <joint name="tail" type="hinge" axis="0 1 0"/></body></body></worldbody>
  <actuator><motor name="jet" site="j" gear="0 0 1 0 0 0"/><motor name="tail" joint="tail"/></actuator></mujoco>"""

JET = """
constants: n = 20, h = 0.5/n, w = 9.81*1.01;
variables: x, z, a, f, u, fz;
method: hermite-simpson;
constraints:
  [0, n]: x'' = 0; 1.01*z'' = f + fz - w; 1e-3*a'' = u; f = 4*sin(pi*t)^2; fz = w - f; u = 1e-3*sin(4*pi*t);
  [0]: x; z; a; x'; z'; a';
replay:
  model = "jet.xml"; joint x = x; joint z = z; joint tail = a; actuator jet = f; actuator tail = u;
  contact body.b.fz = fz;
"""


def test_a_jet_at_a_site_moves_no_joint(tmp_path: Path) -> None:
    (tmp_path / "jet.xml").write_text(JET_MODEL)
    (tmp_path / "jet.stc").write_text(JET)
    solution = stc.load(tmp_path / "jet.stc").solve()
    rows = on_the_ground(validate(solution))
    assert {subject for _, subject in rows} == {"base", "joint tail"}
    assert all(row.verdict == "pass" for row in rows.values())
    shaken = robustness(open_setup(solution), samples=2, kinds=["start"]).envelopes[0]
    assert not shaken.lost.any()
    assert (shaken.joints > 1e-6).all()  # the tail starts elsewhere, which its motor moves
