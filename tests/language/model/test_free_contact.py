"""Contact that is left to the solver: what falls lands, what slides is slowed, what is written wrongly is told of."""

from __future__ import annotations

from math import cos, sin, sqrt
from pathlib import Path

import numpy as np
import pytest

import stc
from stc.errors import SpecError, UsageError
from stc.scheduling import found_ranges, write_schedule
from stc.solution import Solution
from stc.trajectory import Channel, interpolant
from stc.validate import validate

from .bodies import load

G = 9.81
SLOPE = 0.4
"""The angle of the plane, in rad: its tangent is 0.423."""
MASS = 2.0
DOCS = Path(__file__).parents[3] / "docs"
BLOCK = f"""<mujoco><compiler angle="radian"/><worldbody>
  <geom name="floor" type="plane" size="5 5 .1"/>
  <geom name="slope" type="plane" size="5 5 .1" euler="0 {SLOPE} 0"/>
  <body name="block"><joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
    <joint name="z" type="slide" axis="0 0 1"/><geom name="block" type="sphere" size=".1" mass="{MASS}"/>
    <site name="bottom"/></body></worldbody></mujoco>"""
FALL = """constants: n = 40, T = 0.8, h = T/n, z0 = 1, v = 0, mu = 0.3;
contact: foot = point(site.bottom), friction = mu, slides;
  free: foot;
constraints: [0]: joint.x; joint.y; joint.z = z0; joint.x' = v; joint.y'; joint.z';
"""
HOPPER = """<mujoco><compiler angle="radian" autolimits="true"/>
  <option timestep=".0001" integrator="RK4" impratio="10"/>
  <default><geom contype="0" conaffinity="0"/><default class="touching">
    <geom contype="1" conaffinity="1" friction=".88 .005 .0001" solref=".0004 1"/></default></default>
  <worldbody><geom class="touching" name="floor" type="plane" size="5 5 .1"/>
  <body name="trunk" pos="0 0 .5"><joint name="x" type="slide" axis="1 0 0"/>
    <joint name="z" type="slide" axis="0 0 1" ref=".5"/><joint name="pitch" axis="0 1 0"/>
    <geom type="box" size=".15 .1 .05" mass="3"/>
    <body name="leg"><joint name="hip" axis="0 1 0" range="-1 1" armature=".03"/>
      <geom type="capsule" fromto="0 0 0 0 0 -.2" size=".02" mass=".2"/>
      <body name="shank" pos="0 0 -.3"><joint name="knee" type="slide" axis="0 0 -1" range="-.2 .2" armature=".5"/>
        <geom type="capsule" fromto="0 0 .1 0 0 -.18" size=".015" mass=".2"/>
        <geom class="touching" name="foot" type="sphere" pos="0 0 -.18" size=".02" mass=".05"/></body></body></body>
  </worldbody><actuator><motor name="hip" joint="hip" ctrlrange="-30 30"/>
    <motor name="knee" joint="knee" ctrlrange="-200 200"/></actuator></mujoco>"""
#: A hop that begins and ends in the air: it has to land and to push off somewhere between.
HOP = """constants: n = 50, T = 1, h = T/n, D = 0.4;
contact: foot = point(geom.foot), friction = 0.8, clearance = 0.005, landing = 200;
  free: foot;
constraints:
  [0]: keyframe.reference + (0, 0, 0.05); joint.x' = D/T; joint.z'; joint.pitch'; joint.hip'; joint.knee';
  [n]: keyframe.reference + (D, 0, 0.05); joint.x' = D/T; joint.z'; joint.pitch'; joint.hip'; joint.knee';
objective: [0, n]: integral(effort + 5e-3*joint.hip''^2 + 5e-3*joint.knee''^2);
"""


def values(solution: Solution, name: str) -> np.ndarray:
    return np.asarray(solution[name])


def on_the_slope(tmp_path: Path, mu: float) -> Solution:
    spec = FALL.replace("free: foot", "free: foot on geom.slope")
    return load(tmp_path, BLOCK, spec).solve(z0=0, mu=mu, T=1)


