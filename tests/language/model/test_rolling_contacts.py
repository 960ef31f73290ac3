"""Balls about points of bodies, margins of geoms, and contacts that are made stiffer for the replay."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import stc
from stc.errors import SpecError
from stc.validate import ModelError, validate

from .bodies import load

#: A log that lies along y on a floor: it rolls along x.
LOG = """<mujoco><option timestep=".0005"/><worldbody><geom name="floor" type="plane" size="5 5 1" {floor}/>
  <body name="log" pos="0 0 {height}"><joint name="x" type="slide" axis="1 0 0"/>
  <joint name="z" type="slide" axis="0 0 1"/><joint name="turn" axis="0 1 0"/>
  <geom type="capsule" size=".1 .3" euler="90 0 0" mass="2" {log}/></body></worldbody>
  <actuator><motor name="m" joint="turn"/></actuator></mujoco>"""

ROLL = """constants: n = 20, T = 0.5, h = T/n;
contact:
  left = point(body.log, 0, 0.3, 0), radius = {radius};
  right = point(body.log, 0, -0.3, 0), radius = {radius};
  [0, n]: left; right;
constraints:
  [0]: keyframe.reference grounded; rest;
  [n]: joint.turn = 1; rest;
objective: [0, n]: integral(effort);
replay: set option.solref.time = {stiff};
"""


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("margins", [(0.0, 0.0), (0.002, 0.001)])
def test_a_capsule_rolls_on_its_ends(tmp_path: Path, margins: tuple[float, float]) -> None:
    """It goes as far as its radius says, and MuJoCo goes the same way; where margins hold it off the floor, it rolls on
    the place half way between the two.
    """
    floor, log = [f'margin="{margin}"' for margin in margins]
    model = load(
        tmp_path,
        LOG.format(height=0.1, floor=floor, log=log),
        ROLL.format(radius=0.1 + margins[1], stiff=5e-4),
    )
    solution = model.solve()
    assert solution.status == "optimal"
    assert solution["joint.x"][-1] == pytest.approx(0.1 + 0.5 * sum(margins), abs=1e-6)
    assert solution["joint.z"][0] == pytest.approx(sum(margins), abs=1e-9)
    report = validate(solution)
    assert report.passed, [str(m) for m in report.metrics if m.verdict == "fail"]
    assert report.fields["option.solref.time"] == 5e-4
    assert math.isclose(report.time_step, 2.5e-4)


def test_contacts_are_not_made_infinitely_stiff(tmp_path: Path) -> None:
    model = load(tmp_path, LOG.format(height=0.1, floor="", log=""), ROLL.format(radius=0.1, stiff=0))
    with pytest.raises(ModelError, match="a time is above 0"):
        validate(model.solve())


@pytest.mark.parametrize("place", ["point(geom.floor)", "point(body.log, 0, 0, 0)"])
def test_a_radius_is_a_number_and_of_a_point_of_a_body(tmp_path: Path, place: str) -> None:
    spec = ROLL.format(radius="joint.x" if "body" in place else 0.1, stiff=5e-4)
    spec = spec.replace("point(body.log, 0, 0.3, 0)", place)
    with pytest.raises(SpecError, match="radius"):
        load(tmp_path, LOG.format(height=0.1, floor="", log=""), spec).problem()


def test_a_capsule_is_named_with_its_ends(tmp_path: Path) -> None:
    """What the message proposes is what MuJoCo's own capsule touches with, and solves."""
    log = LOG.format(height=0.1, floor="", log='name="trunk" margin="0.001"')
    spec = ROLL.format(radius=0.101, stiff=5e-4)
    for place in ("point(geom.trunk), radius = 0.101", "point(geom.trunk)"):
        with pytest.raises(SpecError) as caught:
            load(tmp_path, log, spec.replace("point(body.log, 0, 0.3, 0), radius = 0.101", place)).problem()
        for end in ("point(body.log, 0, -0.3, 0)", "point(body.log, 0, 0.3, 0)", "radius = 0.101"):
            assert f"`{end}`" in str(caught.value)


