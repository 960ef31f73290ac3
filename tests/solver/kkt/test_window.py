"""The window's operations and the ordering against plain NumPy."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from solver.kkt.kkt_problems import symmetric

from stc.solver.kkt import window
from stc.solver.kkt.ordering import COMPARED, MARGIN, SECOND, SETS, UNPLANNED, order_stage
from stc.solver.kkt.slot_sets import words_of
from stc.solver.kkt.values import GOOD, equilibrate, find_scale, load, residual

SEEDS = st.integers(0, 10**6)


@given(SEEDS, st.sampled_from([0.1, 0.5, 1.0]))
def test_gather_merge_and_subtract(seed, density):
    rng = np.random.default_rng(seed)
    stride, top = 24, int(rng.integers(2, 25))
    full = np.zeros((stride, stride))
    full[:top, :top] = symmetric(rng, top, density)
    flat = np.tril(full).reshape(-1)
    p, q = (int(v) for v in rng.choice(top, size=2, replace=False))
    # Slots in two runs, as when some are set aside for delayed unknowns.
    split = int(rng.integers(0, top + 1))
    columns = []
    for slot in (p, q):
        found, values = np.zeros(stride, dtype=np.int32), np.zeros(stride)
        count = window.gather(slot, split, split, top, stride, flat, found, values)
        expected = [k for k in range(top) if k != slot and full[slot, k] != 0.0]
        assert found[:count].tolist() == expected
        np.testing.assert_array_equal(values[:count], full[slot, expected])
        listed = np.zeros(count)
        window.gather_listed(slot, count, found, stride, flat, listed)
        np.testing.assert_array_equal(listed, values[:count])
        assert window.largest(count, values) == np.abs(values[:count]).max(initial=0.0)
        columns.append((count, found, values))
    common, first, second = np.zeros(stride, dtype=np.int32), np.zeros(stride), np.zeros(stride)
    count = window.merge(*columns[0], q, *columns[1], p, common, first, second)
    expected = [k for k in range(top) if k not in (p, q) and (full[p, k] != 0.0 or full[q, k] != 0.0)]
    assert common[:count].tolist() == expected
    np.testing.assert_array_equal(first[:count], full[p, expected])
    np.testing.assert_array_equal(second[:count], full[q, expected])

    spread_1, spread_2 = np.zeros(stride), np.zeros(stride)
    factors = rng.normal(size=(2, stride)) * (rng.random((2, stride)) < 0.7)
    u, v = full[p] * 1.0, full[q] * 1.0
    u[[p, q]] = v[[p, q]] = 0.0
    left = np.zeros((2, stride))
    left[:, expected] = factors[:, :count]
    after = flat.copy()
    window.subtract_two(
        count, common, first, second, factors[0], factors[1], stride, spread_1, spread_2, after
    )
    wanted = np.tril(full - np.outer(left[0], u) - np.outer(left[1], v))
    np.testing.assert_allclose(np.tril(after.reshape(stride, stride)), wanted, atol=1e-13)
    after = flat.copy()
    window.subtract_one(count, common, first, left[0][expected].copy(), stride, spread_1, after)
    wanted = np.tril(full - np.outer(left[0], u))
    np.testing.assert_allclose(np.tril(after.reshape(stride, stride)), wanted, atol=1e-13)
    assert not spread_1.any() and not spread_2.any()

    window.clear(p, columns[0][0], columns[0][1], stride, flat)
    cleared = full.copy()
    cleared[p, :] = cleared[:, p] = 0.0
    np.testing.assert_array_equal(np.tril(flat.reshape(stride, stride)), np.tril(cleared))


def ordered(
    sizes: np.ndarray, leaving: np.ndarray, *, all_taken: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Order, kinds, and the starts and lists of columns that ``order_stage`` finds; ``sizes`` are left as by that."""
    top, count = len(sizes), leaving.size
    order, kinds = np.zeros(count, dtype=np.int32), np.zeros(count, dtype=np.int32)
    starts, lists = np.zeros(count + 1, dtype=np.int32), np.zeros((count + 1) * top, dtype=np.int32)
    degree, row_p, row_q = (np.zeros(top, dtype=np.int32) for _ in range(3))
    pairs = np.zeros(50, dtype=np.int32), np.zeros(50, dtype=np.int32), np.zeros(50)
    used = order_stage(
        top, count, leaving.copy(), MARGIN, COMPARED, int(all_taken), sizes.reshape(-1), degree, np.zeros(top), row_p,
        row_q, np.zeros((top + SETS) * words_of(top), dtype=np.int64), 50, *pairs, order, kinds, starts, lists.size,
        lists,
    )  # fmt: skip
    assert used == starts[count]
    return order, kinds, starts, lists


