"""The order of pivots in a stage, and scales, against plain NumPy."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from solver.kkt.kkt_problems import symmetric

from stc.core.functions import function
from stc.solver.kkt.ordering import MARGIN, SECOND, SETS, order_stage
from stc.solver.kkt.slot_sets import words_of

SEEDS = st.integers(0, 10**6)
#: Pivots with so many times the fewest multiplications are compared by their fill; unknowns that are no pivots.
COMPARED, UNPLANNED = 2.0, -1
#: A scale is good when the largest entries of all rows are within this factor of 1.
GOOD = 2.0
find_scale = function("values_find_scale")


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
