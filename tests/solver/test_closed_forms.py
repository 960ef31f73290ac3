"""Problems whose solutions are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from symbolic_program import INF, SymbolicProgram

import stc
from stc.solver import Options, Result, Status, minimize
from stc.symbolic.expr import call


def solve(program: SymbolicProgram, **options: float) -> Result:
    return minimize(program, Options(**options))


def test_a_quadratic_without_rows_takes_one_step() -> None:
    result = solve(
        SymbolicProgram([5.0, -3.0], lambda x: (x[0] - 1) ** 2 + 3 * (x[1] - 2) ** 2 + x[0] * x[1])
    )
    matrix, right = np.array([[2.0, 1.0], [1.0, 6.0]]), np.array([2.0, 12.0])
    assert result.status is Status.OPTIMAL
    assert result.x == pytest.approx(np.linalg.solve(matrix, right), abs=1e-9)
    assert result.iterations <= 2


def test_an_equality_constrained_quadratic_takes_one_step() -> None:
    """Projection of (3, 1, 2) on the plane x + 2 y + 3 z = 6."""
    result = solve(
        SymbolicProgram(
            [0.0, 0.0, 0.0],
            lambda x: (x[0] - 3) ** 2 + (x[1] - 1) ** 2 + (x[2] - 2) ** 2,
            lambda x: [(x[0] + 2 * x[1] + 3 * x[2], 6.0, 6.0)],
        )
    )
    point, normal = np.array([3.0, 1.0, 2.0]), np.array([1.0, 2.0, 3.0])
    distance = (normal @ point - 6.0) / (normal @ normal)
    assert result.x == pytest.approx(point - distance * normal, abs=1e-9)
    assert result.row_multipliers == pytest.approx([2 * distance], abs=1e-8)
    assert result.iterations <= 2


def test_a_quadratic_program_is_confirmed_as_stated_at_once(monkeypatch) -> None:
    problem, transcription = stc.load("particle_waypoints").transcription(n=32)
    program = transcription.bind(problem.constants)
    wanted = minimize(program)
    assert (wanted.iterations, wanted.factorizations, len(wanted.history)) == (1, 1, 1)
    assert max(wanted.violation, wanted.optimality, wanted.history[0].optimality) <= 1e-9
    # A solution that is not good enough as stated is improved on.
    monkeypatch.setattr("stc.solver.strategies.ACCURATE", 0.0)
    again = minimize(program)
    assert again.iterations >= 1
    assert again.x == pytest.approx(wanted.x, abs=1e-9)


def test_a_linear_program_ends_at_its_vertex() -> None:
    result = solve(
        SymbolicProgram(
            [1.0, 1.0],
            lambda x: -3 * x[0] - 5 * x[1],
            lambda x: [(2 * x[1], -INF, 12.0), (3 * x[0] + 2 * x[1], -INF, 18.0)],
            lower=0.0,
            upper=[4.0, INF],
        )
    )
    assert result.x == pytest.approx([2.0, 6.0], abs=1e-9)
    assert result.row_multipliers == pytest.approx([1.5, 1.0], abs=1e-7)
    assert result.bound_multipliers == pytest.approx([0.0, 0.0], abs=1e-7)
    assert result.iterations <= 10


@pytest.mark.parametrize(("lower", "upper", "sign"), [(2.0, INF, -1.0), (-INF, -2.0, 1.0)])
def test_signs_of_multipliers(lower: float, upper: float, sign: float) -> None:
    """Multipliers are negative at lower and positive at upper bounds, of rows and variables alike."""
    row = solve(SymbolicProgram([0.5], lambda x: x[0] ** 2, lambda x: [(x[0] * 1.0 + 0.0, lower, upper)]))
    bound = solve(SymbolicProgram([0.5], lambda x: x[0] ** 2, lower=lower, upper=upper))
    assert row.row_multipliers == pytest.approx([4.0 * sign], abs=1e-7)
    assert bound.bound_multipliers == pytest.approx([4.0 * sign], abs=1e-7)


def test_multipliers_are_sensitivities() -> None:
    """The derivative of the least objective with respect to a bound is minus its multiplier."""

    def least(level: float) -> Result:
        return solve(
            SymbolicProgram(
                [1.0, 1.0],
                lambda x: call("exp", x[0]) + x[1] ** 2,
                lambda x: [(x[0] * x[1], level, INF), (x[0] + x[1], -INF, 4.0)],
                lower=0.1,
            )
        )

    h = 1e-4
    slope = (least(1 + h).objective - least(1 - h).objective) / (2 * h)
    assert -least(1.0).row_multipliers[0] == pytest.approx(slope, abs=1e-5)


def test_fixed_variables_stay_and_have_multipliers() -> None:
    program = SymbolicProgram(
        [7.0, 3.0, 0.0],
        lambda x: (x[0] - 1) ** 2 + x[1] ** 2 * x[2] + (x[2] - 4) ** 2,
        lower=[-INF, 2.0, -INF],
        upper=[INF, 2.0, INF],
    )
    result = solve(program)
    assert result.x == pytest.approx([1.0, 2.0, 2.0], abs=1e-9)
    assert result.bound_multipliers == pytest.approx([0.0, -8.0, 0.0], abs=1e-7)


def test_every_variable_fixed() -> None:
    def program(limit: float) -> SymbolicProgram:
        return SymbolicProgram(
            [0.0, 0.0],
            lambda x: x[0] * x[1],
            lambda x: [(x[0] + x[1], -INF, limit)],
            lower=[2, 3],
            upper=[2, 3],
        )

    assert solve(program(5.0)).objective == 6.0
    assert solve(program(4.0)).status is Status.INFEASIBLE


def test_no_variables() -> None:
    fine = SymbolicProgram([], lambda x: 3.0, lambda x: [(1.0, 0.0, 2.0)])
    wrong = SymbolicProgram([], lambda x: 3.0, lambda x: [(5.0, 0.0, 2.0)])
    assert solve(fine).status is Status.OPTIMAL
    assert solve(fine).objective == 3.0
    assert solve(wrong).status is Status.INFEASIBLE


def test_no_objective_asks_for_a_feasible_point() -> None:
    result = solve(
        SymbolicProgram(
            [2.0, 1.0], None, lambda x: [(x[0] ** 2 + x[1] ** 2, 25.0, 25.0), (x[0] * x[1], 9.0, 9.0)]
        )
    )
    assert result.status is Status.OPTIMAL
    assert result.x @ result.x == pytest.approx(25.0, abs=1e-9)
    assert result.x[0] * result.x[1] == pytest.approx(9.0, abs=1e-9)


def test_a_row_without_bounds_is_no_constraint() -> None:
    result = solve(
        SymbolicProgram([3.0], lambda x: x[0] ** 2, lambda x: [(x[0] ** 3, -INF, INF), (x[0] + 1, 0.0, INF)])
    )
    assert result.x == pytest.approx([0.0], abs=1e-9)
    assert result.row_multipliers == pytest.approx([0.0, 0.0], abs=1e-8)


def test_redundant_and_overdetermined_rows() -> None:
    result = solve(
        SymbolicProgram(
            [3.0, -2.0],
            lambda x: x[0] ** 2 + x[1],
            lambda x: [
                (x[0] + x[1], 2.0, 2.0),
                (2 * x[0] + 2 * x[1], 4.0, 4.0),
                (x[0] - x[1], 0.0, 0.0),
                (x[0] * x[1], 1.0, 1.0),
            ],
        )
    )
    assert result.status is Status.OPTIMAL
    assert result.x == pytest.approx([1.0, 1.0], abs=1e-7)


def test_both_sides_of_a_range() -> None:
    def nearest(target: float) -> float:
        return float(
            solve(SymbolicProgram([0.5], lambda x: (x[0] - target) ** 2, lambda x: [(x[0] * 2, 1, 4)])).x[0]
        )

    assert [nearest(t) for t in (0.0, 1.0, 9.0)] == pytest.approx([0.5, 1.0, 2.0], abs=1e-8)


@given(st.integers(0, 10_000), st.integers(1, 6), st.integers(0, 5))
def test_random_convex_quadratics(seed: int, n: int, m: int) -> None:
    """A random convex program with a known interior point: conditions checked from scratch with dense algebra."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((n, n))
    matrix, linear = root @ root.T + 0.1 * np.eye(n), 3 * rng.standard_normal(n)
    rows, inside = rng.standard_normal((m, n)), rng.standard_normal(n)
    level = rows @ inside
    below = np.where(rng.random(m) < 0.3, level, level - rng.random(m))
    above = np.where(rng.random(m) < 0.3, INF, np.maximum(level + rng.random(m), below))
    x_lower = np.where(rng.random(n) < 0.5, -INF, inside - rng.random(n))

    def objective(x):  # type: ignore[no-untyped-def]
        half = sum(0.5 * matrix[i, j] * x[i] * x[j] for i in range(n) for j in range(n))
        return half + sum(linear[i] * x[i] for i in range(n))

    program = SymbolicProgram(
        np.zeros(n),
        objective,
        lambda x: [(sum(rows[k, i] * x[i] for i in range(n)), below[k], above[k]) for k in range(m)],
        lower=x_lower,
    )
    result = solve(program)
    assert result.status is Status.OPTIMAL, result.message
    x, y, z = result.x, result.row_multipliers, result.bound_multipliers
    scale = 1 + np.abs(y).max(initial=0.0) + np.abs(z).max(initial=0.0)
    assert matrix @ x + linear + rows.T @ y + z == pytest.approx(np.zeros(n), abs=1e-6 * scale)
    r = rows @ x
    assert np.all(r >= below - 1e-7) and np.all(r <= above + 1e-7) and np.all(x >= x_lower - 1e-7)
    for value, low, high, multiplier in zip(
        np.append(r, x), np.append(below, x_lower), np.append(above, np.full(n, INF)), np.append(y, z)
    ):
        assert max(multiplier, 0.0) * min(high - value, 1.0) <= 1e-5 * scale
        assert max(-multiplier, 0.0) * min(value - low, 1.0) <= 1e-5 * scale
