"""The two particle motions, from bundled text to MuJoCo's verdict, against answers in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import waypoint_spline

import stc
from stc.solution import Solution
from stc.validate import validate


def error(solution: Solution) -> float:
    """Largest distance from the clamped cubic splines over the frames, in m."""
    x, y = waypoint_spline()
    distances = np.stack([solution["x"] - x[0](solution.time), solution["y"] - y[0](solution.time)])
    return float(np.abs(distances).max())


def drift(solution: Solution | Path) -> float:
    """Largest open-loop drift of the replay, in m."""
    return max(m.value for m in validate(solution).metrics if m.name == "open-loop drift, largest")


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("g", [0, 1.62, 9.8])
def test_waypoints_give_the_spline_under_every_gravity(g: float, tmp_path: Path) -> None:
    solution = stc.load("particle_waypoints").solve(g=g)
    assert solution.status == "optimal"
    assert error(solution) < 1e-12
    t = np.linspace(0, 2, 333)
    x, y = waypoint_spline()
    between = solution.at(t)
    np.testing.assert_allclose(between["y"], y[0](t), rtol=0, atol=1e-12)
    np.testing.assert_allclose(between["x'"], x[1](t), rtol=0, atol=1e-11)
    np.testing.assert_allclose(between["fy"], y[2](t) + g, rtol=0, atol=1e-9)
    solution.save(tmp_path / "a.npz")
    assert drift(tmp_path / "a.npz") < 1e-12


def test_a_mass_from_outside_reaches_spec_and_model() -> None:
    one, three = (stc.load("particle_waypoints").solve(m=m) for m in (1, 3))
    np.testing.assert_allclose(three["fx"], 3 * one["fx"], atol=1e-9)
    report = validate(three)
    assert report.fields["body.particle.mass"] == 3.0
    assert report.passed
    three.replay = [line for line in three.replay if line.name != "body.particle.mass"]
    assert not validate(three).passed


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("method", ["central", "trapezoidal"])
def test_second_order_methods_approach_the_spline_and_its_replay(method: str) -> None:
    spec = stc.load("particle_waypoints")
    solutions = [spec.solve(n=n, method=method) for n in (120, 240)]
    for errors in ([error(s) for s in solutions], [drift(s) for s in solutions]):
        assert np.log2(errors[0] / errors[1]) > 1.9
    assert validate(solutions[0]).passed


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("g", [1.62, 9.8])
def test_a_jet_without_wall_and_limit_takes_the_known_time(g: float) -> None:
    """Least integral of force squared over distance d: 12 d^2/T^3 + g^2 T is least at T = sqrt(6 d/g)."""
    solution = stc.load("particle_jet").solve(g=g, top=-1, fmax=1000)
    assert solution.status == "optimal"
    time = np.sqrt(6 * 4 / g)
    # Far closer than the solver has to come, and not as close as it happens to.
    assert solution.parameters["T"] == pytest.approx(time, rel=1e-7)
    assert solution.objective == pytest.approx(1000 / (2 * 10000) * g**2 * time * 4 / 3, rel=1e-7)
    assert drift(solution) < 1e-6


def test_the_jet_clears_the_wall_at_its_limit() -> None:
    """Duration and fuel from an independent statement of the same problem, solved by IPOPT."""
    solution = stc.load("particle_jet").solve()
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(13.51121298, abs=2e-7)
    assert solution.parameters["T"] == pytest.approx(2.15893024, abs=1e-6)
    thrust = np.hypot(solution["fx"], solution["fy"])
    assert thrust.max() == pytest.approx(16, abs=1e-6)
    assert np.sum(thrust > 15.999) > 5
    assert solution["y"][30] == pytest.approx(1.5, abs=1e-7)
    assert validate(solution).passed
