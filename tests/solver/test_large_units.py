"""Motions in units that make numbers large, or limits small, are those of ordinary units."""

from __future__ import annotations

import numpy as np
import pytest
from quadratic_program import Quadratic

import stc
from stc.solver import minimize

#: A stage of two links: lengths in ``L`` to the metre, times in ``S`` to the second. Its angles have limits: without
#: them it has another optimum, the other way round.
STAGE = """
constants: n = 60, L = LENGTH, S = TIME, g = 9.81*L/S^2, m1 = 12, m2 = 16, l1 = 0.032*L, l2 = 0.053*L, T = 0.107*S,
           most = 85*L^2/S^2;
variables: a, b, u, v;
method: trapezoidal;
definitions: h = T/n; x1 = l1/2*cos(a); z1 = l1/2*sin(a); x2 = l1*cos(a) + l2/2*cos(b); z2 = l1*sin(a) + l2/2*sin(b);
lagrangian: m1/2*(x1'^2 + z1'^2) + m1*l1^2/24*a'^2 + m2/2*(x2'^2 + z2'^2) + m2*l2^2/24*b'^2 - g*(m1*z1 + m2*z2);
forces: a: u - v; b: v;
constraints:
  [0, n]: -most <= u <= most; -most <= v <= most; -0.4 <= a <= 1.4; -0.4 <= b <= 1.4;
  [0]: a = -0.22; b = -0.01; a'; b';
  [n]: a = 1.17; b = 1.05; a'; b';
objective: [0, n]: integral(u^2 + v^2);
"""

#: A point that is pushed from place to place.
PUSHED = """
constants: n = 40, T = 0.9, h = T/n, far = FAR, c = ROOM*far;
variables: x;
method: METHOD;
constraints: [0, n]: LIMIT; [0]: x; x'; x''; [n]: x = far; x'; x'';
objective: [0, n]: integral(x'''^2);
"""

#: From one orbit to another with a weak engine, in kilometres: the square of its acceleration is 2e-7.
TRANSFER = """
constants: n = 50, mu = 398600.4, r0 = 6678, r1 = 6858.306, acc = 0.0004326, v0 = sqrt(mu/r0), v1 = sqrt(mu/r1);
variables: r, th, vr, vt, ar, at;
parameters: T;
method: hermite-simpson;
definitions: h = T/n;
guess: T = 2726.3; r = r0 + (r1 - r0)*i/n; th = pi*i/n; vt = v0 + (v1 - v0)*i/n;
constraints: 277 <= T <= 11082;
  [0, n]: r' = vr; th' = vt/r; vr' = vt^2/r - mu/r^2 + ar; vt' = -vr*vt/r + at; LIMIT; r >= r0*0.9;
  [0]: r = r0; th; vr; vt = v0;
  [n]: r = r1; vr; vt = v1;
objective: [0]: T;
"""


def solved(text: str) -> stc.Solution:
    solution = stc.load(text).solve()
    assert solution.status == "optimal", solution.message
    return solution


@pytest.mark.parametrize(("length", "time"), [(1e3, 1.0), (1e3, 1e3), (39.37, 1.0), (1.0, 1e-3)])
def test_motions_do_not_depend_on_units(length: float, time: float) -> None:
    ordinary = solved(STAGE.replace("LENGTH", "1").replace("TIME", "1"))
    other = solved(STAGE.replace("LENGTH", f"{length}").replace("TIME", f"{time}"))
    unit = length**4 / time**3  # of the integral of squared torques, which are masses times (length/time)^2
    assert other.objective == pytest.approx(ordinary.objective * unit, rel=1e-5)


@pytest.mark.daily_every(3)
@pytest.mark.parametrize("method", ["trapezoidal", "hermite-simpson"])
@pytest.mark.parametrize(("far", "room"), [(1.0, 60), (1e3, 60), (1e6, 600), (1e6, 2000)])
def test_squares_that_may_become_large(far: float, room: float, method: str) -> None:
    text = PUSHED.replace("FAR", f"{far}").replace("METHOD", method).replace("ROOM", f"{room}")
    linear = solved(text.replace("LIMIT", "-c <= x''' <= c"))
    square = solved(text.replace("LIMIT", "x'''^2 <= c^2"))
    assert square.objective == pytest.approx(linear.objective, rel=1e-6)


