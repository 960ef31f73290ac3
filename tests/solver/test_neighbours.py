"""Reuse of a neighbour's solution."""

from __future__ import annotations

import numpy as np
import pytest
from symbolic_program import INF, SymbolicProgram

from stc.solver import Options, Start, Status, minimize

WARM = Options(warm_start=True)


def hs71(level: float = 25.0) -> SymbolicProgram:
    return SymbolicProgram(
        [1.0, 5.0, 5.0, 1.0],
        lambda x: x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2],
        lambda x: [
            (x[0] * x[1] * x[2] * x[3], level, INF),
            (x[0] ** 2 + x[1] ** 2 + x[2] ** 2 + x[3] ** 2, 40.0, 40.0),
        ],
        lower=1.0,
        upper=5.0,
    )


def test_its_own_solution_needs_one_step() -> None:
    cold = minimize(hs71())
    warm = minimize(hs71(), WARM, start=Start(cold.x, cold.row_multipliers, cold.bound_multipliers))
    assert warm.status is Status.OPTIMAL
    assert warm.iterations <= 1
    assert warm.x == pytest.approx(cold.x, abs=1e-8)


@pytest.mark.parametrize("level", [25.25, 24.0, 26.0])
def test_a_neighbour_needs_three(level: float) -> None:
    cold, truth = minimize(hs71()), minimize(hs71(level))
    warm = minimize(hs71(level), WARM, start=Start(cold.x, cold.row_multipliers, cold.bound_multipliers))
    assert warm.status is Status.OPTIMAL
    assert warm.iterations <= 3
    assert warm.objective == pytest.approx(truth.objective, abs=1e-7)


def test_the_active_set_may_change() -> None:
    """The nearest point of a box to a target that moves across its corners."""

    def program(target: np.ndarray) -> SymbolicProgram:
        return SymbolicProgram(
            np.full(4, 0.5), lambda x: sum((x[k] - target[k]) ** 2 for k in range(4)), lower=0.0, upper=1.0
        )

    first = minimize(program(np.array([2.0, -1.0, 0.5, 3.0])))
    target = np.array([0.2, 1.5, -4.0, 0.9])
    second = minimize(program(target), WARM, start=Start(first.x, first.row_multipliers))
    assert second.x == pytest.approx(np.clip(target, 0.0, 1.0), abs=1e-9)
    assert second.iterations <= 3


def test_a_useless_start_does_no_harm() -> None:
    start = Start(np.array([5.0, 1.0, 1.0, 5.0]), np.array([1e3, -1e3]))
    result = minimize(hs71(), WARM, start=start)
    assert result.status is Status.OPTIMAL
    minima = (17.0140172892, 27.1464281995)  # the start is nearer to the second
    assert any(result.objective == pytest.approx(f, rel=1e-7) for f in minima)


def test_a_start_without_multipliers_is_a_place_only() -> None:
    result = minimize(hs71(), start=Start(np.array([1.0, 4.7, 3.8, 1.4])))
    assert result.objective == pytest.approx(17.0140172892, rel=1e-7)
