"""Groups of pivots against sets of slots that are eliminated one after the other."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from solver.kkt.kkt_problems import symmetric

from stc.solver.kkt.grouping import MEMBERS, group_stage
from stc.solver.kkt.ordering import COMPARED, MARGIN, SECOND, SETS, SMALLEST, order_stage
from stc.solver.kkt.slot_sets import words_of


def eliminated(pattern: np.ndarray, block: np.ndarray) -> set[int]:
    """Take one or two slots out of a pattern of entries; the others that they couple with."""
    coupled = {int(k) for k in np.flatnonzero(pattern[block].any(axis=0))} - set(block.tolist())
    of = [{k for k in coupled if pattern[slot, k]} for slot in block.tolist()]
    inverse = np.ones((1, 1))
    if block.size == 2:
        inverse = np.linalg.inv(np.where(pattern[np.ix_(block, block)], [[0.3, 1.0], [1.0, 0.7]], 0.0))
    for i, first in enumerate(of):
        for j, second in enumerate(of):
            if abs(inverse[i, j]) > 1e-9:
                for a in first:
                    for b in second:
                        pattern[a, b] = pattern[b, a] = True
    pattern[block] = pattern[:, block] = False
    return coupled


@given(st.integers(0, 10**6), st.sampled_from([0.1, 0.3, 0.6]))
def test_groups_have_the_rows_of_their_pivots(seed, density):
    rng = np.random.default_rng(seed)
    top = int(rng.integers(2, 70))
    matrix = symmetric(rng, top, density)
    matrix[np.diag_indices(top)] *= rng.random(top) < 0.6
    leaving = np.sort(rng.choice(top, size=int(rng.integers(1, top + 1)), replace=False)).astype(np.int32)
    count = leaving.size
    before = matrix.reshape(-1).copy()
    cover = ((matrix != 0.0) | (symmetric(rng, top, 0.02) != 0.0)).astype(float)
    started = cover != 0.0

    order, kinds = np.zeros(count, dtype=np.int32), np.zeros(count, dtype=np.int32)
    starts, lists = np.zeros(count + 1, dtype=np.int32), np.zeros((count + 1) * top, dtype=np.int32)
    degree, row_p, row_q = (np.zeros(top, dtype=np.int32) for _ in range(3))
    bits = np.zeros((top + SETS) * words_of(top), dtype=np.int64)
    order_stage(
        top, count, leaving, MARGIN, COMPARED, 0, matrix.reshape(-1), degree, np.zeros(top), row_p, row_q,
        bits, 50, np.zeros(50, dtype=np.int32), np.zeros(50, dtype=np.int32), np.zeros(50), order, kinds, starts,
        lists.size, lists,
    )  # fmt: skip
    left = matrix.copy()
    group, fixed = np.zeros(count, dtype=np.int32), np.zeros(count, dtype=np.int32)
    group_starts, surplus_starts, cut = (np.zeros(count + 1, dtype=np.int32) for _ in range(3))
    rows = np.zeros(2 * count * top, dtype=np.int32)
    used = group_stage(
        top, count, order, kinds, starts, lists, before, bits, matrix.reshape(-1), cover.reshape(-1), row_p, row_q,
        np.zeros(count + 1), np.zeros(count + 1), cut, group, fixed, group_starts, surplus_starts, rows,
    )  # fmt: skip

    assert group.sum() == count and group.max() <= MEMBERS
    assert group_starts[count] == surplus_starts[0] and surplus_starts[count] == used
    exact, whole = before.reshape(top, top) != 0.0, started.copy()
    for begin in np.flatnonzero(group):
        members = order[begin : begin + group[begin]]
        assert kinds[begin] != SECOND
        coupled: set[int] = set()
        for k in range(begin, begin + group[begin]):
            if kinds[k] != SECOND:
                coupled |= eliminated(exact, order[k : k + (2 if kinds[k] == 2 else 1)])
        coupled -= set(members.tolist())
        listed = rows[group_starts[begin] : group_starts[begin + 1]].tolist()
        assert listed == sorted(coupled)
        assert fixed[begin] == (not exact[np.ix_(listed, listed)].all())
        possible = {int(k) for k in np.flatnonzero(whole[members].any(axis=0))} - set(members.tolist())
        assert rows[surplus_starts[begin] : surplus_starts[begin + 1]].tolist() == sorted(possible - coupled)
        whole[np.ix_(sorted(possible), sorted(possible))] = True
        whole[members] = whole[:, members] = False
    np.testing.assert_array_equal(cover != 0.0, whole)
    np.testing.assert_array_equal(matrix, np.where((left == 0.0) & exact, SMALLEST, left))
