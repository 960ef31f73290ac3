"""The open-loop replay against motions known in closed form."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
from closed_form_motions import constant, particle, smooth_particle, waypoint_spline

import stc
from stc.errors import UsageError
from stc.solution import Solution
from stc.trajectory import Channel, FloatArray
from stc.validate import validate
from stc.validate.replay import stepping_for
from stc.validate.robustness import robustness
from stc.validate.setup import prepare


def largest_drift(solution: Solution, **options: object) -> float:
    """The worst open-loop drift over all joints, in m or rad."""
    report = validate(solution, tracked=False, **options)  # type: ignore[arg-type]
    return max(metric.value for metric in report.metrics if metric.name == "open-loop drift, largest")


@pytest.mark.daily_every(3)
@pytest.mark.parametrize("g", [0.0, 1.62, 9.8])
@pytest.mark.parametrize("m", [1.0, 3.0])
def test_the_waypoint_spline_is_reproduced_under_every_gravity_and_mass(g: float, m: float) -> None:
    """The spline's acceleration is linear between frames: Hermite-Simpson and the replay hold it exactly."""
    x, y = waypoint_spline()
    solution = smooth_particle("hermite-simpson", np.linspace(0, 2, 61), x, y, m=m, g=g)
    report = validate(solution)
    assert report.passed
    assert all(metric.value < 1e-11 for metric in report.metrics if metric.limit is not None)
    assert report.fields == {"body.particle.mass": m, "option.gravity.z": -g}


@pytest.mark.parametrize("method", ["central", "trapezoidal", "hermite-simpson"])
def test_ballistic_flight_needs_no_force(method: str) -> None:
    time = np.linspace(0, 0.8, 17)
    zero = np.zeros_like
    solution = smooth_particle(
        method,
        time,
        [lambda t: 3 * t, lambda t: zero(t) + 3, zero],
        [lambda t: 4 * t - 4.9 * t**2, lambda t: 4 - 9.8 * t, lambda t: zero(t) - 9.8],
    )
    assert np.all(np.abs(solution["fy"]) < 1e-14)
    assert largest_drift(solution) < 1e-12


def test_parabolic_forces_and_uneven_steps_are_exact_under_hermite_simpson() -> None:
    """x'' = 12 t^2 - 6 t gives a quartic, which four stages of Runge-Kutta integrate exactly."""
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.uniform(0.005, 0.1, 25))
    x = [lambda t: t**4 - t**3, lambda t: 4 * t**3 - 3 * t**2, lambda t: 12 * t**2 - 6 * t]
    y = [lambda t: t**2, lambda t: 2 * t, lambda t: np.full_like(t, 2.0)]
    assert largest_drift(smooth_particle("hermite-simpson", time, x, y)) < 1e-12


def bang_bang(method: str, share: float) -> Solution:
    """Force 1 for a share of the frames, then -1; the exact motion is made of two parabolas."""
    time = np.linspace(0, 2, 21)
    switch = round(share * 20)
    v_switch, x_switch = time[switch], 0.5 * time[switch] ** 2

    def x(t: FloatArray) -> FloatArray:
        late = t - time[switch]
        return np.where(late < 0, 0.5 * t**2, x_switch + v_switch * late - 0.5 * late**2)

    def v(t: FloatArray) -> FloatArray:
        return np.where(t < time[switch], t, 2 * v_switch - t)

    frames = np.arange(21)
    before, after = np.where(frames <= switch, 1.0, -1.0), np.where(frames < switch, 1.0, -1.0)
    mid_time = 0.5 * (time[:-1] + time[1:])
    with_mid = method == "hermite-simpson"
    acceleration = Channel(before, after, np.where(frames[:-1] < switch, 1.0, -1.0) if with_mid else None)
    position = Channel.smooth(x(time), x(mid_time) if with_mid else None)
    velocity = Channel.smooth(v(time), v(mid_time) if with_mid else None)
    still = constant(position, 0.0)
    return particle(method, time, [position, velocity, acceleration], [still] * 3)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("share", [0.25, 0.5, 0.7])
