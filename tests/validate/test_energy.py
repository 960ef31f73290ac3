"""The energy balance and the impulses of motions whose books are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import Curve, particle, smooth_particle, waypoint_spline
from pendulums import GRAVITY, INERTIA, LENGTH, MASS, MODEL, held, pendulum, weight

import stc
from stc.solution import ReplayChannel, Solution
from stc.trajectory import Channel, FloatArray
from stc.validate import Report, limits, validate
from stc.validate.energy import energy_balance
from stc.validate.impacts import velocity_jumps
from stc.validate.setup import prepare


def value(report: Report, name: str) -> float:
    return max(metric.value for metric in report.metrics if metric.name == name)


def swing(folder: Path, n: int = 24, factor: float = 1.0, damping: float = 0.3) -> Solution:
    """A damped pendulum swung by its motor; ``factor`` scales the torque's part that moves it."""

    def angle(t: FloatArray) -> FloatArray:
        return np.sin(2 * t) - 0.5

    def torque(t: FloatArray) -> FloatArray:
        gravity = MASS * GRAVITY * LENGTH * np.sin(angle(t))
        return INERTIA * -4 * np.sin(2 * t) * factor + damping * 2 * np.cos(2 * t) + gravity

    curves = [angle, lambda t: 2 * np.cos(2 * t), lambda t: -4 * np.sin(2 * t)]
    return pendulum(
        folder,
        np.linspace(0, 1.2, n + 1),
        curves,
        torque,
        {"set joint.pivot.damping": lambda t: 0 * t + damping},
    )


def test_the_books_of_the_waypoint_spline_close_exactly() -> None:
    """Force linear, velocity quadratic in every step: five Gauss points integrate the power exactly."""
    x, y = waypoint_spline()
    solution = smooth_particle("hermite-simpson", np.linspace(0, 2, 61), x, y, m=3.0)
    balance = energy_balance(prepare(solution))
    assert balance is not None
    assert balance.share < 1e-14
    # The highest point is reached from rest: at least its potential energy is turned over.
    assert balance.turnover >= 3.0 * 9.8 * float(np.ptp(solution.replay[1].value.before))


def test_dampers_and_gravity_are_in_the_books(tmp_path: Path) -> None:
    """What is left is the polynomials' own error, of fourth order."""
    shares = []
    for n in (6, 12, 24):
        balance = energy_balance(prepare(swing(tmp_path, n)))
        assert balance is not None
        shares.append(balance.share)
    assert shares[-1] < 1e-6
    assert np.all(-np.diff(np.log2(shares)) > 3.5)


def test_a_force_that_does_not_fit_the_motion_leaves_a_gap(tmp_path: Path) -> None:
    report = validate(swing(tmp_path, factor=1.02), tracked=False)
    gap = value(report, "energy balance")
    assert gap > limits.ENERGY_BALANCE["hermite-simpson"]
    # 2 % of the kinetic energy that comes and goes, as a share of what is turned over.
    assert 1e-4 < gap < 0.02


def free_flight(method: str, n: int = 24, g: float = 9.8) -> Solution:
    """Thrown, with no force on it: the parabola, exact at every node of every method."""
    time = np.linspace(0, 0.8, n + 1)
    x: list[Curve] = [lambda t: 4 * t, lambda t: 0 * t + 4, lambda t: 0 * t]
    y: list[Curve] = [lambda t: 2 + 3 * t - 0.5 * g * t**2, lambda t: 3 - g * t, lambda t: 0 * t - g]
    return smooth_particle(method, time, x, y, m=0.6, g=g)


def test_what_rests_without_weight_closes_the_books(tmp_path: Path) -> None:
    """All energies, forces and powers are zero, and so is what of them is missing."""
    (tmp_path / "model.xml").write_text(
        """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="turn" axis="0 1 0"/>
        <joint name="x" type="slide"/><geom size=".1" pos=".3 0 0"/></body></worldbody></mujoco>"""
    )
    (tmp_path / "rest.stc").write_text(
        """constants: n = 4, T = 0.1, h = T/n;  model: "model.xml";
        constraints: [0]: joint.turn = 0.7; joint.x = 0.3; rest;  objective: [0, n]: integral(0);"""
    )
    report = validate(stc.load(tmp_path / "rest.stc").solve())
    assert value(report, "energy balance") < 1e-6


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("method", ["hermite-simpson", "trapezoidal", "central"])
@pytest.mark.parametrize("g", [9.8, 0.0])
def test_a_motion_without_work_closes_its_books(method: str, g: float) -> None:
    """Nothing does work and the energy stays what it is: rounding must not be divided by rounding."""
    solution = free_flight(method, g=g)
    balance = energy_balance(prepare(solution))
    assert balance is not None
    assert balance.share < 1e-12
    # What it starts with at least, 0.6 kg at 5 m/s, is in the books.
    assert balance.turnover >= 0.5 * 0.6 * 25 * (1 - 1e-12)
    assert validate(solution).passed


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("method", ["hermite-simpson", "trapezoidal", "central"])
def test_standing_still_closes_the_books(method: str, tmp_path: Path) -> None:
    angle = held(0.4)
    still = pendulum(tmp_path, np.linspace(0, 1, 21), angle, lambda t: 0 * t + weight(0.4), method=method)
    assert validate(still).passed