@pytest.fixture(scope="module")
def fallen(tmp_path_factory: pytest.TempPathFactory) -> Solution:
    return load(tmp_path_factory.mktemp("fall"), BLOCK, FALL).solve(z0=1, v=1)


def test_what_falls_lands_within_a_step_of_when_it_should(fallen: Solution) -> None:
    assert fallen.status == "optimal"
    assert fallen.method == "stepping"
    landed = fallen.time[np.flatnonzero(values(fallen, "joint.z") < 1e-4)[0]]
    step = fallen.time[1]
    assert abs(landed - sqrt(2 / G)) <= step + 1e-9


def test_it_stays_down_and_bears_its_weight(fallen: Solution) -> None:
    height, pressure = values(fallen, "joint.z"), values(fallen, "foot_fz")
    assert height.min() > -1e-6
    assert height[-5:] == pytest.approx(np.zeros(5), abs=1e-4)
    assert pressure[-5:] == pytest.approx(np.full(5, MASS * G), rel=1e-3)


def test_momentum_is_what_forces_have_given(fallen: Solution) -> None:
    """From rest to rest: all that weight has given the floor takes, whenever within the steps the impact was."""
    step = fallen.time[1]
    vertical = step * (values(fallen, "foot_fz")[1:] - MASS * G).sum()
    along = step * values(fallen, "foot_fx")[1:].sum()
    assert vertical == pytest.approx(MASS * values(fallen, "joint.z'")[-1], abs=1e-6)
    assert along == pytest.approx(MASS * (values(fallen, "joint.x'")[-1] - 1.0), abs=1e-6)


def test_impacts_and_friction_create_no_energy(fallen: Solution) -> None:
    speed = values(fallen, "joint.x'") ** 2 + values(fallen, "joint.z'") ** 2
    energy = MASS * (0.5 * speed + G * values(fallen, "joint.z"))
    assert np.diff(energy).max() < 1e-3
    assert energy[-1] < 0.1 * energy[0]


def test_friction_is_against_the_sliding_and_as_large_as_it_may_be(tmp_path: Path) -> None:
    """Thrown along the floor a block comes to rest after v^2/(2 mu g), first order of the step off."""
    solution = load(tmp_path, BLOCK, FALL).solve(z0=0, v=1, mu=0.3)
    slides = (values(solution, "joint.x'") > 0.1)[1:]
    assert values(solution, "foot_fx")[1:][slides] == pytest.approx(
        np.full(slides.sum(), -0.3 * MASS * G), rel=1e-2
    )
    assert values(solution, "joint.x")[-1] == pytest.approx(1 / (2 * 0.3 * G), rel=0.1)
    assert values(solution, "joint.x'")[-1] == pytest.approx(0, abs=1e-3)


@pytest.mark.parametrize("mu", [0.1, 0.3])
def test_a_block_slides_down_a_slope_beyond_the_angle_of_friction(tmp_path: Path, mu: float) -> None:
    solution = on_the_slope(tmp_path, mu)
    way = np.hypot(values(solution, "joint.x")[-1], values(solution, "joint.z")[-1])
    wanted = 0.5 * G * (sin(SLOPE) - mu * cos(SLOPE))
    assert way == pytest.approx(wanted, rel=2 / 40)


@pytest.mark.parametrize("mu", [0.45, 0.6])
def test_a_block_sticks_to_a_slope_within_it(tmp_path: Path, mu: float) -> None:
    """But for what the relaxation e lets it creep by: the work that friction lacks is 10 e W at most."""
    solution = on_the_slope(tmp_path, mu)
    creep = 10 * solution.constants["contact.relaxation"] / (cos(SLOPE) * mu - sin(SLOPE))
    assert abs(values(solution, "joint.x")[-1]) < creep
    assert values(solution, "foot_fx")[20] == pytest.approx(
        0, abs=0.05
    )  # weight straight down, force straight up
    assert values(solution, "foot_fz")[20] == pytest.approx(MASS * G, rel=1e-2)


