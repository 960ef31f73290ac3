"""Iterations that creep: with a share of the rows' curvature only, or after a restoration that led far away."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc

ALP_RIDER = Path(__file__).parents[1] / "problems" / "literature" / "alp_rider.stc"


@pytest.mark.parametrize(
    ("method", "n"), [("trapezoidal", 60), ("trapezoidal", 300), ("hermite-simpson", 60)]
)
def test_iterations_do_not_creep(method: str, n: int) -> None:
    """Whole steps that each took one per cent off the error went on for thousands of iterations."""
    solution = stc.load(ALP_RIDER, n=n).solve(method=method, max_iterations=300)
    assert solution.status == "optimal"
    assert solution.optimality <= 1e-8


FLOOR = """
constants: n = 30, T = 5, h = T/n;
variables: x1, x2, x3, x4, u1, u2;
method: hermite-simpson;
guess: x1 = 2 - t/T; x2 = 2 + t/T; x3 = 2 - t/T; x4 = 1 - 3*t/T;
constraints:
  [0, n]:
    x1' = -10*x1 + u1 + u2;
    x2' = -2*x2 + u1 + 2*u2;
    x3' = -3*x3 + 5*x4 + u1 - u2;
    x4' = 5*x3 - 3*x4 + u1 + 3*u2;
    x1^2 + x2^2 + x3^2 + x4^2 >= 0.01;
  [0]: x1 = 2; x2 = 1; x3 = 2; x4 = 1;
  [n]: x1 = 2; x2 = 3; x3 = 1; x4 = -2;
objective:
  [0, n]: integral(100*(x1^2 + x2^2 + x3^2 + x4^2) + 0.01*(u1^2 + u2^2));
"""
#: IPOPT, the same programs.
OPTIMA = {29: 889.268025, 30: 883.765067, 40: 845.880368}


@pytest.mark.parametrize("n", OPTIMA)
def test_errors_that_go_up_and_down_meanwhile_are_no_progress(n: int) -> None:
    solution = stc.load(FLOOR, n=n).solve(max_iterations=350)
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(OPTIMA[n], rel=1e-6)


MEETING = """
constants: n = 300;
variables: x, y, u, v;
parameters: T;
method: trapezoidal;
definitions: h = T/n;
guess: T = 1;
constraints:
  0.1 <= T <= 2;
  [0, n]: x'' = u; y'' = v; u^2 + v^2 <= 400;
  [0]: x; y; x'; y';
  [n]: x = 8 - 3*T; y = 10*T - 4.905*T^2; x' = -3; y' = 10 - 9.81*T;
objective: [0, n]: integral(u^2 + v^2);
"""


def test_the_barrier_begins_anew_where_a_restoration_led_far_away() -> None:
    """With the parameter that it had come down to, 333 iterations."""
    solution = stc.load(MEETING).solve(max_iterations=200)
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(238.40058, rel=1e-4)
