"""Violations that only seem to be stationary: rows with large and small coefficients, as fine differences have."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from symbolic_program import SymbolicProgram

import stc
from stc.solver.violation_descent import nearer_point

BEAM = Path(__file__).parents[1] / "problems" / "traj" / "beam_load.stc"


@pytest.mark.filterwarnings("ignore:.*uncoupled")
@pytest.mark.parametrize("n", [1200, 5000])
def test_a_load_for_every_shape_is_not_called_infeasible(n: int) -> None:
    """Any x has a load w; slopes of w are 1e-8 of those of x in the scale of the rows.

    Terms of n^4 times 0.06 leave a violation of some rounding units of them, which is beyond the tolerance.
    """
    solution = stc.load(BEAM).solve(n=n)
    assert solution.status == "failed" or solution.objective == pytest.approx(9.925, rel=1e-3)
    assert solution.violation < 5.0 * 0.06 * n**4 * 2.0**-53


def test_a_small_coefficient_meets_the_row() -> None:
    program = SymbolicProgram(
        [0.0, 0.0, 7.0],
        lambda x: x[2],
        lambda x: [(1e9 * (x[0] - x[1]) + x[2], 7.0, 7.0), (1e9 * (x[0] - x[1]), 3.0, 3.0)],
        lower=[0.0, 0.0, -np.inf],
        upper=[0.0, 0.0, np.inf],
    )
    assert nearer_point(program, np.array([0.0, 0.0, 7.0]), np.array([0.0, 1e-7]), np.full(2, 1e-7)) is None
    found = nearer_point(program, np.array([0.0, 0.0, 2.0]), np.array([-1e-7, 0.0]), np.array([1e-7, 0.0]))
    assert found is not None
    np.testing.assert_allclose(found, [0.0, 0.0, 7.0])


@pytest.mark.parametrize("lower", [-np.inf, 0.0])
def test_a_stationary_violation_stays(lower: float) -> None:
    """x^2 = -1, at and next to its minimum; and x >= 0 that would have to be -1."""
    squared = SymbolicProgram([1e-7], lambda x: x[0], lambda x: [(x[0] ** 2, -1.0, -1.0)], lower=lower)
    for x in (0.0, 1e-7, 1e-4):
        assert nearer_point(squared, np.array([x]), np.ones(1), np.ones(1)) is None
    bounded = SymbolicProgram([0.0], lambda x: x[0], lambda x: [(x[0], -1.0, -1.0)], lower=0.0)
    assert nearer_point(bounded, np.zeros(1), np.ones(1), np.ones(1)) is None


def test_two_rows_that_pull_against_each_other_stay() -> None:
    """x = 0 and x = 1: every x between has the same sum of violations, and the multipliers cancel."""
    program = SymbolicProgram([0.5], lambda x: x[0], lambda x: [(x[0], 0.0, 0.0), (x[0], 1.0, 1.0)])
    assert nearer_point(program, np.array([0.5]), np.array([1.0, -1.0]), np.ones(2)) is None
