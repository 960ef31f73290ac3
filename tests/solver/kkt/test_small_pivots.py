"""Matrices that are singular to working precision, but not in the sizes of their entries."""

import numpy as np
import pytest

from stc.solver.kkt.contract import Inertia
from stc.solver.kkt.reuse import StructuredKKT

#: Of a clamped line of so many points: fourth differences, its ends and slopes, and its middle.
N = 241


def _clamped_line() -> tuple[np.ndarray, np.ndarray]:
    """One row more than there are unknowns, all of them independent in pairs, and the stage of each row."""
    rows, stages = [], []
    for k in range(2, N - 2):
        row = np.zeros(N)
        row[k - 2 : k + 3] = 1.0, -4.0, 6.0, -4.0, 1.0
        rows.append(row)
        stages.append(k)
    for entries, stage in (
        ({0: 1.0}, 0), ({0: -3.0, 1: 4.0, 2: -1.0}, 0), ({N - 1: 1.0}, N - 1),
        ({N - 1: 3.0, N - 2: -4.0, N - 3: 1.0}, N - 1), ({N // 2: 1.0}, N // 2),
    ):  # fmt: skip
        row = np.zeros(N)
        row[list(entries)] = list(entries.values())
        rows.append(row)
        stages.append(stage)
    return np.array(rows), np.array(stages)


def _inertia(matrix: np.ndarray, stages: np.ndarray, give: float) -> Inertia:
    """[0 A^T; A -give], and what it finds."""
    m, n = matrix.shape
    rows, cols = np.nonzero(matrix)
    none = np.zeros(0, dtype=np.int64)
    kkt = StructuredKKT(n, m, rows, cols, none, none, np.arange(n), stages)
    return kkt.factorize(np.zeros(0), matrix[rows, cols], np.zeros(n), np.full(m, give))


@pytest.mark.parametrize("give", [1e-12, 1e-16, 1e-20])
def test_an_eigenvalue_below_the_rounding_unit_counts_as_zero(give: float) -> None:
    """A has full column rank: as many positive eigenvalues as unknowns, all others negative, one of them tiny."""
    matrix, stages = _clamped_line()
    assert _inertia(matrix, stages, give) == ((N, N + 1, 0) if give > 1e-15 else (N, N, 1))


def test_rows_that_say_the_same_are_dependent_all_the_same() -> None:
    matrix, stages = _clamped_line()
    matrix[-1] = matrix[100] + 3.0 * matrix[101]
    stages[-1] = 102
    inertia = _inertia(matrix, stages, 0.0)
    assert inertia.zero >= 1


@pytest.mark.parametrize("seed", range(5))
def test_a_row_that_is_a_sum_of_many(seed: int) -> None:
    """Rounding leaves its pivot far above the rounding unit; it is noise."""
    rng = np.random.default_rng(seed)
    matrix = rng.uniform(-1.0, 1.0, (60, 80)) * (
        np.abs(np.subtract.outer(np.arange(60) * 80 / 60, np.arange(80))) < 8
    )
    matrix[30] = rng.uniform(-1.0, 1.0, 29) @ matrix[:29]
    inertia = _inertia(matrix, np.zeros(60, dtype=np.int64), 0.0)
    assert inertia.zero >= 1