def dependent_rows(rng: np.random.Generator, variables: int, rows: int, rank: int) -> np.ndarray:
    """[[H, J^T], [J, 0]] with few independent rows: what is left when these have been eliminated cancels."""
    jacobian = rng.integers(-2, 3, (rows, rank)) @ rng.integers(-2, 3, (rank, variables)).astype(float)
    size = variables + rows
    matrix = np.zeros((size, size))
    matrix[:variables, :variables] = np.diag(rng.uniform(0.5, 2.0, variables))
    matrix[variables:, :variables] = jacobian
    matrix[:variables, variables:] = jacobian.T
    return matrix


@given(SEEDS)
def test_pivots_that_are_taken_whatever_their_values_are_none_that_cancel(seed):
    """Also once all that is left is coupled, so that no order takes fewer operations."""
    rng = np.random.default_rng(seed)
    rows = int(rng.integers(2, 7))
    matrix = dependent_rows(rng, int(rng.integers(2, 8)), rows, int(rng.integers(1, rows)))
    size = len(matrix)
    order, kinds, _, _ = ordered(matrix.copy(), np.arange(size, dtype=np.int32), all_taken=True)
    assert sorted(order) == list(range(size))
    rest = matrix.copy()
    for k in range(size):
        if kinds[k] == UNPLANNED:
            break
        if kinds[k] == SECOND:
            continue
        block = order[k : k + kinds[k]]
        inverse = np.linalg.inv(rest[np.ix_(block, block)])
        column = rest[:, block].copy()
        column[block] = 0.0
        assert np.abs(inverse).max() < 1e8
        if np.abs(column @ inverse).max() > 0.5 / MARGIN:
            break  # nothing better was left, and such are planned as if they were larger
        rest[block, :] = rest[:, block] = 0.0
        rest -= column @ inverse @ column.T


@given(SEEDS)
def test_planned_patterns_hold_all_fill(seed):
    """Elimination in the order found fills no entry outside the lists, whatever the values."""
    rng = np.random.default_rng(seed)
    top = int(rng.integers(2, 16))
    matrix = symmetric(rng, top, 0.3)
    leaving = np.sort(rng.choice(top, size=int(rng.integers(1, top + 1)), replace=False)).astype(np.int32)
    count = leaving.size
    sizes = np.abs(matrix)
    order, kinds, starts, lists = ordered(sizes, leaving, all_taken=False)
    assert sorted(order) == leaving.tolist()
    rest = matrix.copy()
    for k in range(count):
        if kinds[k] == UNPLANNED:
            break
        if kinds[k] == SECOND:
            continue
        block = order[k : k + kinds[k]]
        if abs(np.linalg.det(rest[np.ix_(block, block)])) < 1e-6:
            # Cancelled by chance, or bound to: another value at the same place, as plans do not foresee either.
            rest[block[0], block[-1]] = rest[block[-1], block[0]] = 10.0
        column = rest[:, block].copy()
        column[block] = 0.0
        assert set(np.flatnonzero(column.any(axis=1))) <= set(lists[starts[k] : starts[k + 1]].tolist())
        rest -= column @ np.linalg.solve(rest[np.ix_(block, block)], column.T)
        rest[np.abs(rest) < 1e-12] = 0.0
        rest[block, :] = rest[:, block] = 0.0
    else:
        assert (sizes[rest != 0.0] != 0.0).all()
        assert not sizes[leaving].any()