@pytest.mark.parametrize("method", ["trapezoidal", "hermite-simpson"])
def test_at_a_jump_each_side_has_its_own_force(method: str, share: float) -> None:
    assert largest_drift(bang_bang(method, share)) < 1e-12


def test_a_jump_read_from_one_side_only_would_show() -> None:
    solution = bang_bang("trapezoidal", 0.5)
    force = solution.replay[2].value
    blurred = Channel(force.after, force.after)
    object.__setattr__(solution.replay[2], "value", blurred)
    assert largest_drift(solution) > 0.05


def trapezoidal_solution(n: int) -> Solution:
    """x'' = sin(3 t) from rest, integrated by the trapezoid rule as the transcription does."""
    time = np.linspace(0, 2, n + 1)
    a = np.sin(3 * time)
    v = np.concatenate([[0], np.cumsum(0.5 * np.diff(time) * (a[1:] + a[:-1]))])
    x = np.concatenate([[0], np.cumsum(0.5 * np.diff(time) * (v[1:] + v[:-1]))])
    still = Channel.smooth(np.zeros(n + 1))
    return particle("trapezoidal", time, [Channel.smooth(c) for c in (x, v, a)], [still] * 3)


def central_solution(n: int, garbage: float) -> Solution:
    """x'' = sin(3 t) from rest by central differences; frames 0 and n have forces that mean nothing."""
    h = 2 / n
    time = np.linspace(0, 2, n + 1)
    a = np.sin(3 * time)
    x = np.zeros(n + 1)
    x[1] = 0.5 * h**2 * a[1]  # so that (-3 x0 + 4 x1 - x2)/2h = 0
    for i in range(1, n):
        x[i + 1] = 2 * x[i] - x[i - 1] + h**2 * a[i]
    v = np.gradient(x, h, edge_order=2)
    assert abs(v[0]) < 1e-12
    a[0], a[-1] = garbage, garbage
    still = Channel.smooth(np.zeros(n + 1))
    return particle("central", time, [Channel.smooth(c) for c in (x, v, a)], [still] * 3)


def test_trapezoidal_is_replayed_at_second_order() -> None:
    drifts = [largest_drift(trapezoidal_solution(n)) for n in (60, 120, 240)]
    orders = -np.diff(np.log2(drifts))
    assert np.all((orders > 1.9) & (orders < 2.1))


def test_central_is_replayed_at_second_order_whatever_the_clipped_frames_hold() -> None:
    drifts = [largest_drift(central_solution(n, garbage=0.0)) for n in (60, 120, 240)]
    orders = -np.diff(np.log2(drifts))
    assert np.all(orders > 1.9)
    assert largest_drift(central_solution(60, garbage=1e3)) == drifts[0]


def test_the_file_is_all_that_a_replay_needs(tmp_path: object) -> None:
    path = f"{tmp_path}/spline.npz"
    stc.load("particle_waypoints").solve(n=40).save(path)
    assert largest_drift(path) < 1e-12  # type: ignore[arg-type]


def test_time_steps_divide_the_frames() -> None:
    x, y = waypoint_spline()
    solution = smooth_particle("hermite-simpson", np.linspace(0, 2, 61), x, y)
    report = validate(solution, time_step=0.01)
    assert report.time_step == pytest.approx(2 / 60 / 4)
    assert report.steps == 240
    report = validate(solution, time_step=1 / 300)
    assert report.steps == 600
    fine = smooth_particle("hermite-simpson", np.linspace(0, 0.02, 21), x, y)
    assert validate(fine).steps == 80


def test_mujoco_s_own_integrators_can_be_asked_for() -> None:
    x, y = waypoint_spline()
    solution = smooth_particle("hermite-simpson", np.linspace(0, 2, 61), x, y)
    assert 1e-6 < largest_drift(solution, integrator="euler", time_step=1e-3) < 1e-1
    assert validate(solution, integrator="implicitfast").integrator == "implicitfast"
    with pytest.raises(UsageError, match="unknown integrator 'rk5'; known are rk4, euler"):
        validate(solution, integrator="rk5")
    with pytest.raises(UsageError, match="must be positive"):
        validate(solution, time_step=0.0)


