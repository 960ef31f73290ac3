"""Which kind of stationary point a solution is, where both sides are nothing, and what a judge says of it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import stc
from stc.cli import run
from stc.judging import judge

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
        ("x - y", "weak", False),
        ("x - 0*y - z", "strong", True),
    ],
)
def test_at_the_corner(objective: str, kind: str, b_stationary: bool) -> None:
    """``x = y = 0`` by hand, with the multipliers that balance the objective's slopes there."""
    spec = f"""
    constants: n = 0; variables: x, y, z;
    constraints: 0 <= x complements y >= 0; z = 0;
    objective: {objective};
    """
    model = stc.load(spec)
    solution = model.solve(max_iterations=0)
    slope = {"x": 0.0, "y": 0.0, "z": 0.0}
    for name in slope:
        at = {key: 1e-6 * (key == name) for key in slope}
        value = eval(objective.replace("^", "**"), {}, at)
        slope[name] = (value - eval(objective.replace("^", "**"), {}, dict.fromkeys(slope, 0.0))) / 1e-6
    made = replace(
        solution,
        status="optimal",
        x=np.zeros(3),
        row_multipliers=np.zeros(len(solution.row_multipliers)),
        bound_multipliers=-np.array([slope["x"], slope["y"], slope["z"]]),
    )
    made.origin = model
    found = made.complementarity()
    assert found is not None
    assert (found.stationarity, found.b_stationary) == (kind, b_stationary)
    assert [one.frames for one in found.degenerate] == [[]]


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
