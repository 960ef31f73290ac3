"""The energy balance and the impulses of motions whose books are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import particle, smooth_particle, waypoint_spline
from pendulums import GRAVITY, INERTIA, LENGTH, MASS, pendulum

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
