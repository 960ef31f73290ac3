"""Products with sparse matrices against dense ones."""

from __future__ import annotations

import numpy as np
import pytest

from stc.solver.products import inner, norm, symmetric_times, times


def test_products_are_those_of_the_dense_matrix() -> None:
    rng = np.random.default_rng(1)
    rows, cols = rng.integers(0, 7, 40), rng.integers(0, 9, 40)  # some entries come twice and add up
    values, v = rng.standard_normal(40), rng.standard_normal(9)
    dense = np.zeros((7, 9))
    np.add.at(dense, (rows, cols), values)
    np.testing.assert_allclose(times(rows, cols, values, v, 7), dense @ v, atol=1e-14)


def test_a_symmetric_matrix_is_known_from_its_lower_triangle() -> None:
    rng = np.random.default_rng(2)
    rows, cols = np.tril_indices(6)
    values, v = rng.standard_normal(rows.size), rng.standard_normal(6)
    dense = np.zeros((6, 6))
    dense[rows, cols] = dense[cols, rows] = values
    found = symmetric_times(rows.astype(np.int64), cols.astype(np.int64), values, v, 6)
    np.testing.assert_allclose(found, dense @ v, atol=1e-14)


def test_nothing_times_anything_is_nothing() -> None:
    none, empty = np.zeros(0, np.int64), np.zeros(0)
    assert times(none, none, empty, np.ones(3), 2).tolist() == [0.0, 0.0]
    assert symmetric_times(none, none, empty, np.ones(3), 3).tolist() == [0.0, 0.0, 0.0]
    assert inner(empty, empty) == norm(empty) == 0.0


@pytest.mark.parametrize("size", [3, 20_000])
def test_inner_products_of_views(size: int) -> None:
    a, b = np.arange(2.0 * size)[::2] / size, np.full(size, 0.5)
    assert inner(a, b) == pytest.approx(0.5 * a.sum(), rel=1e-12)
    assert norm(b) == pytest.approx(0.5 * np.sqrt(size), rel=1e-12)
