"""Swing-ups with weak motors, on models by others, from pages that give no guess."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import stc

#: A pendulum of 1 kg at 0.5 m that its motor, of 1 N m, cannot lift in one go: the weight takes up to 4.9 N m.
PENDULUM = """constants: n = 100, T = {T}, h = T/n;
variables: q, u;
constraints:
  [0, n]: 0.25*q'' = u - 4.905*sin(q) - 0.1*q';
          -1 <= u <= 1;
  [0]: q; q';
  [n]: q = pi; q';
objective: [0, n]: integral(u^2);
method: hermite-simpson;
"""

PAGE = """constants: n = 80, T = {T}, h = T/n;
model: "{model}";
constraints:
  [0]: {start}; rest;
  [n]: {end}; rest;
objective: [0, n]: integral(effort);
"""


def _file(package: str, path: str) -> Path:
    found = importlib.util.find_spec(package)
    if found is None or found.origin is None:
        pytest.skip(f"{package} is not installed")
    return Path(found.origin).parent / path


def test_a_weak_motor_swings_the_pendulum_several_times() -> None:
    """Pushing with all its might along its velocity, the motor takes 7.0 s (by integration): 10 s are enough."""
    solution = stc.load(PENDULUM.format(T=10)).solve()
    assert solution.status == "optimal"
    turns = int((np.diff(np.sign(solution["q'"][1:-1])) != 0).sum())
    assert turns >= 3


def test_a_free_duration_is_found_as_well() -> None:
    """It is not that of one swing, which takes the pendulum half of its period of 1.4 s; there are several optima."""
    page = (
        PENDULUM.format(T=8)
        .replace("T = 8, h", "h")
        .replace("h = T/n;", "", 1)
        .replace("n = 100, ", "n = 80;")
    )
    page = page.replace("variables:", "parameters: T;\ndefinitions: h = T/n;\nvariables:")
    page = page.replace("integral(u^2)", "integral(0.001*u^2); [0]: T") + "guess: T = 4;\n"
    solution = stc.load(page).solve()
    assert solution.status == "optimal"
    assert 3.0 < solution.parameters["T"] < 15.0


def test_what_is_too_fast_stays_infeasible() -> None:
    assert stc.load(PENDULUM.format(T=3)).solve().status == "infeasible"


def test_iterations_of_all_parts_are_within_the_limit() -> None:
    whole = stc.load(PENDULUM.format(T=10)).solve()
    for most in (5, whole.iterations // 2):
        cut = stc.load(PENDULUM.format(T=10)).solve(max_iterations=most)
        assert cut.iterations <= most


@pytest.mark.daily_every(3)
@pytest.mark.parametrize(
    ("package", "path", "T", "start", "end"),
    [
        ("dm_control", "suite/cartpole.xml", 3, "joint.slider; joint.hinge_1 = pi", "joint.slider; joint.hinge_1"),
        ("dm_control", "suite/cartpole.xml", 5, "joint.slider; joint.hinge_1 = pi", "joint.slider; joint.hinge_1"),
        ("dm_control", "suite/pendulum.xml", 10, "joint.hinge = pi", "joint.hinge"),
        (
            "gymnasium",
            "envs/mujoco/assets/inverted_double_pendulum.xml",
            3,
            "joint.slider; joint.hinge = pi; joint.hinge2",
            "joint.slider; joint.hinge; joint.hinge2",
        ),
    ],
)  # fmt: skip
def test_models_by_others_swing_up(package: str, path: str, T: float, start: str, end: str) -> None:
    page = PAGE.format(T=T, model=_file(package, path).as_posix(), start=start, end=end)
    assert stc.load(page).solve().status == "optimal"