def test_a_site_may_be_the_middle_of_a_ball(tmp_path: Path) -> None:
    log = LOG.format(height=0.1, floor="", log="").replace(
        "</body>", '<site name="left" pos="0 .3 0"/></body>'
    )
    spec = ROLL.format(radius=0.1, stiff=5e-4)
    plain = load(tmp_path, log, spec)
    named = load(tmp_path, log, spec.replace("point(body.log, 0, 0.3, 0)", "point(site.left)"))
    assert named.solve()["joint.x"] == pytest.approx(plain.solve()["joint.x"], abs=1e-9)


@pytest.mark.parametrize(("away", "warned"), [(0.0, False), (2e-3, True), (0.2, False)])
def test_a_ball_beside_one_of_the_model_is_told(tmp_path: Path, away: float, warned: bool) -> None:
    """Rounded numbers put a contact where MuJoCo has none; a ball far from any geom is meant to be there."""
    spec = ROLL.format(radius=0.1, stiff=5e-4).replace("0, -0.3, 0", f"0, {-0.3 + away}, 0")
    model = load(tmp_path, LOG.format(height=0.1, floor="", log=""), spec)
    told = [warning for warning in model.problem().warnings if "beside this ball" in warning.message]
    assert len(told) == warned
    assert not told or "point(body.log, 0, -0.3, 0), radius = 0.1" in told[0].message


#: A leg whose foot is a capsule with two ends, or a ball; its root may move along x and z.
LEG = """<mujoco><option timestep=".0005"/><worldbody><geom name="floor" type="plane" size="5 5 1"/>
  <body name="hip" pos="0 0 .65"><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
  <geom size=".08" mass="4"/><body name="thigh"><joint name="hip" axis="0 1 0" range="-120 120"/>
  <geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03" mass=".5"/><body name="shin" pos="0 0 -.3">
  <joint name="knee" axis="0 1 0" range="-150 150"/><geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03" mass=".3"/>
  <body name="foot" pos="0 0 -.3"><joint name="ankle" axis="0 1 0" range="-90 90"/>{foot}</body></body></body></body>
  </worldbody><actuator><motor name="hip" joint="hip"/><motor name="knee" joint="knee"/>
  <motor name="ankle" joint="ankle"/></actuator></mujoco>"""

RISE = """constants: n = 16, T = 0.6, h = T/n, D = 0;
contact: {contact}
poses:
  low = keyframe.reference grounded, joint.hip = -0.9, joint.knee = 1.3, joint.ankle = {ankle};
  high = keyframe.reference grounded, joint.hip = -0.4, joint.knee = 0.8, joint.ankle = -0.4;
constraints: [0]: low; rest; [n]: high + (D, 0, 0); rest;
objective: [0, n]: integral(effort);
"""
FLAT = (
    '<geom type="capsule" fromto="-.1 0 0 .1 0 0" size=".05" mass=".2"/>',
    "for k in 1, 2: c{k} = point(body.foot, 0.2*{k} - 0.3, 0, 0), radius = 0.05; [0, n]: c1; c2;",
)
BALL = (
    '<geom name="ball" size=".05" mass=".2"/>',
    "ball = point(geom.ball); [0, n]: ball;",
)


def _moved(foot: tuple[str, str], ankle: float) -> float:
    """How far the hip is to move for the foot to stay, or to roll without slip, by the leg's geometry."""

    def middle(hip: float, knee: float) -> float:
        return -0.3 * (math.sin(hip) + math.sin(hip + knee))

    rolled = 0.05 * (0.0 - (-0.9 + 1.3 + ankle)) if foot is BALL else 0.0
    return middle(-0.9, 1.3) + rolled - middle(-0.4, 0.8)


@pytest.mark.parametrize(("foot", "ankle"), [(FLAT, -0.4), (BALL, -0.4), (BALL, 0.1)])
def test_poses_between_which_a_ball_would_slide_are_told(
    tmp_path: Path, foot: tuple[str, str], ankle: float
) -> None:
    """Two balls of one foot stand still, which is an error; of a single one it is a warning."""
    xml, contact = foot
    spec = RISE.format(contact=contact, ankle=ankle)
    away = _moved(foot, ankle)
    words = f"moved by ({away:.3g}, 0, 0) it does"
    if foot is FLAT:
        with pytest.raises(SpecError) as caught:
            load(tmp_path, LEG.format(foot=xml), spec).problem()
        assert "off its place in this pose" in str(caught.value)
        assert words in str(caught.value)
    else:
        (told,) = load(tmp_path, LEG.format(foot=xml), spec).problem().warnings
        assert "off where it can have rolled" in told.message
        assert words in told.hint
    assert (
        not load(tmp_path, LEG.format(foot=xml), spec.replace("D = 0", f"D = {away:.9g}")).problem().warnings
    )


