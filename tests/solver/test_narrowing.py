"""Motions between limits that seem to leave nothing, but have been made from a motion that keeps them."""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.solver import Options, minimize
from stc.solver.kkt import structured_kkt
from stc.solver.narrowing import Widened, narrowed_start
from stc.solver.rescaling import Rescalings

#: An acrobot swings up within limits a little wider than a motion needs that does.
ACROBOT = """
constants: n = 40, T = 4.767, g = 9.81;
variables: q1, q2, tau2;
method: hermite-simpson;
definitions: h = T/n; x1 = 0.2535*sin(q1); z1 = 0 - 0.2535*cos(q1); x2 = 0.507*sin(q1) + 0.2935*sin(q2);
  z2 = 0 - 0.507*cos(q1) - 0.2935*cos(q2);
lagrangian: 0.4685*((x1)'^2 + (z1)'^2) + 0.010035621375*q1'^2 - 0.937*g*z1
  + 0.3475*((x2)'^2 + (z2)'^2) + 0.009978143958*q2'^2 - 0.695*g*z2;
forces: q1: -tau2; q2: tau2;
guess: q1 = pi*t/T; q2 = pi*t/T;
constraints:
  [0]: q1; q1'; q2; q2'; [n]: q1 = pi; q1'; q2 = pi; q2';
  [0, n]: -1.18000486 <= q1 <= 3.53446515; -0.877107062 <= q2 <= 8.09234609; -2.0360869 <= tau2 <= 2.47277061;
objective: [0, n]: integral(tau2^2);
"""

#: An arm of two links reaches around a disc, in least time and with little effort.
ARM = """
constants: n = 150, m1 = 2.794, m2 = 1.664, l1 = 0.468, l2 = 0.49, J1 = 0.091, J2 = 0.02, most = 17.855, g = 9.81;
variables: a, b, u, v;
parameters: T;
method: trapezoidal;
definitions: h = T/n; x = l1*cos(a) + l2*cos(a + b); y = l1*sin(a) + l2*sin(a + b);
lagrangian: (m1*l1^2/8 + J1/2 + m2*l1^2/2)*a'^2 + (m2*l2^2/8 + J2/2)*(a' + b')^2
  + m2*l1*l2/2*cos(b)*a'*(a' + b') - m1*g*l1/2*sin(a) - m2*g*(l1*sin(a) + l2/2*sin(a + b));
forces: a: u; b: v;
guess: T = 1.2;
constraints:
  0.1 <= T <= 10;
  [0, n]: -most <= u <= most; -most/2 <= v <= most/2; -2.5 <= b <= 2.5; -8 <= a' <= 8; -10 <= b' <= 10;
    (x - 0.44)^2 + (y - 0.391)^2 >= 0.078^2;
  [0]: a = -0.971; b = 0.556; a'; b'; [n]: a = 1.404; b = 0.92; a'; b';
  [0, n]: -3.43311067 <= a <= 1.84373733; -2.9226928 <= b <= 2.28078936; -11.664987 <= u <= 5.49408819;
    -9.58799944 <= v <= 7.96613032;
objective: [0]: T; [0, n]: integral(0.01*(u^2 + v^2));
"""


@pytest.mark.parametrize("spec", [ACROBOT, ARM], ids=["acrobot", "arm"])
def test_a_motion_is_found_between_narrow_limits(spec: str) -> None:
    solution = stc.load(spec).solve()
    assert solution.status == "optimal", solution.message
    assert solution.violation <= 1e-6


def test_limits_that_nothing_keeps_stay_infeasible() -> None:
    """The torque that holds a pendulum level is larger than the most that is allowed where it has to rest."""
    spec = """
    constants: n = 20, h = 0.05;
    variables: q, u;
    method: trapezoidal;
    constraints: [0, n]: q'' = -9.81*sin(q) + u; -4 <= u <= 4; 1 <= q <= 2; [0]: q = pi/2; q';
    objective: [0, n]: integral(u^2);
    """
    assert stc.load(spec).solve().status == "infeasible"


def bound(spec: str) -> stc.transcription.bind.BoundProgram:
    problem, transcription = stc.load(spec).transcription()
    return transcription.bind(problem.constants)


def test_limits_are_widened_and_equations_are_not() -> None:
    program = bound(ACROBOT)
    wide = Widened(program)
    wide.widen(0.5)
    for lower, upper, wide_lower, wide_upper in (
        (program.x_lower, program.x_upper, wide.x_lower, wide.x_upper),
        (program.row_lower, program.row_upper, wide.row_lower, wide.row_upper),
    ):
        equal, both = lower == upper, np.isfinite(lower) & np.isfinite(upper) & (lower < upper)
        np.testing.assert_array_equal(wide_lower[equal], lower[equal])
        np.testing.assert_array_equal(wide_upper[equal], upper[equal])
        np.testing.assert_allclose((wide_upper - wide_lower)[both], 2.0 * (upper - lower)[both])
        assert np.isneginf(wide_lower[np.isneginf(lower)]).all()
    # A point outside by 0.3 of the distance between the limits lacks that.
    at = int(np.flatnonzero(np.isfinite(program.x_upper) & (program.x_lower < program.x_upper))[0])
    x = np.clip(program.x0, program.x_lower, program.x_upper)
    x[at] = program.x_upper[at] + 0.3 * (program.x_upper - program.x_lower)[at]
    assert wide.lacking(x) == pytest.approx(0.3)


def test_the_way_is_told_of_and_can_be_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Rescalings, "from_least_violation", lambda *_: None)  # which finds it before
    seen: list[tuple[int, str]] = []
    shape = bound(ACROBOT).x0.shape

    def watch(record) -> bool:
        seen.append((record.iteration, record.phase))
        assert record.x.shape == shape
        return record.phase == "narrowing" and len(seen) >= stop

    program, stop = bound(ACROBOT), 10_000
    watched = minimize(program, callback=watch)
    assert watched.status == "optimal"
    assert any(phase == "narrowing" for _, phase in seen)
    first = next(k for k, (_, phase) in enumerate(seen) if phase == "narrowing")
    seen.clear()
    stop = first + 5
    stopped = minimize(bound(ACROBOT), callback=watch)
    assert stopped.status == "interrupted"
    assert len(seen) == stop


def test_the_way_ends_at_its_limits() -> None:
    program = bound(ACROBOT)
    start, spent = narrowed_start(program, program.x0, 3.0, Options(max_iterations=7), structured_kkt)
    assert start is None and spent <= 7
    start, _ = narrowed_start(program, program.x0, 3.0, Options(time_limit=0.0), structured_kkt)
    assert start is None
    limited = minimize(program, Options(max_iterations=300))
    assert limited.status != "optimal" and limited.iterations <= 300 + 2