def test_forces_act_all_through_the_step_that_they_end() -> None:
    channel = Channel.smooth([1.0, 2.0, 5.0])
    (constant,) = interpolant("stepping", channel, np.arange(2))
    assert constant.tolist() == [2.0, 5.0]


@pytest.mark.nightly
def test_a_hop_is_found_scheduled_and_passes_in_mujoco(tmp_path: Path) -> None:
    """Found roughly, then proven: nothing says when the foot stands."""
    rough = load(tmp_path, HOPPER, HOP).solve()
    assert rough.status == "optimal"
    (ranges,) = found_ranges(rough).values()
    assert ranges
    assert 0 < ranges[0][0] < ranges[-1][1] < rough.n
    assert not any(way for _, _, way in ranges)
    with pytest.raises(UsageError, match="stc schedule"):
        validate(rough)
    write_schedule(rough, tmp_path / "scheduled.stc")
    text = (tmp_path / "scheduled.stc").read_text()
    assert "free:" not in text
    solution = stc.load(tmp_path / "scheduled.stc").solve(n=100)
    assert solution.status == "optimal"
    assert solution.method == "hermite-simpson"
    report = validate(solution)
    failed = [f"{m.name}, {m.subject}: {m.value}" for m in report.metrics if m.verdict == "fail"]
    assert not failed


@pytest.mark.nightly
def test_a_foot_that_begins_lower_than_its_clearance_has_a_schedule(tmp_path: Path) -> None:
    """Half way through a flight a foot clears the floor by `clearance`, and here the pose given there by 4 mm."""
    rough = load(tmp_path, HOPPER, HOP.replace("0, 0.05)", "0, 0.004)")).solve()
    assert rough.status == "optimal"
    write_schedule(rough, tmp_path / "scheduled.stc")
    assert stc.load(tmp_path / "scheduled.stc").solve().status == "optimal"


GRIPPER = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
  <body name="block" pos="0 0 .05"><joint name="x" type="slide" axis="1 0 0"/>
    <joint name="z" type="slide" axis="0 0 1"/><geom name="block" type="box" size=".05 .05 .05" mass=".5"/>
    <site name="sole" pos="0 0 -.05"/><site name="left" pos="-.05 0 0" zaxis="-1 0 0"/>
    <site name="right" pos=".05 0 0" zaxis="1 0 0"/></body>
  <body name="lf" pos="-.12 0 .05"><joint name="lx" type="slide" axis="1 0 0"/>
    <joint name="lz" type="slide" axis="0 0 1"/><geom name="lf" type="sphere" size=".01" mass=".2"/></body>
  <body name="rf" pos=".12 0 .05"><joint name="rx" type="slide" axis="1 0 0"/>
    <joint name="rz" type="slide" axis="0 0 1"/><geom name="rf" type="sphere" size=".01" mass=".2"/></body>
  </worldbody><actuator><motor name="lx" joint="lx"/><motor name="lz" joint="lz"/>
    <motor name="rx" joint="rx"/><motor name="rz" joint="rz"/></actuator></mujoco>"""


@pytest.mark.nightly
def test_fingers_that_meet_a_block_take_its_load_from_the_floor(tmp_path: Path) -> None:
    """It leaves the floor in the step in which they squeeze it: nothing else would bear it until they do."""
    spec = """constants: n = 40, T = 1, h = T/n;
contact: sole = point(site.sole), friction = 0.8;
  l = point(geom.lf), friction = 0.8; r = point(geom.rf), friction = 0.8;
  free: sole; l on site.left; r on site.right;
constraints: [0]: joint.*; rest; [n]: joint.z = 0.2; rest;
objective: [0, n]: integral(effort);
"""
    rough = load(tmp_path, GRIPPER, spec).solve()
    assert rough.status == "optimal"
    ranges, _ = write_schedule(rough, tmp_path / "scheduled.stc")
    assert ranges["sole"][-1][1] <= max(first for first, _, _ in ranges["l"])
    assert stc.load(tmp_path / "scheduled.stc").solve().status == "optimal"


@pytest.mark.nightly
def test_a_quadruped_hops_on_feet_that_nobody_schedules(tmp_path: Path) -> None:
    """The page of the README with its feet under `free:`."""
    feet = ("FL", "FR", "RL", "RR")
    contacts = "".join(f"{foot} = point(geom.{foot}_foot), friction = 0.7; " for foot in feet)
    (tmp_path / "hop.stc").write_text(
        f"""constants: n = 60, T = 0.8, h = T/n, D = 0.5;
