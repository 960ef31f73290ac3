"""Blocks that slide, stand, lean and tip: what MuJoCo's bouncing contacts give, against elementary statics."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stc
from stc.solution import Solution
from stc.validate import Metric, Report, validate
from stc.validate.contact_forces import windows_of
from stc.validate.contact_meter import ContactMeter
from stc.validate.replay import replay
from stc.validate.verdict import open_setup

#: A block of 2 kg and 0.2 m on a stiff floor.
MODEL = """<mujoco><compiler angle="radian"/><option gravity="0 0 -9.81" timestep="0.0005"/><worldbody>
  <geom type="plane" size="0 0 0.1" pos="0 0 {floor}" friction="{friction} 0.005 0.0001"
    solref="0.001 {damping}" priority="1" condim="{condim}"/>
  <body name="b" pos="0 0 0.1">
    <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>{turn}
    <inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.1"/>
    {before}<geom type="box" size="0.1 0.1 0.1" mass="0"/>{after}
  </body>{wall}</worldbody>
  <actuator><motor name="f" joint="{motor}"/></actuator></mujoco>"""

HINGE = '<joint name="th" type="hinge" axis="0 1 0"/>'


CONTACT = "contact body.b.fz = N; contact body.b.fx = F;"
LINES = "actuator f = f; apply body.b.fx = w;" + CONTACT


def judged(folder: Path, spec: str, lines: str = LINES, **parts: object) -> Report:
    return validate(solved(folder, spec, lines, **parts))


def solved(folder: Path, spec: str, lines: str = LINES, **parts: object) -> Solution:
    usual = {"floor": 0, "friction": 0.5, "condim": 3, "damping": 1, "turn": "", "motor": "x", "wall": ""}
    parts = usual | {"before": "", "after": ""} | parts
    (folder / "block.xml").write_text(MODEL.format(**parts))
    (folder / "block.stc").write_text(
        f'{spec} replay: model = "block.xml"; joint x = x; joint z = z; {lines}'
    )
    return stc.load(folder / "block.stc").solve()


HEAD = "constants: n = 50, T = {time}, h = T/n, m = 2, g = 9.81; method: hermite-simpson;"
#: Along the floor under a motor, the floor's force and the wind's.
ALONG = (
    HEAD + "variables: x, z, f, N, F, w; constraints: [0, n]: m*x'' = f + F + w; z'' = 0; m*z'' = N - m*g; "
    "f = {motor}; w = {wind}; {rest}; [0]: x = {start}; z; x' = {speed}; z';"
)


def rows(report: Report, name: str) -> list[Metric]:
    return [metric for metric in report.metrics if metric.name.startswith(name)]


def failed(report: Report) -> list[tuple[str, str, float]]:
    return [(m.name, m.subject, m.value) for m in report.metrics if m.verdict == "fail"]


@pytest.mark.parametrize(("friction", "passes"), [(0.5, True), (0.6, False)])
def test_a_block_brakes_by_friction(tmp_path: Path, friction: float, passes: bool) -> None:
    """It bounces a millimetre high on its way, without a force most of the time; the mean is m*g and mu*m*g."""
    spec = ALONG.format(time=0.4, motor=0, wind=0, rest="F = -0.5*N", start=0, speed=3)
    report = judged(tmp_path, spec, CONTACT, friction=friction)
    assert report.passed is passes, failed(report)
    if passes:
        assert max(m.value for m in rows(report, "contact force, MuJoCo's")) < 0.1


def test_the_meter_finds_the_momentum_that_a_block_loses(tmp_path: Path) -> None:
    """Whatever the contacts do within a step: the integrator changes momentum by their impulses and gravity's."""
    spec = ALONG.format(time=0.4, motor=0, wind=0, rest="F = -0.5*N", start=0, speed=3)
    setup = open_setup(solved(tmp_path, spec))
    meter = ContactMeter(setup)
    motion = replay(setup, 5e-4, meter=meter)
    (impulses,) = meter.impulses.values()
    change = 2.0 * np.diff(motion.velocities, axis=0)
    steps = np.diff(setup.solution.time)
    assert impulses[:, 0] == pytest.approx(change[:, 0], abs=1e-9)
    assert impulses[:, 2] == pytest.approx(change[:, 1] + 2.0 * 9.81 * steps, abs=1e-9)


@pytest.mark.parametrize("slides", [False, True])
def test_windows_give_the_mean_of_a_steady_force(slides: bool) -> None:
    """On an uneven grid too, and none goes over a jump in the middle."""
    time = np.cumsum(np.concatenate([[0.0], np.where(np.arange(200) % 3, 0.004, 0.011)]))
    windows = windows_of(time, [0, 120, 200], np.full(201, slides))
    assert windows @ np.diff(time) == pytest.approx(1.0)
    across = (windows[:, :120].any(axis=1)) & (windows[:, 120:].any(axis=1))
    assert len(windows) > 80 and not across.any()


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(("gap", "passes"), [(0.0, True), (0.05, False), (0.008, False), (-0.02, False)])
def test_a_long_way_excuses_no_gap_under_a_block(tmp_path: Path, gap: float, passes: bool) -> None:
    """It goes 100 m without friction while the floor lies lower or higher than the block's sole."""
    spec = ALONG.format(time=2, motor=0, wind=0, rest="F = 0", start=0, speed=50)
    report = judged(tmp_path, spec, CONTACT, friction=0, condim=1, floor=-gap, damping=3)
    (base,) = rows(report, "open-loop error on the ground, RMS")
    assert base.value == pytest.approx(abs(gap) / 0.3, rel=0.2, abs=1e-3)
    assert (base.verdict == "pass") is passes