def test_a_stride_may_begin_on_the_foot_that_ends_it(tmp_path: Path) -> None:
    """The flight of a periodic hop ends on the floor where the next one begins, and is as high as is asked between."""
    xml, _ = BALL
    spec = """constants: n = 20, T = 0.6, h = T/n, c = 0.06;
contact: ball = point(geom.ball), clearance = c, sudden; [0, 10]: ball;
constraints: [0]: joint.x; [0, n]: periodic + (0.2, 0, 0);
guess: [0]: keyframe.reference grounded, joint.hip = -0.5, joint.knee = 1, joint.ankle = -0.5;
objective: [0, n]: integral(effort + 1e-2*joint.*''^2);
"""
    spec = spec.replace(
        "guess: [0]: keyframe.reference grounded,", "poses: bent = keyframe.reference grounded,"
    )
    spec = spec.replace("objective:", "guess: [0]: bent;\nobjective:")
    solution = load(tmp_path, LEG.format(foot=xml), spec).solve()
    assert solution.status == "optimal"
    hip, knee = solution["joint.hip"], solution["joint.knee"]
    height = 0.65 + solution["joint.z"] - 0.3 * (np.cos(hip) + np.cos(hip + knee)) - 0.05
    assert np.abs(height[:11]).max() < 1e-3
    assert abs(height[-1]) < 1e-6
    assert height[15] > 0.06 - 1e-6


#: A ball without friction on a floor that has some.
SLED = """<mujoco><option timestep=".0005"/><worldbody><geom name="floor" type="plane" size="5 5 1" friction=".8"/>
  <body name="sled" pos="0 0 .1"><freejoint name="root"/><geom name="runner" size=".1" mass="2" {runner}/></body>
  </worldbody></mujoco>"""

GLIDE = """constants: n = 10, T = 0.5, h = T/n;
contact: runner = point(geom.runner); [0, n]: runner;
constraints:
  [0]: keyframe.reference grounded; joint.root.x' = 0.6; joint.root.y' = 0.2; joint.root.wx = 3;
       joint.root.z'; joint.root.wy; joint.root.wz;
objective: [0, n]: integral(0);
replay: set option.solref.time = 0.0005;
"""


def test_a_point_without_friction_glides(tmp_path: Path) -> None:
    """Neither its velocity nor its spin changes, whether the contact has one dimension or no friction."""
    for runner in ('condim="1" priority="1"', 'friction="0 0 0" priority="1"'):
        model = load(tmp_path, SLED.format(runner=runner), GLIDE)
        solution = model.solve()
        assert solution.status == "optimal"
        assert solution["joint.root.x"][-1] == pytest.approx(0.3, abs=1e-9)
        assert solution["joint.root.y"][-1] == pytest.approx(0.1, abs=1e-9)
        assert solution["joint.root.wx"] == pytest.approx(3.0, abs=1e-9)
        assert solution["runner_fz"] == pytest.approx(2 * 9.81, abs=1e-9)
        assert abs(solution["runner_fx"]) + abs(solution["runner_fy"]) == pytest.approx(0.0, abs=1e-9)
        report = validate(solution)
        assert report.passed, [str(m) for m in report.metrics if m.verdict == "fail"]
        assert not any("moves by" in note for note in report.notes)


