"""Products with sparse matrices against dense ones, the centring search against the formulas written out."""

from __future__ import annotations

import numpy as np
import pytest

from stc.solver.products import inner, least_error, norm, symmetric_times, times


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


@pytest.mark.parametrize("seed", range(5))
def test_the_centring_with_the_least_predicted_error_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centring = np.array([0.01, 0.1, 0.5, 1.0, 2.0])
    taus = np.maximum(0.9, 1.0 - 0.1 * centring)
    gap, z = rng.uniform(0.1, 1.0, (2, 30))
    steps = rng.standard_normal((4, 30)) * 0.3
    errors = []
    for sigma, tau in zip(centring, taus, strict=True):
        gap_step, z_step = steps[0] + sigma * steps[1], steps[2] + sigma * steps[3]
        a = min(1.0, tau / np.max(-gap_step / gap))
        b = min(1.0, tau / np.max(-z_step / z))
        products = (gap + a * gap_step) * (z + b * z_step)
        errors.append(np.mean(products**2) + (1 - b) ** 2 * 0.7 + (1 - a) ** 2 * 0.3)
    found = least_error(centring, taus, gap, z, *steps, 0.7, 0.3)
    assert found == int(np.argmin(errors))
