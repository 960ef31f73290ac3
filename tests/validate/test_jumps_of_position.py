"""A body that is set aside at a frame is not a motion, however little it is and whatever the limits of a drift."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import nodes, particle, solution_of

from stc.solution import ReplayChannel, Solution
from stc.trajectory import Channel
from stc.validate import validate
from stc.validate.certificate import certify

WHEEL = """<mujoco><option gravity="0 0 0"/><worldbody><body name="wheel">
  <joint name="turn" axis="0 1 0" {joint}/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>
  <actuator><motor name="torque" joint="turn"/></actuator></mujoco>"""


def stepped(method: str, time: np.ndarray, at: int, rate: float, jump: float) -> list[Channel]:
    """Steady motion that is ``jump`` further on from frame ``at`` on: its value, rate and acceleration."""
    smooth = rate * time
    before, after = smooth + jump * (np.arange(len(time)) > at), smooth + jump * (np.arange(len(time)) >= at)
    mid = 0.5 * (after[:-1] + before[1:]) if method == "hermite-simpson" else None
    constant = nodes(method, time, lambda t: rate + 0 * t)
    return [Channel(before, after, mid), constant, nodes(method, time, lambda t: 0 * t)]


def glides(method: str, jump: float) -> Solution:
    time = np.linspace(0, 2, 41)
    x, y = stepped(method, time, 20, 1.0, jump), stepped(method, time, 20, 0.0, 0.0)
    return particle(method, time, x, y, g=0.0, violation=0.0, optimality=0.0)


@pytest.mark.parametrize(
    ("method", "jump"), [("trapezoidal", 9e-3), ("hermite-simpson", 9e-5), ("trapezoidal", -1e-7)]
)
def test_a_jump_that_no_drift_shows_fails(method: str, jump: float) -> None:
    report = validate(glides(method, jump))
    rows = {m.subject: m for m in report.metrics if m.name == "jump of position"}
    assert rows["joint x"].value == pytest.approx(abs(jump), rel=1e-6)
    assert rows["joint z"].value == 0.0
    assert rows["joint x"].verdict == "fail"
    assert all(m.verdict != "fail" for m in report.metrics if "drift" in m.name)


def test_it_comes_first_and_has_a_step_of_its_own() -> None:
    certificate = certify(glides("hermite-simpson", 0.05))  # far enough for the drift to fail
    assert certificate.headline.startswith("joint x: jump of position 0.05 m")
    (step,) = certificate.next_steps
    assert step.startswith("state that the position does not jump")


@pytest.mark.parametrize("jump", [0.0, 1e-12])
def test_rounding_is_no_jump(jump: float) -> None:
    report = validate(glides("trapezoidal", jump))
    assert report.passed
    assert any(m.name == "jump of position" for m in report.metrics) == (jump != 0.0)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(
    ("joint", "at", "jump", "passes"),
    [
        ("", 20, 2 * np.pi, True),  # a whole turn at the end, where nothing follows
        ("", 20, 2.0, False),
        ("", 10, 2 * np.pi, False),  # inside, where the replay goes on counting
        ('limited="true" range="-900 900"', 20, 2 * np.pi, False),  # that joint knows its turns
    ],
)
def test_a_turn_of_a_free_hinge_is_no_jump_at_the_end(
    tmp_path: Path, joint: str, at: int, jump: float, passes: bool
) -> None:
    (tmp_path / "wheel.xml").write_text(WHEEL.format(joint=joint))
    time = np.linspace(0, 2, 21)
    turn = stepped("trapezoidal", time, at, 1.0, jump)
    lines = [ReplayChannel("joint", ("turn",), *turn), ReplayChannel("actuator", ("torque",), turn[2])]
    solution = solution_of("trapezoidal", time, {}, lines, model="wheel.xml", directory=str(tmp_path))
    assert validate(solution).passed == passes
