"""Which kind of stationary point a solution is, where both sides are nothing, and what a judge says of it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stc
from stc.cli.main import run
from stc.solution_claims import judge

PROBLEMS = Path(__file__).parents[1] / "problems" / "complementarity"


@pytest.mark.parametrize(
    ("name", "strong", "degenerate"),
    [
        ("bard1", True, False),
        ("scholtes3", True, False),  # away from the C-stationary point at which it starts
        ("ralph2", True, True),
        ("ralph1", False, True),  # known to be B-stationary, and not strongly so
        ("scholtes4", False, True),
    ],
)
def test_known_kinds(name: str, strong: bool, degenerate: bool) -> None:
    found = stc.load(str(PROBLEMS / "static" / f"{name}.stc")).solve().complementarity()
    assert found is not None
    assert (found.stationarity == "strong") == strong
    assert found.b_stationary is True
    assert bool(found.degenerate) == degenerate
    assert found.residual <= 1e-6


@pytest.mark.parametrize(
    ("objective", "kind", "b_stationary"),
    [
        ("x + y", "strong", True),
        ("(x - 1)^2 + (y - 1)^2", "C", False),
        ("(x - 1)^2 + y^3 + y^2", "M", False),  # Leyffer & Munson 2007: better points are along x
        ("x - y", "weak", False),
        ("x - 0*y - z", "strong", True),
        ("1e-3*((x - 1)^2 + y^2)", "M", False),
    ],
)
@pytest.mark.parametrize("weight", [0.0, 1e6])
def test_at_the_corner(objective: str, kind: str, b_stationary: bool, weight: float) -> None:
    """``x = y = 0``, whatever the solver says of the product's multiplier."""
    model = stc.load(f"""
    constants: n = 0; variables: x, y, z;
    constraints: 0 <= x complements y >= 0; z = 0;
    objective: {objective};
    """)
    solution = model.solve(max_iterations=0)
    count = len(solution.row_multipliers)
    made = replace(solution, status="optimal", x=np.zeros(3), row_multipliers=np.full(count, weight))
    made.origin = model
    found = made.complementarity()
    assert found is not None
    assert (found.stationarity, found.b_stationary) == (kind, b_stationary)
    assert [one.frames for one in found.degenerate] == [[]]


def test_a_force_in_small_units_hides_no_better_point() -> None:
    """A ball whose free fall reaches the floor exactly at the end of a step, and that ought to begin higher.

    It may: it then lands a step later.  Its force at that landing is 1e4 times as large as its height.
    """
    steps, size, g = 30, 0.01, 9.81
    height = g * size**2 * steps * (steps + 1) / 2
    spec = f"""
    constants: n = 40, h = {size};
    variables: y, v, p;
    constraints:
      [1, n]: v - v[i-1] = h*(p - {g}); y - y[i-1] = h*v; 0 <= y complements p >= 0;
      [0]: v = 0; p = 0;
    objective: [0]: 0.1*(y - {height} - 1)^2;
    """
    model = stc.load(spec)
    solution = model.solve(max_iterations=0)
    frames = np.arange(41)
    fall = np.maximum(0.0, height - g * size**2 * frames * (frames + 1) / 2)
    fall[steps:] = 0.0
    speed = np.append(0.0, np.diff(fall) / size)
    force = np.append(0.0, np.diff(speed) / size + g)
    force[: steps + 1] = 0.0
    x = np.column_stack([fall, speed, force]).ravel()
    made = replace(solution, status="optimal", x=x)
    made.origin = model
    found = made.complementarity()
    assert found is not None and found.residual < 1e-9
    assert found.b_stationary is False
    assert [one.frames for one in found.degenerate] == [[float(steps)]]


def test_degenerate_frames_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A weightless ball lies on the floor for four frames, neither above it nor pushed, and is lifted then."""
    spec = tmp_path / "still.stc"
    spec.write_text("""
    constants: n = 6, h = 0.1;
    variables: y, f;
    constraints:
      [0, n]: 0 <= y complements f >= 0;
      [0, 3]: y <= 2*f;
      [4, n]: y >= f + 1;
    objective: (f + 1)^2 + (y + 1)^2;
    """)
    assert run(["solve", str(spec), "-o", str(tmp_path / "a.npz"), "--json"]) == 0
    record = json.loads(capsys.readouterr().out.splitlines()[-1])["complementarity"]
    assert record["stationarity"] == "strong" and record["b_stationary"] is True
    assert [one["frames"] for one in record["degenerate"]] == [[0.0, 1.0, 2.0, 3.0]]
    assert run(["solve", str(spec), "-o", str(tmp_path / "a.npz")]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "B-stationary" in told and "at frames 0-3" in told


def test_a_judge_asks_for_complementarity() -> None:
    """Where both sides are open, products may still be small."""
    solution = stc.load(str(PROBLEMS / "motions" / "ball.stc")).solve()
    assert not judge(solution).faults
    x = solution.x.copy()
    names = {"y": 0, "v": 1, "p": 2}
    x[3 * 10 + names["p"]] = 5e-6  # in flight
    forged = replace(solution, x=x)
    faults = judge(forged).faults
    assert any("is not complementary at frame 10" in fault and "5e-06" in fault for fault in faults)


def test_without_pairs_there_is_nothing_to_tell() -> None:
    assert stc.load("particle_waypoints").solve().complementarity() is None