model: "quadruped.xml";
contact: {contacts} free: {"; ".join(feet)};
constraints: [0]: keyframe.stand; rest; [n]: keyframe.stand + (D, 0, 0); rest;
objective: [0, n]: integral(effort);
"""
    )
    rough = stc.load(tmp_path / "hop.stc").solve(max_iterations=1000)
    assert rough.status == "optimal"
    assert all(found_ranges(rough).values())


def test_the_rows_are_among_the_statements(tmp_path: Path) -> None:
    problem = load(tmp_path, HOPPER, HOP).problem()
    texts = [relation.text for relation in problem.relations]
    for what in ("is not below the floor", "pushes only where it touches", "does not slip where it touches"):
        assert any(text == f"foot {what}" for text in texts)
    assert problem.relaxation in problem.constants


#: What is wrong, and what is told of it.
WRONG = {
    "free: foot; [0, 5]: foot;": "`foot` is free, and stands on \\[0, 5\\] as well",
    "free: foot; foot;": "`foot` is free already",
    "free: feet;": "there is no contact `feet`",
    "free: foot at 0;": "`foot` is free, and has no place",
    "free: foot on geom.wall;": "wall",
    "grip = pin(geom.foot); free: grip;": "a pin cannot be free",
}


@pytest.mark.parametrize("written", WRONG)
def test_mistakes_are_told_of(tmp_path: Path, written: str) -> None:
    with pytest.raises(SpecError, match=WRONG[written]):
        load(tmp_path, HOPPER, HOP.replace("free: foot;", written)).problem()


def test_a_pose_below_the_surface_is_told_of(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"`foot` is 0\.05 m below the floor in this pose"):
        load(tmp_path, HOPPER, HOP.replace("(0, 0, 0.05)", "(0, 0, -0.05)")).problem()


def test_contacts_of_a_lagrangian_cannot_be_free() -> None:
    spec = """constants: n = 10; variables: x, z; lagrangian: x'^2 + z'^2 - z;
      contact: p = point(x, z), friction = 1; free: p;"""
    with pytest.raises(SpecError, match="contacts of a model can be free"):
        stc.load(spec).problem()


@pytest.mark.nightly
def test_a_pushed_box_is_found_scheduled_and_passes_in_mujoco(tmp_path: Path) -> None:
    """It is pushed, glides and stops by friction alone, after v^2/(2 mu g)."""
    rough = stc.load(DOCS / "push_free.stc").solve()
    assert rough.status == "optimal"
    assert "forward" in [way for _, _, way in found_ranges(rough)["sole"]]
    (tmp_path / "box.xml").write_text((DOCS / "box.xml").read_text())
    write_schedule(rough, tmp_path / "scheduled.stc")
    solution = stc.load(tmp_path / "scheduled.stc").solve(n=80)
    assert solution.status == "optimal"
    force, pressure = values(solution, "sole_fx"), values(solution, "sole_fz")
    slides = values(solution, "joint.x'") > 1e-3
    assert force[slides] == pytest.approx(-0.3 * pressure[slides], rel=1e-6)
    assert validate(solution).passed


def test_a_ball_is_found_scheduled_and_passes_in_mujoco(tmp_path: Path) -> None:
    """It falls for sqrt(2 z/g), no frame of equal steps; all frames but the landing have either a gap or a force."""
    (tmp_path / "dropped.stc").write_text(
        (DOCS / "ball_free.stc").read_text().replace("0.9 <= joint.z <= 1.1;", "joint.z = 1;")
    )
    (tmp_path / "ball.xml").write_text((DOCS / "ball.xml").read_text())
    rough = stc.load(tmp_path / "dropped.stc").solve()
    assert rough.status == "optimal"
    kind = rough.complementarity()
    assert kind is not None and kind.b_stationary is True and not kind.degenerate
    write_schedule(rough, tmp_path / "scheduled.stc")
    solution = stc.load(tmp_path / "scheduled.stc").solve(n=120)
    assert solution.status == "optimal"
    height = values(solution, "joint.z")
    landed = solution.time[np.flatnonzero(height < 1e-9)[0]]
    assert landed == pytest.approx(sqrt(2 / G), rel=1e-6)
    assert validate(solution).passed


def test_frames_with_neither_gap_nor_force_are_told(tmp_path: Path) -> None:
    """A block that a motor has taken all weight off lies on the floor: it may rise or stay."""
    model = BLOCK.replace("</worldbody>", '</worldbody><actuator><motor name="lift" joint="z"/></actuator>')
    spec = f"""constants: n = 10, T = 0.2, h = T/n;
    contact: foot = point(site.bottom), friction = 0.3;
      free: foot;
    constraints: [0]: joint.x; joint.y; joint.z; rest;
    objective: [0, n]: (actuator.lift - {MASS * G})^2 + foot_fz^2;
    """
    found = load(tmp_path, model, spec).solve().complementarity()
    assert found is not None
    assert found.b_stationary is None
    (place,) = found.degenerate
    assert place.frames == list(range(1, 11))
    assert "free: foot" in str(found) and "not known to be B-stationary" in str(found)


SLIDE = """constants: n = 20, T = 0.4, h = T/n, v = 1;
contact: foot = point(site.bottom), friction = 0.3;
  [0, n]: foot slides WAY;
