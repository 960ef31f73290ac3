"""Verdicts and how they are told."""

from __future__ import annotations

import dataclasses
import io
import json
import math

import numpy as np
import pytest
from closed_form_motions import smooth_particle, waypoint_spline
from rich.console import Console

from stc.solution import ReplayChannel, Solution
from stc.trajectory import Channel
from stc.validate import Metric, NotOptimalError, Report, limits, validate
from stc.validate.metrics import drift
from stc.validate.ties import Coordinate


def spline(**more: object) -> Solution:
    x, y = waypoint_spline()
    return smooth_particle("hermite-simpson", np.linspace(0, 2, 21), x, y, **more)


def test_a_limit_decides_a_metric() -> None:
    assert Metric("drift", "joint x", 1e-5, "m", 1e-4).verdict == "pass"
    assert Metric("drift", "joint x", 1e-4, "m", 1e-4).verdict == "pass"
    assert Metric("drift", "joint x", 2e-4, "m", 1e-4).verdict == "fail"
    assert Metric("drift", "joint x", math.nan, "m", 1e-4).verdict == "fail"
    assert Metric("drift", "joint x", math.inf, "m", 1e-4).verdict == "fail"
    assert Metric("drift", "joint x", 1.0, "m").verdict == "info"


def test_a_report_passes_on_all_limits_and_never_on_none() -> None:
    report = validate(spline())
    good, bad, info = (Metric("a", "b", value, "m", limit) for value, limit in ((0, 1), (2, 1), (2, None)))
    assert dataclasses.replace(report, metrics=[good, info]).passed
    assert not dataclasses.replace(report, metrics=[good, bad]).passed
    assert not dataclasses.replace(report, metrics=[info]).passed
    assert not dataclasses.replace(report, metrics=[]).passed


def test_drift_takes_the_nearer_side_of_a_jump() -> None:
    solved = Channel(np.array([0.0, 1.0, 5.0]), np.array([0.0, 3.0, 5.0]))
    tie = Coordinate("x", 0, (1, 0), "m", ReplayChannel("joint", ("x",), solved, solved))
    for value, expected in ((2.9, (0.1, 0.1 / math.sqrt(3))), (math.nan, (math.inf, math.inf))):
        positions = np.array([[9.0, 0.0], [9.0, value], [9.0, 5.0]])
        assert drift(tie.distances(positions)) == pytest.approx(expected)


def test_the_report_says_what_produced_it() -> None:
    import mujoco

    solution = spline(name="waypoints")
    report = validate(solution)
    found = json.loads(json.dumps(report.to_dict(), allow_nan=False))
    assert found["passed"] is True
    assert found["spec"] == "waypoints"
    assert found["spec_sha256"] == solution.sha256
    assert found["method"] == "hermite-simpson"
    assert found["simulator"] == f"MuJoCo {mujoco.__version__}"
    assert found["integrator"] == "rk4"
    assert found["model_integrator"] == "rk4"
    assert found["model"] == "particle.xml"
    assert len(found["model_sha256"]) == 64
    assert found["time_step"] == pytest.approx(limits.TIME_STEP)
    assert found["steps"] == 2000
    assert found["seconds"] > 0
    names = [(m["name"], m["subject"], m["unit"], m["verdict"]) for m in found["metrics"]]
    assert names == [
        ("open-loop drift, largest", "joint x", "m", "pass"),
        ("open-loop drift, RMS", "joint x", "m", "info"),
        ("open-loop drift, largest", "joint z", "m", "pass"),
        ("open-loop drift, RMS", "joint z", "m", "info"),
        ("growth of small errors", "motion", "times", "info"),
        ("tracked drift, largest", "joint x", "m", "pass"),
        ("tracked drift, largest", "joint z", "m", "pass"),
        ("feedback share", "actuator fx", "share", "pass"),
        ("feedback share", "actuator fz", "share", "pass"),
        ("inverse-dynamics residual", "joint x", "share", "pass"),
        ("inverse-dynamics residual", "joint z", "share", "pass"),
        ("residual between frames", "joint x", "share", "pass"),
        ("residual between frames", "joint z", "share", "pass"),
        ("energy balance", "work against energy", "share", "pass"),
    ]
    assert found["tracked_by"] == "LQR"
    assert found["metrics"][0]["limit"] == limits.OPEN_LOOP_DRIFT["hermite-simpson"]


def shown(report: Report) -> str:
    stream = io.StringIO()
    Console(file=stream, width=120, color_system=None).print(report)
    return stream.getvalue()


def test_the_table_reads_well() -> None:
    text = shown(validate(spline(name="waypoints")))
    assert "waypoints, hermite-simpson, n = 20, 2 s: replayed in MuJoCo 4" in text
    assert "0.0001 m" in text
    assert text.rstrip().endswith("passed")
    heavier = spline(name="waypoints")
    heavier.replay = [line for line in heavier.replay if line.kind != "set"]
    heavier.replay[3].value.after[5] += 1.0
    text = shown(validate(heavier))
    assert "fail" in text
    assert text.rstrip().endswith("failed")


@pytest.mark.parametrize("status", ["infeasible", "iteration_limit", "interrupted", "failed"])
def test_only_optimal_solutions_are_judged_unless_forced(status: str) -> None:
    solution = spline(status=status)
    with pytest.raises(NotOptimalError, match=f"its status is {status}, not optimal"):
        validate(solution)
    report = validate(solution, force=True, tracked=False)
    assert report.passed
    assert report.status == status
    assert f"the solution is not optimal: {status}" in report.notes
