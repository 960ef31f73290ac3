"""Poses that the model forbids: beyond the range of a joint, and where an equality does not hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import constant, nodes, scaled, solution_of
from closed_loop import PARALLELOGRAM

from stc.solution import ReplayChannel, Solution
from stc.trajectory import Channel
from stc.validate import Metric, validate
from stc.validate.solved_pose import equality_metrics, limit_metrics
from stc.validate.verdict import open_setup, run_replays

STOP = 1.0
ROD = f"""<mujoco><compiler angle="radian"/><option gravity="0 0 0">{{flag}}</option><worldbody><body name="rod">
  <joint name="p" axis="0 -1 0" limited="true" range="-{STOP} {STOP}"/>
  <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>
  <actuator><motor name="torque" joint="p"/></actuator></mujoco>"""


def swings(
    folder: Path, method: str, most: float, lines: list[ReplayChannel] | None = None, flag: str = ""
) -> Solution:
    """A rod that goes from rest to an angle and back within a second, driven by a motor: 1 - cos."""
    (folder / "rod.xml").write_text(ROD.format(flag=flag))
    time = np.linspace(0, 1, 101)
    w, half = 2 * np.pi, most / 2
    p = nodes(method, time, lambda t: half * (1 - np.cos(w * t)))
    rate = nodes(method, time, lambda t: half * w * np.sin(w * t))
    acceleration = nodes(method, time, lambda t: half * w**2 * np.cos(w * t))
    replay = [
        ReplayChannel("joint", ("p",), p, rate, acceleration),
        ReplayChannel("actuator", ("torque",), acceleration),
        *(lines or ()),
    ]
    return solution_of(method, time, {}, replay, model="rod.xml", directory=str(folder))


@pytest.mark.parametrize("method", ["hermite-simpson", "trapezoidal", "central"])
@pytest.mark.parametrize("beyond", [5e-3, 0.0, -1e-2])
def test_a_joint_stays_within_its_range(tmp_path: Path, method: str, beyond: float) -> None:
    (row,) = limit_metrics(open_setup(swings(tmp_path, method, STOP + beyond)))
    assert row.value == pytest.approx(max(beyond, 0.0), abs=1e-12)
    assert row.unit == "rad"
    assert row.verdict == ("fail" if beyond > 0.0 else "pass")


def test_second_order_methods_may_be_beyond_by_their_own_error(tmp_path: Path) -> None:
    """h^2/12 times the change of the acceleration: 1e-4/12 * 4 pi^2 = 3.3e-4."""
    limits = {
        method: limit_metrics(open_setup(swings(tmp_path, method, STOP)))[0].limit for method in METHODS
    }
    assert limits["hermite-simpson"] == pytest.approx(1e-6)
    assert (
        limits["trapezoidal"] == limits["central"] == pytest.approx(1e-6 + 1e-4 / 12 * 4 * np.pi**2, rel=1e-3)
    )


METHODS = ("hermite-simpson", "trapezoidal", "central")


def test_a_stop_that_the_spec_states_or_the_model_lacks_is_not_held_against_it(tmp_path: Path) -> None:
    solution = swings(tmp_path, "trapezoidal", STOP + 0.01)
    stop = ReplayChannel("contact", ("joint", "p"), constant(solution.replay[0].value, 0.0))
    (row,) = limit_metrics(open_setup(swings(tmp_path, "trapezoidal", STOP + 0.01, [stop])))
    assert row.verdict == "info"
    assert (
        limit_metrics(open_setup(swings(tmp_path, "trapezoidal", 1.1, flag='<flag limit="disable"/>'))) == []
    )


def test_a_pose_that_is_held_beyond_a_stop_fails(tmp_path: Path) -> None:
    report = validate(swings(tmp_path, "trapezoidal", STOP + 5e-3))
    assert "joint beyond its range" in {m.name for m in report.metrics if m.verdict == "fail"}


def hangs(
    folder: Path, method: str = "trapezoidal", bar: float = -1.0, right: float = 1.0, more: str = ""
) -> Solution:
    """The bar that hangs by two rods, with what its joints are given of the left rod's angle."""
    (folder / "loop.xml").write_text(f"<mujoco>{more}{PARALLELOGRAM}</mujoco>")
    time = np.linspace(0, 1, 21)
    q = [nodes(method, time, lambda t, k=k: np.sin(t + k * np.pi / 2)) for k in range(3)]
    shares = {"left": 1.0, "bar": bar, "right": right}
    replay = [
        ReplayChannel("joint", (name,), *(scaled(channel, share) for channel in q))
        for name, share in shares.items()
        if share
    ]
    replay.append(ReplayChannel("actuator", ("torque",), q[2]))
    return solution_of(method, time, {}, replay, model="loop.xml", directory=str(folder))


def broken(solution: Solution) -> list[Metric]:
    setup = open_setup(solution)
    run_replays(setup, tracked=False)
    return equality_metrics(setup)


@pytest.mark.parametrize("method", METHODS)
def test_a_loop_stays_closed(tmp_path: Path, method: str) -> None:
    (row,) = broken(hangs(tmp_path, method))
    assert row.value < 1e-14
    assert row.verdict == "pass"


def test_a_loop_that_comes_apart_fails_by_its_gap(tmp_path: Path) -> None:
    """With the wrong sign the bar's end is off by its length of 0.6 m times twice the sine of the angle."""
    (row,) = broken(hangs(tmp_path, bar=1.0))
    assert row.value == pytest.approx(0.6 * 2 * np.sin(np.sin(1.0)), rel=1e-9)
    assert (row.subject, row.unit, row.verdict) == ("equality 0 (bar and right)", "m", "fail")


def test_nothing_is_said_where_a_pose_is_not_known(tmp_path: Path) -> None:
    assert broken(hangs(tmp_path, right=0.0)) == []


GEAR = """<mujoco><option gravity="0 0 0"/><worldbody>
  <body><joint name="a" axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
  <body pos="1 0 0"><joint name="b" axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
  <body name="one" pos="0 1 0"><joint name="c" axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
  <body name="two" pos="0 1 0"><joint name="d" axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
  </worldbody><equality><joint name="gear" joint1="b" joint2="a" polycoef="0 0.5 0 0 0"/>
  <weld name="clutch" body1="one" body2="two" torquescale="3"/></equality></mujoco>"""


def test_gears_and_welds_are_measured_in_radians(tmp_path: Path) -> None:
    (tmp_path / "gear.xml").write_text(GEAR)
    time = np.linspace(0, 1, 11)
    turn = [Channel.smooth(time), Channel.smooth(1 + 0 * time), Channel.smooth(0 * time)]
    shares = {"a": 1.0, "b": 0.4, "c": 0.3, "d": 0.1}
    replay = [ReplayChannel("joint", (n,), *(scaled(c, s) for c in turn)) for n, s in shares.items()]
    found = broken(solution_of("trapezoidal", time, {}, replay, model="gear.xml", directory=str(tmp_path)))
    values = {(m.subject, m.unit): m.value for m in found}
    assert values["equality gear", "rad"] == pytest.approx(0.1)
    assert values["equality clutch", "rad"] == pytest.approx(0.2)
    assert values["equality clutch", "m"] == pytest.approx(0.0, abs=1e-12)