WALL = '<geom type="box" size="0.05 1 1" pos="{0!r} 0 0.5" condim="1" solref="0.001 3" priority="2"/>'


@pytest.mark.daily_every(5)
@pytest.mark.parametrize("start", [0.0, 0.3])
@pytest.mark.parametrize("off", [0.0, 1e-15, -1e-15, 1e-6])
def test_rounding_decides_nothing_in_a_corner(tmp_path: Path, start: float, off: float) -> None:
    """The motor presses the block against a smooth wall: the floor's friction has nothing to hold."""
    spec = ALONG.format(time=0.3, motor=30, wind=0, rest="x'' = 0", start=start, speed=0)
    wall = WALL.format(start + 0.15 + off)
    report = judged(tmp_path, spec, friction=0.3, wall=wall)
    assert report.passed, failed(report)


def test_a_wall_pulls_nothing(tmp_path: Path) -> None:
    """Away from the wall there is the floor's friction alone, of 0.3*2*9.81 N."""
    spec = ALONG.format(time=0.3, motor=-8, wind=0, rest="x'' = 0", start=0, speed=0)
    report = judged(tmp_path, spec, friction=0.3, wall=WALL.format(0.15))
    (beyond,) = rows(report, "contact force that no contact gives")
    missing = 8 - 0.3 * 2 * 9.81
    # Least squares: pressing harder gives friction too.
    assert (
        beyond.value == pytest.approx(missing / (1 + 0.3**2) / 19.62, rel=1e-2) and beyond.verdict == "fail"
    )
    assert not report.passed


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("wind", [1, 5])
def test_an_idle_motor_on_a_joint_that_friction_holds(tmp_path: Path, wind: float) -> None:
    """Feedback answers the creep of soft contacts with next to nothing of what the friction gives."""
    spec = ALONG.format(time=0.5, motor=0, wind=wind, rest="x'' = 0", start=0, speed=0)
    report = judged(tmp_path, spec)
    (share,) = rows(report, "feedback share")
    assert share.value < 0.05 and report.passed, failed(report)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(("push", "passes"), [(5, True), (15, False)])
def test_a_shoe_that_is_welded_on_counts_as_the_foot(tmp_path: Path, push: float, passes: bool) -> None:
    spec = ALONG.format(time=0.5, motor=f"{push}*t/T", wind=0, rest="x'' = 0", start=0, speed=0)
    report = judged(tmp_path, spec, before='<body name="shoe" pos="0 0 0">', after="</body>")
    (used,) = rows(report, "friction used")
    assert used.value == pytest.approx(push / (0.5 * 19.62), rel=1e-6)
    assert report.passed is passes, failed(report)
    if passes:
        assert max(m.value for m in rows(report, "contact force, MuJoCo's against solved, median")) < 0.02


TIP = (
    HEAD + "variables: x, z, th, f, N, M; constraints: [0, n]: x'' = 0; z'' = 0; th'' = 0; m*z'' = N - m*g; "
    "0.1*th'' = f + M; f = {torque}*t/T; [0]: x; z; th; x' = {speed}; z'; th';"
)


@pytest.mark.daily_every(3)
@pytest.mark.parametrize("speed", [0, 2])
@pytest.mark.parametrize("share", [0.99, 1.02, 1.15])
def test_the_centre_of_pressure_stays_on_the_sole(tmp_path: Path, share: float, speed: float) -> None:
    """The floor resists turning by its weight at the edge of the sole, 19.62 N at 0.1 m, and by no more."""
    lines = "joint th = th; actuator f = f; contact body.b.fz = N; contact body.b.my = M;"
    spec = TIP.format(time=0.5, torque=share * 1.962, speed=speed)
    report = judged(tmp_path, spec, lines, friction=0, condim=1, turn=HINGE, motor="th")
    (beyond,) = rows(report, "contact force that no contact gives")
    # Pressing harder on the edge costs as much in the force as it gains in the moment.
    assert beyond.value == pytest.approx(max(share - 1.0, 0.0) / 2.0, abs=1e-6)
    assert report.passed is (share < 1.0), failed(report)


@pytest.mark.parametrize(("push", "passes"), [("9*t/T", True), ("10.5*t/T", False)])
def test_friction_on_a_joint_has_its_limit_too(tmp_path: Path, push: str, passes: bool) -> None:
    """0.5*19.62 N, although the line names the joint and not the body that touches."""
    lines = LINES.replace("body.b.fx", "joint.x").replace("body.b.fz", "joint.z")
    spec = ALONG.format(time=0.5, motor=push, wind=0, rest="x'' = 0", start=0, speed=0)
    (beyond,) = rows(judged(tmp_path, spec, lines), "contact force that no contact gives")
    assert (beyond.verdict == "pass") is passes


@pytest.mark.nightly
def test_a_motor_that_pulls_a_sliding_block(tmp_path: Path) -> None:
    """Feedback answers every bounce, now this way, now that way; in the mean it has nothing to give."""
    spec = ALONG.format(time=1, motor="12", wind=0, rest="F = -0.5*N", start=0, speed=1)
    report = judged(tmp_path, spec)
    assert report.passed, failed(report)
    report = judged(tmp_path, spec, friction=0.6)
    assert rows(report, "feedback share")[0].verdict == "fail"