#: A leg in a plane that stands on the balls of heel and toe.
ON_TWO_BALLS = """<mujoco><option timestep=".0005" cone="elliptic" impratio="100"/>
  <default><joint axis="0 1 0" damping="0.1"/><geom friction="0.9" solref=".001 1"/></default>
  <worldbody><geom type="plane" size="2 2 .1"/>
  <body name="hips" pos="0 0 .86"><joint name="x" type="slide" axis="1 0 0" damping="0"/>
    <joint name="z" type="slide" axis="0 0 1" damping="0"/><joint name="pitch" damping="0"/>
    <geom type="sphere" size=".1" mass="6"/>
    <body name="thigh"><joint name="hip"/><geom type="capsule" fromto="0 0 0 0 0 -.4" size=".04" mass="2"/>
      <body name="shin" pos="0 0 -.4"><joint name="knee"/>
        <geom type="capsule" fromto="0 0 0 0 0 -.4" size=".03" mass="1.5"/>
        <body name="foot" pos="0 0 -.4"><joint name="ankle" range="-60 60"/>
          <geom type="capsule" fromto="-.1 0 -.03 .15 0 -.03" size=".03" mass=".6"/></body></body></body></body>
  </worldbody><actuator><motor joint="hip"/><motor joint="knee"/><motor joint="ankle"/></actuator></mujoco>"""

BENDING = """constants: n = 20, T = 0.6, h = T/n;
contact:
  heel = point(body.foot, -0.1, 0, -0.03), radius = 0.03;
  toe = point(body.foot, 0.15, 0, -0.03), radius = 0.03;
  [0, n]: heel; toe;
poses: stand = keyframe.reference grounded, joint.hip = -0.4, joint.knee = 0.8, joint.ankle = -0.4;
constraints:
  [0]: stand; rest;
  [n]: stand; rest;
  [n/2]: com.z <= com.z[0] - 0.03;
objective: [0, n]: integral(effort);
"""


@pytest.mark.parametrize("method", ["hermite-simpson", "trapezoidal"])
def test_a_leg_on_heel_and_toe_bends_between_two_equal_poses(tmp_path: Path, method: str) -> None:
    """The balls have not rolled, so the last pose says where the foot is a second time: the rows must not."""
    solution = load(tmp_path, ON_TWO_BALLS, BENDING).solve(method=method, max_iterations=60)
    assert solution.status == "optimal"
    for name in ("x", "z", "pitch", "hip", "knee", "ankle"):
        moved = solution[f"joint.{name}"][-1] - solution[f"joint.{name}"][0]
        assert moved == pytest.approx(0.0, abs=1e-5)


@pytest.mark.nightly
def test_a_robot_on_four_balls_bows_between_two_equal_poses() -> None:
    """In space a ball comes to nearly the same place on every short way: the last pose is dependent to first order."""
    page = """constants: n = 40, T = 1, h = T/n;
model: "quadruped.xml";
contact:
  FL = point(geom.FL_foot); FR = point(geom.FR_foot); RL = point(geom.RL_foot); RR = point(geom.RR_foot);
  [0, n]: FL; FR; RL; RR;
constraints:
  [0]: keyframe.stand; rest;
  [n]: keyframe.stand; rest;
  [n/2]: body.trunk.z = 0.22; body.trunk.xaxis.z = -0.2;
objective: [0, n]: integral(effort);
"""
    solution = stc.load(page).solve(max_iterations=150)
    assert solution.status == "optimal"
    for name in ("x", "y", "z"):
        moved = solution[f"joint.root.{name}"][-1] - solution[f"joint.root.{name}"][0]
        assert moved == pytest.approx(0.0, abs=1.01e-4)


@pytest.mark.nightly
def test_the_order_in_which_heel_and_toe_are_named_does_not_matter(tmp_path: Path) -> None:
    """Where the heel leaves, what it said of the sole must not begin anew as rows of the toe, which stays."""
    spec = BENDING.replace("[0, n]: heel; toe;", "[0, 12]: heel; [0, 18]: toe; [32, n]: heel; toe;")
    spec = spec.replace("  [n/2]: com.z <= com.z[0] - 0.03;\n", "").replace(
        "n = 20, T = 0.6", "n = 40, T = 0.8"
    )
    heel, toe = (line for line in spec.splitlines() if "radius" in line)
    swapped = spec.replace(f"{heel}\n{toe}", f"{toe}\n{heel}")
    assert swapped != spec
    ends = [load(tmp_path, ON_TWO_BALLS, text).solve(max_iterations=100) for text in (spec, swapped)]
    assert [end.status for end in ends] == ["optimal", "optimal"]
    assert ends[0].objective == pytest.approx(ends[1].objective, rel=1e-6)