@given(SEEDS, st.floats(0.0, 12.0))
def test_loading_scaling_and_residuals(seed, decades):
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 6)), int(rng.integers(0, 5))
    size = n + m
    position = rng.permutation(size).astype(np.int32)
    rows, columns = np.triu_indices(size, 1)
    kept = rng.random(rows.size) < 0.6
    rows, columns = rows[kept].astype(np.int32), columns[kept].astype(np.int32)
    pointers = np.searchsorted(rows, np.arange(size + 1)).astype(np.int32)
    # All off-diagonal entries and one on the diagonal come as entries of H.
    hess = rng.normal(size=rows.size + 1) * 10.0 ** rng.uniform(-decades, decades, rows.size + 1)
    target = np.concatenate([size + np.arange(rows.size), [position[0]]]).astype(np.int32)
    primal, dual = rng.uniform(0, 2, n), rng.uniform(0, 2, m)
    values = np.full(size + rows.size, np.nan)
    none = np.zeros(0)
    check = load(
        n, m, hess.size, 0, hess, none, primal, dual, position, target, np.zeros(0, dtype=np.int32), values
    )
    assert check == 0.0
    matrix = np.zeros((size, size))
    matrix[rows, columns] = matrix[columns, rows] = hess[:-1]
    diagonal = np.concatenate([primal, -dual])
    diagonal[0] += hess[-1]
    matrix[position, position] = diagonal
    np.testing.assert_allclose(values[:size], np.diag(matrix))

    scale, most = np.ones(size), np.zeros(size)
    equilibrate(size, 40, 4.0, pointers, columns, values, scale, most)
    scaled = matrix * scale[:, None] * scale
    upper = np.concatenate([np.diag(scaled), scaled[rows, columns]])
    np.testing.assert_allclose(values, upper, rtol=1e-12)
    largest = np.abs(scaled).max(axis=1)
    used = largest > 0.0
    assert (largest[used] < 4.0).all() and (largest[used] > 0.25).all()

    x, b, r = rng.normal(size=size), rng.normal(size=size), np.zeros(size)
    norm = residual(size, pointers, columns, values, b, x, r)
    np.testing.assert_allclose(r, b - scaled @ x, rtol=1e-12, atol=1e-12)
    assert norm == np.abs(r).max()
    x[0] = np.inf
    assert np.isnan(residual(size, pointers, columns, values, b, x, r))


@given(SEEDS, st.floats(0.0, 12.0))
def test_a_scale_said_to_be_good_is(seed, decades):
    """The last step is taken without another look, so there must be no need for one."""
    rng = np.random.default_rng(seed)
    size = int(rng.integers(1, 12))
    matrix = np.exp(decades * rng.normal(size=(size, size))) * (rng.random((size, size)) < 0.5)
    matrix = np.maximum(matrix, matrix.T)
    scale = np.ones(size)
    for _ in range(40):
        if not find_scale(size, (scale[:, None] * matrix * scale).max(axis=1), scale):
            break
    largest = (scale[:, None] * matrix * scale).max(axis=1)[matrix.any(axis=1)]
    assert (largest < GOOD * (1.0 + 1e-12)).all() and (largest * GOOD * (1.0 + 1e-12) > 1.0).all()


def test_infinite_values_are_seen():
    none, zero = np.zeros(0, dtype=np.int32), np.zeros(1, dtype=np.int32)
    for bad in (np.nan, np.inf, -np.inf):
        values = np.zeros(1)
        assert load(1, 0, 0, 0, values, values, np.array([bad]), values, zero, none, none, values.copy()) == 1
