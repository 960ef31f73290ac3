"""One panel of pivots in eight matrices at once, against NumPy, with each instruction set."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from core.instruction_sets import INSTRUCTIONS, need

from stc.arrays import aligned_zeros
from stc.core.functions import Function
from stc.solver.kkt.lane_panel import KNOWN, panel_vectors, take_panel
from stc.solver.kkt.lane_program import triangle
from stc.solver.kkt.lane_state import NEGATIVE, STATE, WORST

GROWTH, SUSPECT = 1e-3, 1e-5
KINDS = {
    1: ["1"],
    2: ["11", "20"],
    3: ["111", "201", "120"],
    4: ["1111", "2011", "1201", "1120", "2020"],
}
CASES = [
    (kinds, count, streamed)
    for each in KINDS.values()
    for kinds in each
    for count in (0, 1, 2, 5, 8)
    for streamed in (0, 1)
]

Call = Callable[..., None]


@pytest.fixture(scope="module", params=INSTRUCTIONS)
def take(request: pytest.FixtureRequest) -> Call:
    """``take_panel`` with registers of two, four and eight numbers."""
    need(request.param)
    return Function(take_panel.name, request.param)


def corner_of(factors: np.ndarray, kinds: str) -> tuple[np.ndarray, np.ndarray]:
    """L and D^-1, (8, members, members) each, from what is kept of the corner."""
    members = len(kinds)
    lower, inverse = np.zeros((8, members, members)), np.zeros((8, members, members))
    at = 0
    for p in range(members):
        lower[:, p, p] = 1.0
        for q in range(p, members):
            value = factors[8 * at : 8 * at + 8]
            if q == p:
                inverse[:, p, p] = value
            elif q == p + 1 and kinds[p] == "2":
                inverse[:, p, q] = inverse[:, q, p] = value
            else:
                lower[:, q, p] = value
            at += 1
    return lower, inverse


@pytest.mark.parametrize(("kinds", "count", "streamed"), CASES)
def test_a_panel_is_taken_out(take: Call, kinds: str, count: int, streamed: int) -> None:
    rng = np.random.default_rng(int(kinds) + 17 * count)
    members = len(kinds)
    size = members + count + 2
    matrices = rng.normal(size=(8, size, size))
    matrices += matrices.transpose(0, 2, 1)
    who = rng.permutation(size)[:members]
    for p, kind in enumerate(kinds):
        if kind == "1":  # strong enough pivots of both signs
            matrices[:, who[p], who[p]] += 6.0 * rng.choice([-1.0, 1.0], size=8)
        elif kind == "2":
            matrices[:, who[p], who[p + 1]] += 6.0
            matrices[:, who[p + 1], who[p]] += 6.0
    rows = np.sort(rng.permutation(np.setdiff1d(np.arange(size), who))[:count])
    i, j = np.tril_indices(size)
    work = aligned_zeros(8 * i.size)
    work.reshape(-1, 8)[triangle(i, j)] = matrices[:, i, j].T
    before = work.copy()
    vectors = panel_vectors(members, count)
    made, target = aligned_zeros(8 * vectors), aligned_zeros(8 * vectors)
    state = aligned_zeros(STATE)
    columns = np.concatenate([who, rows])
    sources = triangle(who[:, None], columns[None, :]).reshape(-1).astype(np.int32)
    take(
        0, streamed, members, count, np.array([int(kind) for kind in kinds], dtype=np.int32), rows.astype(np.int32),
        sources, GROWTH, SUSPECT, work, aligned_zeros(KNOWN), made, target, state,
    )  # fmt: skip

    inner = matrices[:, who[:, None], who]
    beside = matrices[:, who[:, None], rows]
    left = matrices[:, rows[:, None], rows] - beside.transpose(0, 2, 1) @ np.linalg.solve(inner, beside)
    a, b = np.tril_indices(count)
    expected = before.reshape(-1, 8).copy()
    expected[triangle(rows[a], rows[b])] = left[:, a, b].T
    np.testing.assert_allclose(work.reshape(-1, 8), expected, rtol=1e-11, atol=1e-11)

    if streamed:
        np.testing.assert_array_equal(target, made)
    else:
        assert not target.any()
    lower, inverse = corner_of(made, kinds)
    diagonal = np.linalg.inv(inverse)
    np.testing.assert_allclose(lower @ diagonal @ lower.transpose(0, 2, 1), inner, rtol=1e-11, atol=1e-11)
    kept = made[8 * panel_vectors(members, 0) :].reshape(count, members, 8).transpose(2, 1, 0)
    own = np.linalg.solve(lower, beside)
    np.testing.assert_allclose(kept, inverse @ own, rtol=1e-11, atol=1e-11)

    negative = (np.linalg.eigvalsh(inner) < 0.0).sum(axis=1)
    np.testing.assert_array_equal(state[NEGATIVE : NEGATIVE + 8], negative)
    test = state[WORST : WORST + 8]
    assert (test >= SUSPECT * np.abs(inverse).max(axis=(1, 2)) * (1 - 1e-14)).all()
    if count:
        products = np.abs(own).max(axis=2) * np.abs(kept).max(axis=2)
        assert (test >= GROWTH * products.max(axis=1) * (1 - 1e-14)).all()


@pytest.mark.parametrize("kinds", ["1", "20", "1201", "2020"])
def test_a_pivot_that_is_nothing_is_noticed(take: Call, kinds: str) -> None:
    """Also where D^-1 is 0 times infinity."""
    members = len(kinds)
    work = aligned_zeros(8 * members * (members + 1) // 2)
    diagonal = np.arange(members)
    work.reshape(-1, 8)[triangle(diagonal, diagonal)] = 1.0
    if kinds != "1":
        p = kinds.index("2")
        pair = triangle(np.array([p, p + 1, p + 1]), np.array([p, p, p + 1]))
        work.reshape(-1, 8)[pair[1]] = 2.0
        work.reshape(-1, 8)[pair, 3] = 0.0
    else:
        work[3] = 0.0
    state = aligned_zeros(STATE)
    sources = triangle(diagonal[:, None], diagonal[None, :]).reshape(-1).astype(np.int32)
    nothing, made = np.zeros(0, dtype=np.int32), aligned_zeros(8 * panel_vectors(members, 0))
    with np.errstate(all="ignore"):
        take(
            0, 0, members, 0, np.array([int(kind) for kind in kinds], dtype=np.int32), nothing, sources, GROWTH,
            SUSPECT, work, aligned_zeros(KNOWN), made, made.copy(), state,
        )  # fmt: skip
    np.testing.assert_array_equal(state[WORST : WORST + 8] < 1.0, np.arange(8) != 3)
