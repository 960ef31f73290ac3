"""Programs that lead naive methods astray."""

from __future__ import annotations

import math

import numpy as np
import pytest
from symbolic_program import INF, SymbolicProgram

from stc.solver import Options, Result, Status, minimize
from stc.symbolic.expr import call


def solve(program: SymbolicProgram) -> Result:
    result = minimize(program, Options(max_iterations=500))
    assert result.status is Status.OPTIMAL, result.message
    return result


@pytest.mark.parametrize("x0", [(0.0, 0.0), (0.0, 1.0), (1e-9, -1e-9)])
def test_leaves_a_saddle(x0: tuple[float, float]) -> None:
    result = solve(SymbolicProgram(x0, lambda x: x[0] ** 4 / 4 - x[0] ** 2 / 2 + x[1] ** 2 / 2))
    assert result.objective == pytest.approx(-0.25, abs=1e-9)


def test_leaves_a_maximum() -> None:
    assert solve(SymbolicProgram([0.0, 0.0], lambda x: call("cos", x[0]) * call("cos", x[1]))).objective == (
        pytest.approx(-1.0, abs=1e-9)
    )


def test_leaves_a_saddle_inside_a_disc_for_its_edge() -> None:
    program = SymbolicProgram(
        [0.0, 0.0], lambda x: x[0] * x[1], lambda x: [(x[0] ** 2 + x[1] ** 2, -INF, 1.0)]
    )
    assert solve(program).objective == pytest.approx(-0.5, abs=1e-8)


def test_leaves_a_saddle_on_a_curved_row() -> None:
    """(1, 1) is a stationary point of x + y on the hyperbola, and its worst one."""
    program = SymbolicProgram(
        [5.0, 5.0], lambda x: -x[0] - x[1], lambda x: [(x[0] * x[1], -INF, 1.0)], lower=1e-2, upper=1e2
    )
    assert solve(program).objective == pytest.approx(-100.01, rel=1e-6)


def test_leaves_a_stationary_point_of_the_violation() -> None:
    """The gradient of the row is zero at the start."""
    program = SymbolicProgram(
        [0.0, 0.0], lambda x: x[0] ** 2 + x[1] ** 2, lambda x: [(x[0] * x[1], 1.0, 1.0)]
    )
    assert solve(program).objective == pytest.approx(2.0, abs=1e-7)


def test_maratos_effect() -> None:
    """Full steps near the circle raise both the objective and the violation; they have to be taken all the same."""
    program = SymbolicProgram(
        [math.cos(0.5), math.sin(0.5)],
        lambda x: 2 * (x[0] ** 2 + x[1] ** 2 - 1) - x[0],
        lambda x: [(x[0] ** 2 + x[1] ** 2, 1.0, 1.0)],
    )
    result = solve(program)
    assert result.x == pytest.approx([1.0, 0.0], abs=1e-7)
    assert result.iterations <= 8


def test_waechter_and_biegler() -> None:
    """Interior methods without restoration stick to x = -1 or thereabouts; (1, 0, 0.5) is the answer."""
    program = SymbolicProgram(
        [-2.0, 3.0, 1.0],
        lambda x: x[0],
        lambda x: [(x[0] ** 2 - x[1], 1.0, 1.0), (x[0] - x[2], 0.5, 0.5)],
        lower=[-INF, 0.0, 0.0],
    )
    result = minimize(program)
    if result.status is Status.INFEASIBLE:  # (-1, 0, 0) is a minimum of the violation
        assert result.x == pytest.approx([-1.0, 0.0, 0.0], abs=1e-4)
    else:
        assert result.objective == pytest.approx(1.0, abs=1e-6)


def test_complementarity_as_a_row() -> None:
    """No constraint qualification holds at any feasible point."""
    program = SymbolicProgram(
        [0.1, 0.9],
        lambda x: (x[0] - 1) ** 2 + (x[1] - 1) ** 2,
        lambda x: [(x[0] * x[1], 0.0, 0.0)],
        lower=0.0,
    )
    assert solve(program).objective == pytest.approx(1.0, abs=1e-6)


def test_cusp_without_multipliers() -> None:
    program = SymbolicProgram(
        [-2.0, -2.0],
        lambda x: (x[0] - 2) ** 2 + x[1] ** 2,
        lambda x: [((1 - x[0]) ** 3 - x[1], 0.0, INF)],
        lower=0.0,
    )
    assert solve(program).objective == pytest.approx(1.0, abs=1e-2)


def test_undefined_beyond_the_edge() -> None:
    """Newton's first step from here would take the logarithm of a negative number."""
    program = SymbolicProgram([0.999], lambda x: -call("log", x[0]) - 2 * call("log", 1 - x[0]))
    assert solve(program).x == pytest.approx([1 / 3], abs=1e-8)


def test_undefined_in_a_row() -> None:
    program = SymbolicProgram([0.1], lambda x: x[0], lambda x: [(call("log", x[0]), -1.0, INF)])
    assert solve(program).x == pytest.approx([math.exp(-1)], abs=1e-8)


@pytest.mark.parametrize("scale", [1e-6, 1e-3, 1e3, 1e6])
def test_badly_scaled(scale: float) -> None:
    """Hock and Schittkowski's problem 71 with variables, rows and objective multiplied by factors."""

    def program() -> SymbolicProgram:
        def unscaled(x):  # type: ignore[no-untyped-def]
            return [x[0] / scale, x[1] * scale, x[2] / scale, x[3]]

        def objective(x):  # type: ignore[no-untyped-def]
            a, b, c, d = unscaled(x)
            return scale * (a * d * (a + b + c) + c)

        def rows(x):  # type: ignore[no-untyped-def]
            a, b, c, d = unscaled(x)
            return [
                (scale * (a * b * c * d), 25 * scale, INF),
                ((a**2 + b**2 + c**2 + d**2) / scale, 40 / scale, 40 / scale),
            ]

        factors = np.array([scale, 1 / scale, scale, 1.0])
        return SymbolicProgram(np.array([1, 5, 5, 1]) * factors, objective, rows, 1 * factors, 5 * factors)

    result = solve(program())
    assert result.objective / scale == pytest.approx(17.0140172892, rel=1e-6)
    assert result.iterations <= 30


def test_rosenbrock_in_few_steps() -> None:
    result = solve(SymbolicProgram([-1.2, 1.0], lambda x: 100 * (x[1] - x[0] ** 2) ** 2 + (1 - x[0]) ** 2))
    assert result.x == pytest.approx([1.0, 1.0], abs=1e-8)
    assert result.iterations <= 30


def test_flat_optimum_of_a_degenerate_linear_program() -> None:
    """A whole edge is optimal."""
    program = SymbolicProgram(
        [0.3, 0.1], lambda x: -x[0] - x[1], lambda x: [(x[0] + x[1], -INF, 1.0)], lower=0.0
    )
    assert solve(program).objective == pytest.approx(-1.0, abs=1e-9)