def test_a_simulation_that_breaks_down_fails_and_says_when() -> None:
    x, y = waypoint_spline()
    solution = smooth_particle("hermite-simpson", np.linspace(0, 2, 21), x, y, m=1e-6)
    solution.replay[2].value.before[10] = 9e9
    report = validate(solution)
    assert not report.passed
    assert report.metrics[0].value == math.inf
    assert report.to_dict()["metrics"][0]["value"] is None
    assert any("left all bounds by t = 1 s" in note for note in report.notes)


FINGER = """
<mujoco>
  <option integrator="implicitfast" timestep="0.001"/>
  <worldbody>
    <body name="finger">
      <joint name="bend" axis="0 1 0" damping="0.02"/>
      <inertial pos="0 0 0" mass="0.01" diaginertia="3.5e-6 3.5e-6 3.5e-6"/>
    </body>
  </worldbody>
  <actuator><motor name="pull" joint="bend"/></actuator>
</mujoco>
"""
BEND = """
constants: n = 40, T = 0.5, h = T/n, I = 3.5e-6, c = 0.02;
variables: q, u;
constraints: [0, n]: I*q'' = u - c*q'; [0]: q; q'; [n]: q = 1; q';
objective: [0, n]: integral(q''^2);
method: hermite-simpson;
replay: model = "finger.xml"; joint bend = q; actuator pull = u;
"""


def test_a_joint_that_a_damper_stops_at_once_is_simulated_in_short_steps(tmp_path: Path) -> None:
    """It loses its speed within I/c = 0.18 ms: steps of 1 ms would blow up, whatever the solution."""
    (tmp_path / "finger.xml").write_text(FINGER)
    (tmp_path / "bend.stc").write_text(BEND)
    solution = stc.load(tmp_path / "bend.stc").solve()
    report = validate(solution)
    assert report.passed
    assert report.time_step <= 3.5e-6 / 0.02
    setup = prepare(solution)
    assert stepping_for(setup, 1e-3).time_step == pytest.approx(3.5e-6 / 0.02, rel=1e-6)
    assert stepping_for(setup, 1e-5) == (1e-5, 1e-5, "rk4")
    assert stepping_for(setup, 1e-3).integrator == "rk4"
    setup.compiled.dof_damping[:] = 20.0
    assert stepping_for(setup, 1e-3) == (1e-3 / 64, 1e-3 / 64, "implicitfast")
    assert stepping_for(setup, 1e-3, "euler").integrator == "euler"
    setup.compiled.dof_damping[:] = 0.0
    assert stepping_for(setup, 1e-3).time_step == 1e-3
    # A servo damps as well.
    setup.compiled.actuator_biastype[:] = mujoco.mjtBias.mjBIAS_AFFINE
    setup.compiled.actuator_biasprm[:, 2] = -0.02
    assert stepping_for(setup, 1e-3).time_step == pytest.approx(3.5e-6 / 0.02, rel=1e-6)


def test_perturbed_replays_of_a_stiff_servo_are_simulated_implicitly(tmp_path: Path) -> None:
    """Euler's method, which the model asks for, would treat the servo's damping explicitly and break down."""
    servo = '<general name="pull" joint="bend" biastype="affine" biasprm="0 0 -20"/>'
    model = FINGER.replace('<motor name="pull" joint="bend"/>', servo).replace('damping="0.02"', "")
    (tmp_path / "finger.xml").write_text(model.replace("implicitfast", "Euler"))
    (tmp_path / "bend.stc").write_text(BEND.replace("c = 0.02", "c = 20"))
    perturbed = robustness(prepare(stc.load(tmp_path / "bend.stc").solve()), 1, kinds=["none"])
    assert perturbed.integrator == "implicitfast"
    assert perturbed.envelopes[0].joints[0] < 1e-6
