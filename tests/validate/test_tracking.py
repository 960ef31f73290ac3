"""Linearisation, growth and feedback against linear systems whose answers are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import constant, scaled, smooth_particle, waypoint_spline
from pendulums import GRAVITY, INERTIA, LENGTH, held, pendulum, weight

from stc.solution import Solution
from stc.validate import Report, limits, validate
from stc.validate.linearisation import growth, linearise, linearised
from stc.validate.model import ModelError
from stc.validate.setup import prepare
from stc.validate.tracking import proportional, regulator

RATE = np.sqrt(GRAVITY / LENGTH)


def values(report: Report, name: str) -> dict[str, float]:
    return {metric.subject: metric.value for metric in report.metrics if metric.name == name}


def particle(n: int = 40, mass: float = 2.0) -> Solution:
    x, y = waypoint_spline()
    return smooth_particle("hermite-simpson", np.linspace(0, 2, n + 1), x, y, m=mass)


def standing(folder: Path, angle: float, duration: float = 1.0, error: float = 0.0, n: int = 20) -> Solution:
    """The pendulum held at an angle; ``error`` is what the torque is wrong by."""
    torque = weight(angle) + error
    return pendulum(folder, np.linspace(0, duration, n + 1), held(angle), lambda t: 0 * t + torque)


def test_the_linear_map_of_a_particle_is_that_of_newtons_law() -> None:
    maps = linearise(prepare(particle()))
    assert len(maps.step) == maps.first[-1] == 1000
    assert maps.step.sum() == pytest.approx(2.0)
    h = maps.step[0]
    expected = np.eye(4) + h * np.eye(4, k=2)
    np.testing.assert_allclose(maps.state[500], expected, atol=1e-8)
    # MuJoCo's Euler step moves positions with the new velocities.
    np.testing.assert_allclose(
        maps.control[500], np.vstack([h**2 / 2 * np.eye(2), h / 2 * np.eye(2)]), atol=1e-8
    )
    np.testing.assert_array_equal(
        maps.index(3, np.array([0.0, 0.03, 0.04, 0.999])), maps.first[3] + [0, 0, 1, 24]
    )


def test_growth_is_what_the_linear_equation_says(tmp_path: Path) -> None:
    assert growth(linearise(prepare(particle()))) == pytest.approx(1.0, abs=1e-6)
    # Upright: deviations go like cosh; hanging: like cos, never growing.
    upright = growth(linearise(prepare(standing(tmp_path, np.pi, 1.0))))
    assert upright == pytest.approx(np.cosh(RATE), rel=0.02)
    assert growth(linearise(prepare(standing(tmp_path, 0.0, 1.0)))) == pytest.approx(1.0, abs=0.02)


def test_the_regulators_gain_is_that_of_the_riccati_equation() -> None:
    """Far from the end, for m x'' = u with weights q1, q2 and r: k1 = sqrt(q1/r), k2 = sqrt(q2/r + 2 m k1)."""
    solution = particle(mass=2.0)
    setup = prepare(solution)
    law = regulator(setup, linearise(setup))
    assert law is not None
    assert law.kind == "LQR"
    gains = law.gains(2, np.array([0.5]))[0]
    for axis, channel in enumerate(setup.controls.channels):
        r = 1.0 / (limits.TRACKING_CONTROL * np.abs(channel.before).max()) ** 2
        q1 = 1.0 / limits.TRACKING_POSITION**2
        q2 = q1 / limits.TRACKING_RATE**2
        k1 = np.sqrt(q1 / r)
        k2 = np.sqrt(q2 / r + 2 * 2.0 * k1)
        assert gains[axis, axis] == pytest.approx(k1, rel=0.05)
        assert gains[axis, 2 + axis] == pytest.approx(k2, rel=0.05)
        assert gains[axis, 1 - axis] == pytest.approx(0.0, abs=1e-6 * k1)


def test_the_regulator_spends_of_an_idle_motor_what_it_is_judged_by() -> None:
    """A particle that moves up and down: to a tolerable deviation aside it answers less than the judge allows."""
    still = [lambda t: 0.0 * t] * 3
    rising = waypoint_spline()[1]
    setup = prepare(smooth_particle("hermite-simpson", np.linspace(0, 2, 41), still, rising, m=2.0))
    law = regulator(setup, linearise(setup))
    assert law is not None
    idle, used = [np.abs(channel.before).max() for channel in setup.controls.channels]
    assert idle < 1e-9 < used
    answer = law.gains(20, np.array([0.5]))[0][0, 0] * limits.TRACKING_POSITION
    assert 0.0 < answer < limits.FEEDBACK_SHARE["trapezoidal"] * limits.HARDLY_USED * used


def test_feedback_supplies_what_the_solution_lacks(tmp_path: Path) -> None:
    """A torque that is one part in 500 short: the feedback's share is that part, and the pendulum stays."""
    needed = weight(np.pi / 2)
    report = validate(standing(tmp_path, np.pi / 2, 2.0, error=-0.002 * needed))
    assert report.tracked_by == "LQR"
    assert values(report, "feedback share")["actuator torque"] == pytest.approx(0.002, rel=0.1)
    assert values(report, "tracked drift, largest")["joint pivot"] < 1e-3
    assert values(report, "open-loop drift, largest")["joint pivot"] > 0.01