def test_small_limits_are_kept() -> None:
    plain = solved(TRANSFER.replace("LIMIT", "ar^2 + at^2 <= acc^2"))
    relative = solved(TRANSFER.replace("LIMIT", "(ar/acc)^2 + (at/acc)^2 <= 1"))
    assert plain.objective == pytest.approx(relative.objective, rel=1e-5)


def test_variables_that_turn_out_large_are_scaled_by_that() -> None:
    """A limit that is just wide enough; nothing at the start tells how large what it limits will be."""
    text = PUSHED.replace("METHOD", "trapezoidal").replace("LIMIT", "-c <= x''' <= c").replace("ROOM", "60")
    ordinary, large = solved(text.replace("FAR", "1")), solved(text.replace("FAR", "1e6"))
    assert large.objective == pytest.approx(1e12 * ordinary.objective, rel=1e-6)


def _program(seed: int, decades: float) -> tuple[Quadratic, float]:
    """A random convex quadratic program, its rows, variables and objective in units that differ by so many decades, and
    the factor of its objective."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(4, 25))
    m = int(rng.integers(2, n))
    matrix = rng.normal(size=(m, n)) * (rng.random((m, n)) < 0.5)
    point, root = rng.normal(size=n), rng.normal(size=(n, n))
    value = matrix @ point
    kind = rng.integers(0, 4, m)  # an equation, one bound, the other, two
    rows = (
        np.where(kind == 0, value, np.where(kind == 2, -np.inf, value - rng.random(m))),
        np.where(kind == 0, value, np.where(kind == 1, np.inf, value + rng.random(m))),
    )
    kind = rng.integers(0, 4, n)
    low = np.where((kind == 1) | (kind == 3), point - rng.random(n), -np.inf)
    high = np.where((kind == 2) | (kind == 3), point + rng.random(n), np.inf)
    gradient, curvature = 3.0 * rng.normal(size=n), root.T @ root + 0.1 * np.eye(n)
    row = 10.0 ** rng.uniform(-decades, decades, m)
    unit = 10.0 ** rng.uniform(-0.5 * decades, 0.5 * decades, n)
    factor = 10.0 ** float(rng.uniform(0.0, decades))
    matrix = matrix * row[:, None] / unit
    return (
        Quadratic(
            factor * gradient / unit,
            factor * curvature / unit[:, None] / unit,
            matrix,
            (rows[0] * row, rows[1] * row),
            (low * unit, high * unit),
        ),
        factor,
    )


@pytest.mark.daily_every(3)
@pytest.mark.parametrize("seed", range(30))
@pytest.mark.parametrize("decades", [2.0, 4.0, 6.0])
def test_quadratic_programs_do_not_depend_on_units(seed: int, decades: float) -> None:
    ordinary, other = _program(seed, 0.0), _program(seed, decades)
    known, found = minimize(ordinary[0]), minimize(other[0])
    assert known.status == found.status == "optimal"
    assert found.objective / other[1] == pytest.approx(known.objective / ordinary[1], rel=1e-5, abs=1e-5)


@pytest.mark.parametrize(
    ("seed", "decades"), [(3, 7.0), (67, 7.0), (6, 8.0), (25, 8.0), (53, 8.0), (58, 8.0)]
)
def test_where_the_objective_is_light_errors_get_smaller_until_nothing_is_left_to_gain(
    seed: int, decades: float
) -> None:
    test_quadratic_programs_do_not_depend_on_units(seed, decades)


@pytest.mark.parametrize("factor", [1e4, 1e5, 1e6, 1e8])
def test_two_inequalities_that_make_an_equation_may_be_large(factor: float) -> None:
    """What lies between them is narrow in any unit: 1e-9 of one row as stated would be less than rounding leaves."""
    spec = f"""
    constants: n = 0;
    parameters: x, y;
    guess: x = 3; y = 1;
    constraints: [0]: {factor}*(x - y) <= 0; {factor}*(y - x) <= 0; x + y >= 1000;
    objective: [0]: (x - 1)^2 + y;
    """
    found = stc.load(spec).solve()
    assert found.status == "optimal"
    assert found.objective == pytest.approx(249501.0, rel=1e-8)
    assert found.iterations < 60
