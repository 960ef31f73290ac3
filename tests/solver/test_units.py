"""Problems whose units make some numbers large or small: answers are those in other units, scaled."""

from __future__ import annotations

import numpy as np
import pytest
from symbolic_program import SymbolicProgram

import stc
from stc.solver import minimize

#: A mass is moved from rest to rest in a second; least effort is 12 m^2 d^2 (a cubic), the rule's error aside.
EFFORT = """
constants: n = 400, h = 1/n, m = 1, d = 1;
variables: x, f;
constraints: [0, n]: m*x'' = f; LIMITS [0]: x; x'; [n]: x = d; x';
objective: [0, n]: integral(f^2);
"""
LIMITS = "-8*m*d <= f <= 8*m*d; x' <= 1.7*d;"


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("method", ["trapezoidal", "hermite-simpson"])
@pytest.mark.parametrize("limits", ["", LIMITS], ids=["free", "limited"])
@pytest.mark.parametrize(("m", "d"), [(1.0, 1.0), (3e4, 1.0), (1e6, 1.0), (1e3, 1e3), (1.0, 1e6), (1e3, 1e6)])
def test_effort_in_any_units(method: str, limits: str, m: float, d: float) -> None:
    solution = stc.load(EFFORT.replace("LIMITS", limits)).solve(method=method, m=m, d=d)
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(12.0 * (m * d) ** 2, rel=1e-4)


def test_what_cannot_be_done_in_large_units_is_infeasible_still() -> None:
    """The way takes 4 m d at least, all forward and then all back."""
    model = stc.load(EFFORT.replace("LIMITS", "-3.9*m*d <= f <= 3.9*m*d;"))
    assert model.solve(method="trapezoidal", m=1e3, d=1e3).status == "infeasible"


#: HS 228 (Schittkowski): -3 at (0, -3), in small units.
BALL = """
constants: n = 0, unit = 1;
parameters: x, y;
guess: x = 0; y = 0;
definitions: a = unit*x; b = unit*y;
constraints: [0]: 1 - a - b >= 0; 9 - a^2 - b^2 >= 0;
objective: [0]: a^2 + b;
"""


@pytest.mark.parametrize("unit", [1.0, 1e-2, 1e-4, 1e-6])
def test_a_ball_in_small_units_is_no_unbounded_set(unit: float) -> None:
    solution = stc.load(BALL).solve(unit=unit)
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(-3.0, abs=1e-6)


PARALLEL = """
constants: n = 0, scale = 1, apart = 0.1;
parameters: x, y;
guess: x = 1; y = 1;
constraints: [0]: scale*x + scale*y = 1; scale*x + scale*y = 1 + apart;
objective: [0]: x;
"""


@pytest.mark.parametrize(("scale", "apart"), [(1.0, 0.1), (1.0, 1e-3), (1e-4, 0.1), (1e-4, 1e-3), (1e3, 0.1)])
def test_equations_that_contradict_each_other_are_not_unbounded(scale: float, apart: float) -> None:
    assert stc.load(PARALLEL).solve(scale=scale, apart=apart).status == "infeasible"


def test_a_motion_that_contradicts_itself_is_not_unbounded() -> None:
    solution = stc.load(
        "constants: n = 20, T = 1, h = T/n; variables: x, y, u; method: trapezoidal;"
        "constraints: [0, n]: x' = u; y' = u; [0]: x; y; [n]: x - y = 1; objective: [0, n]: integral(u);"
    ).solve()
    assert solution.status == "infeasible"


def test_what_falls_without_limit_is_unbounded_though_equations_hold() -> None:
    solution = stc.load(
        "constants: n = 20, T = 1, h = T/n; variables: x, y, u; method: trapezoidal;"
        "constraints: [0, n]: x' = u; y' = u; [0]: x; y; objective: [0, n]: integral(u);"
    ).solve()
    assert solution.status == "unbounded"


def test_a_minimum_far_out_is_found() -> None:
    """x^4/1e16 - 2 x^2 is least at 1e8, and -1e16 there."""

    def objective(x):
        return x[0] ** 4 / 1e16 - 2.0 * x[0] ** 2 + x[1]

    program = SymbolicProgram([1.0, 1.0], objective, lower=[0.0, 0.0])
    result = minimize(program)
    assert result.status == "optimal"
    assert result.objective == pytest.approx(-1e16, rel=1e-6)