def test_unstable_motions_are_judged_by_the_tracked_replay(tmp_path: Path) -> None:
    """Upright for 2 s small errors grow 900 times: drift is told but not held against the solution."""
    report = validate(standing(tmp_path, np.pi, 2.0, error=1e-4))
    (drift, _) = (m for m in report.metrics if m.name.startswith("open-loop drift"))
    assert drift.value > 10 * limits.OPEN_LOOP_DRIFT["hermite-simpson"]
    assert drift.verdict == "info"
    assert any("unstable: along this motion small errors grow up to" in note for note in report.notes)
    assert values(report, "growth of small errors")["motion"] == pytest.approx(np.cosh(2 * RATE), rel=0.05)
    # The same error in a stable motion is held against it.
    stable = validate(standing(tmp_path, 0.0, 2.0, error=2e-3))
    assert next(m for m in stable.metrics if m.name.startswith("open-loop")).verdict == "fail"
    assert not any("unstable" in note for note in stable.notes)


def test_an_unstable_motion_with_wrong_forces_fails_all_the_same(tmp_path: Path) -> None:
    report = validate(standing(tmp_path, np.pi, 2.0, error=0.3))
    assert not report.passed
    failed = {metric.name for metric in report.metrics if metric.verdict == "fail"}
    assert "inverse-dynamics residual" in failed
    assert "feedback share" in failed


def test_a_proportional_law_where_a_joint_is_not_tied(tmp_path: Path) -> None:
    """The regulator needs to know how everything moves; what is tied can still be tracked."""
    more = '<body><joint name="spare" type="slide"/><geom size="0.01" contype="0" conaffinity="0"/></body>'
    error = -0.01 * weight(1.0)
    time = np.linspace(0, 1, 11)
    solution = pendulum(tmp_path, time, held(1.0), lambda t: 0 * t + weight(1.0) + error, more=more)
    setup = prepare(solution)
    law = proportional(setup)
    assert law is not None
    gains = law.gains(0, np.array([0.0]))[0, 0]
    stiffness = INERTIA * limits.PD_RATE**2
    np.testing.assert_allclose(
        gains, [stiffness, 2 * limits.PD_DAMPING * INERTIA * limits.PD_RATE], rtol=1e-9
    )
    report = validate(solution)
    assert report.tracked_by == "PD"
    # At rest the spring of the law carries the error, stiffened by gravity's own; on its way there it overshoots.
    stiff = stiffness + INERTIA * GRAVITY / LENGTH * np.cos(1.0)
    damping = limits.PD_DAMPING * np.sqrt(stiffness / stiff)
    expected = abs(error) / stiff * (1.0 + np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2)))
    assert values(report, "tracked drift, largest")["joint pivot"] == pytest.approx(expected, rel=0.01)
    assert values(report, "growth of small errors") == {"motion": pytest.approx(1.0, abs=1e-6)}


def test_a_motion_without_actuators_is_not_tracked(tmp_path: Path) -> None:
    report = validate(pendulum(tmp_path, np.linspace(0, 1, 11), held(0.0), None))
    assert report.tracked_by == ""
    assert not values(report, "feedback share")
    assert report.passed


def test_a_model_that_mujoco_does_not_differentiate_is_judged_without_that(tmp_path: Path) -> None:
    solution = standing(tmp_path, 0.4)
    assert linearised(prepare(solution)) is not None
    model = tmp_path / "pendulum.xml"
    flag = '<flag sleep="enable"/></option>'
    model.write_text(
        model.read_text().replace(f'gravity="0 0 -{GRAVITY}"/>', f'gravity="0 0 -{GRAVITY}">{flag}')
    )
    setup = prepare(solution)
    assert linearised(setup) is None
    with pytest.raises(ModelError, match=r"not linearised: .*sleep"):
        linearise(setup)
    report = validate(solution)
    assert report.passed
    assert not values(report, "growth of small errors")


def test_an_actuator_that_is_hardly_used_is_measured_against_the_others() -> None:
    x, y = waypoint_spline()
    solution = smooth_particle("hermite-simpson", np.linspace(0, 2, 41), x, y, g=0.0)
    still = scaled(solution.replay[0].value, 0.0)
    for line in (solution.replay[1],):
        for part in ("value", "rate", "acceleration"):
            object.__setattr__(line, part, still)
    object.__setattr__(solution.replay[3], "value", constant(still, 0.0))
    report = validate(solution)
    assert values(report, "feedback share")["actuator fz"] < 1e-9
    assert report.passed