FREE_PENDULUM = """
constants: n = 80, T = 2, h = T/n;
variables: q;
constraints:
  [0, n]: q'' = -%s*sin(q);
  [0]: q = 1; q';
replay:
  model = "pendulum.xml";
  joint pivot = q;
"""


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("method", ["hermite-simpson", "trapezoidal", "central"])
@pytest.mark.parametrize("missing", ["", 'damping="0.05"', 'stiffness="2"'])
def test_a_free_pendulum_passes_and_one_with_a_term_missing_does_not(
    method: str, missing: str, tmp_path: Path
) -> None:
    model = MODEL.format(more="").replace('<joint name="pivot"', f'<joint name="pivot" {missing}')
    (tmp_path / "pendulum.xml").write_text(model)
    (tmp_path / "free.stc").write_text(FREE_PENDULUM % (MASS * GRAVITY * LENGTH / INERTIA))
    report = validate(stc.load(str(tmp_path / "free.stc")).solve(method=method))
    assert report.passed == (not missing)
    verdicts = {metric.name: metric.verdict for metric in report.metrics}
    assert verdicts["energy balance"] == ("fail" if missing else "pass")
    assert verdicts["inverse-dynamics residual"] == ("fail" if missing else "pass")


def test_a_torque_that_nobody_states_leaves_a_gap_in_a_passive_motion(tmp_path: Path) -> None:
    """The pendulum is swung as its motor would swing it, but the spec has no motor."""
    report = validate(
        pendulum(
            tmp_path,
            np.linspace(0, 1.2, 25),
            [lambda t: np.sin(2 * t) - 0.5, lambda t: 2 * np.cos(2 * t), lambda t: -4 * np.sin(2 * t)],
            None,
        ),
        tracked=False,
    )
    assert value(report, "energy balance") > limits.ENERGY_BALANCE["central"]


def bounce(contact: bool, loss: float = 0.5) -> Solution:
    """A ball falls for 0.4 s and leaves the ground with a part of its speed; ``contact`` names the ground."""
    time = np.linspace(0, 0.8, 17)
    hit, g = 8, 9.8
    speed = g * time[hit]
    fall = 0.5 * g * (time[hit] ** 2 - time**2)
    rise = loss * speed * (time - time[hit]) - 0.5 * g * (time - time[hit]) ** 2
    frames = np.arange(17)
    y = np.where(frames <= hit, fall, rise)
    before = np.where(frames <= hit, -g * time, loss * speed - g * (time - time[hit]))
    after = np.where(frames < hit, -g * time, loss * speed - g * (time - time[hit]))
    zero = Channel.smooth(0 * time)
    height = [Channel.smooth(y), Channel(before, after), Channel.smooth(0 * time - g)]
    lines = [ReplayChannel("contact", ("body", "particle", "fz"), zero)] if contact else []
    return particle("trapezoidal", time, [zero] * 3, height, lines=lines)


def test_an_impulse_needs_a_contact() -> None:
    jumps = velocity_jumps(prepare(bounce(contact=True)))
    assert jumps is not None
    assert jumps.frames == [8]
    assert np.max(jumps.share) < 1e-14
    alone = velocity_jumps(prepare(bounce(contact=False)))
    assert alone is not None
    assert alone.share[0] == 0.0
    assert alone.share[1] == pytest.approx(1.5)  # 0.5 up after 1 down, as a share of the largest momentum
    report = validate(bounce(contact=False), tracked=False)
    assert any(m.name == "unexplained impulse" and m.verdict == "fail" for m in report.metrics)


def test_energy_that_an_impact_takes_is_told_apart() -> None:
    balance = energy_balance(prepare(bounce(contact=True)))
    assert balance is not None
    speed = 9.8 * 0.4
    assert balance.jumps == pytest.approx(0.5 * speed**2 * (0.25 - 1.0))
    assert balance.share < 1e-12


def test_a_smooth_motion_has_no_jumps() -> None:
    x, y = waypoint_spline()
    assert velocity_jumps(prepare(smooth_particle("trapezoidal", np.linspace(0, 2, 21), x, y))) is None