constraints: [0]: joint.x; joint.z; joint.x' = v; joint.z';
"""
PLANAR = BLOCK.replace('<joint name="y" type="slide" axis="0 1 0"/>', "")


def test_a_contact_that_never_stands_bears_nothing(tmp_path: Path) -> None:
    """What is declared without ranges leaves a body to fall."""
    solution = load(tmp_path, PLANAR, SLIDE.replace("[0, n]: foot slides WAY;", "")).solve()
    assert solution.status == "optimal"
    assert values(solution, "joint.z")[-1] == pytest.approx(-G * 0.4**2 / 2, rel=1e-9)
    assert not values(solution, "foot_fz").any()


@pytest.mark.parametrize(("way", "sign"), [("forward", 1.0), ("backward", -1.0)])
def test_what_slides_is_slowed_by_its_friction(tmp_path: Path, way: str, sign: float) -> None:
    solution = load(tmp_path, PLANAR, SLIDE.replace("WAY", way)).solve(v=2 * sign)
    assert solution.status == "optimal"
    t = solution.time
    assert values(solution, "joint.x") == pytest.approx(sign * (2 * t - 0.5 * 0.3 * G * t**2), abs=1e-9)


def test_what_slides_the_other_way_is_infeasible(tmp_path: Path) -> None:
    solution = load(tmp_path, PLANAR, SLIDE.replace("WAY", "backward")).solve(v=1)
    assert solution.status == "infeasible"


def test_what_comes_down_sliding_loses_speed_by_the_impulse_of_friction(tmp_path: Path) -> None:
    """It falls 0.2 m; the floor takes its fall by J, and mu J of its momentum along."""
    spec = """constants: n = 40, z0 = 0.2, T1 = sqrt(2*z0/9.81), T2 = 0.2; definitions: [0, n/2 - 1]: h = 2*T1/n;
      [n/2, n]: h = 2*T2/n; contact: foot = point(site.bottom), friction = 0.3; [n/2, n]: foot slides forward;
      constraints: [0]: joint.x; joint.z = z0; joint.x' = 2; joint.z';"""
    solution = load(tmp_path, PLANAR, spec).solve()
    assert solution.status == "optimal"
    fall = sqrt(2 * G * 0.2)
    assert values(solution, "joint.x'")[-1] == pytest.approx(2 - 0.3 * fall - 0.3 * G * 0.2, abs=1e-6)


#: What is wrong with sliding, and what is told of it.
WRONG_SLIDES = {
    "[0, n]: foot slides forth;": "nothing slides `forth`",
    "[0, n]: foot at 0 slides forward;": "`foot` slides, and has no place",
    "free: foot slides forward;": "which way `foot` slides is left to the solver",
    "[0, 10]: foot; [10, n]: foot;": "`foot` stands already",
}


@pytest.mark.parametrize("written", WRONG_SLIDES)
def test_mistakes_about_sliding_are_told_of(tmp_path: Path, written: str) -> None:
    with pytest.raises(SpecError, match=WRONG_SLIDES[written]):
        load(tmp_path, PLANAR, SLIDE.replace("[0, n]: foot slides WAY;", written)).problem()


def test_a_schedule_states_sliding_in_a_plane(tmp_path: Path) -> None:
    spec = SLIDE.replace("WAY", "forward").replace("joint.x;", "joint.x; joint.y; joint.y';")
    with pytest.raises(SpecError, match="`foot` can slide in more than one direction"):
        load(tmp_path, BLOCK, spec).problem()


def test_what_is_put_down_at_the_end_has_no_stance_there(tmp_path: Path) -> None:
    motor = '<actuator><motor name="lift" joint="z" ctrlrange="-90 90"/></actuator></mujoco>'
    asked = "[0, n]: foot_fz <= 0.01; [n]: joint.z; joint.z'; objective: [0, n]: integral(actuator.lift^2);"
    put = load(tmp_path, BLOCK.replace("</mujoco>", motor), FALL + asked, n=12).solve()
    assert put.status == "optimal"
    assert found_ranges(put) == {"foot": []}


def test_what_slides_in_space_has_no_schedule(tmp_path: Path) -> None:
    solution = load(tmp_path, BLOCK, FALL).solve(z0=0, v=1, mu=0.3)
    with pytest.raises(UsageError, match="`foot` slides by"):
        found_ranges(solution)


@pytest.mark.nightly
def test_a_biped_steps_without_a_schedule(tmp_path: Path) -> None:
    """One foot stands while the other lands: both have impulses within friction."""
    rough = stc.load(DOCS / "step_free.stc").solve()
    assert rough.status == "optimal"
    (tmp_path / "two_legs.xml").write_text((DOCS / "two_legs.xml").read_text())
    write_schedule(rough, tmp_path / "scheduled.stc")
    solution = stc.load(tmp_path / "scheduled.stc").solve(n=100)
    assert solution.status == "optimal"
    assert validate(solution).passed


@pytest.mark.nightly
def test_the_lamp_jumps_without_a_schedule(tmp_path: Path) -> None:
    rough = stc.load(DOCS / "lamp_free.stc").solve()
    assert rough.status == "optimal"
    write_schedule(rough, tmp_path / "scheduled.stc")
    solution = stc.load(tmp_path / "scheduled.stc").solve(
        n=300
    )  # as the page says; with 180 the energy balance is near its limit
    assert solution.status == "optimal"
    assert validate(solution).passed


def test_the_command_tells_the_ranges_and_writes_the_spec(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from stc.cli.main import run

    rough = load(tmp_path, HOPPER, HOP).solve()
    monkeypatch.chdir(tmp_path)
    rough.save("hop.npz")
    assert run(["schedule", "hop.npz", "-o", "found.stc"]) == 0
    first, last, _ = found_ranges(rough)["foot"][0]
    assert f"[{first}, {last}]" in capsys.readouterr().out
    assert run(["check", "found.stc"]) == 0
    assert run(["validate", "hop.npz"]) == 1
    assert "stc schedule" in capsys.readouterr().err
    assert run(["schedule", "hop.npz", "-o", "found.npz"]) == 2
    assert run(["schedule", "hop.npz", "-o", "elsewhere/found.stc"]) == 2  # its model is not there
    assert not (tmp_path / "elsewhere" / "found.stc").exists()