#: HS 111: chemical equilibrium in logarithms; its objective falls without limit along points that violate the rows.
EQUILIBRIUM = """
constants: n = 0;
parameters: a, b, c, d, e, f, g, h1, i1, j;
guess: a = -2.3; b = -2.3; c = -2.3; d = -2.3; e = -2.3; f = -2.3; g = -2.3; h1 = -2.3; i1 = -2.3; j = -2.3;
definitions: S = log(exp(a) + exp(b) + exp(c) + exp(d) + exp(e) + exp(f) + exp(g) + exp(h1) + exp(i1) + exp(j));
constraints:
  [0]: exp(a) + 2*exp(b) + 2*exp(c) + exp(f) + exp(j) = 2; exp(d) + 2*exp(e) + exp(f) + exp(g) = 1;
    exp(c) + exp(g) + exp(h1) + 2*exp(i1) + exp(j) = 1;
    -100 <= a <= 100; -100 <= b <= 100; -100 <= c <= 100; -100 <= d <= 100; -100 <= e <= 100; -100 <= f <= 100;
    -100 <= g <= 100; -100 <= h1 <= 100; -100 <= i1 <= 100; -100 <= j <= 100;
objective:
  [0]: exp(a)*(-6.089 + a - S) + exp(b)*(-17.164 + b - S) + exp(c)*(-34.054 + c - S) + exp(d)*(-5.914 + d - S)
    + exp(e)*(-24.721 + e - S) + exp(f)*(-14.986 + f - S) + exp(g)*(-24.1 + g - S) + exp(h1)*(-10.708 + h1 - S)
    + exp(i1)*(-26.662 + i1 - S) + exp(j)*(-22.179 + j - S);
"""


def test_a_step_does_not_leave_the_rows_far_behind_for_a_lower_objective() -> None:
    solution = stc.load(EQUILIBRIUM).solve()
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(-47.76109026, rel=1e-7)


#: The least time-integral of a force's size that moves a mass, in any units: a linear program.


#: The least time for it.
HASTE = """
constants: n = 50, m = 1, d = 1;
variables: x, f;
parameters: T;
definitions: h = T/n;
guess: T = 2;
constraints: T >= 0.1; [0, n]: m*x'' = f; -8*m*d <= f <= 8*m*d; [0]: x; x'; [n]: x = d; x';
objective: [0]: T;
"""


@pytest.mark.parametrize(("m", "d"), [(1e3, 1e3), (1.0, 1e6), (1e3, 1e6)])
def test_the_least_time_in_large_units(m: float, d: float) -> None:
    """What an error of 1e-9 in each slope leaves to gain is much where variables are of 1e9."""
    model = stc.load(HASTE)
    usual, large = model.solve(method="trapezoidal"), model.solve(method="trapezoidal", m=m, d=d)
    assert usual.status == large.status == "optimal"
    assert large.objective == pytest.approx(usual.objective, rel=2e-5)


@pytest.mark.parametrize("unit", [1e4, 1e6])
def test_slopes_that_rounding_leaves_of_a_steep_valley_count_as_none(unit: float) -> None:
    """Rosenbrock's valley in other units: curvatures of 1e10 and more, beside variables of 1/unit."""

    def objective(x):
        a, b = unit * x[0], unit * x[1]
        return 1e4 * (b - a**2) ** 2 + (1.0 - a) ** 2

    result = minimize(SymbolicProgram([-1.2 / unit, 1.0 / unit], objective))
    assert result.status == "optimal"
    assert result.x * unit == pytest.approx([1.0, 1.0], rel=1e-9)


def test_a_slope_that_is_none_of_rounding_counts() -> None:
    """At rest in the origin terms are 0, so that rounding leaves nothing."""
    from stc.solver.judgement import slopes_left

    program = SymbolicProgram([0.0], lambda x: 1e-5 * x[0] + 1e8 * x[0] ** 2)
    left = slopes_left(program, np.zeros(1), np.zeros(0), np.zeros(1))
    assert left == pytest.approx([1e-5])
