"""Equations that are too many for the variables of their stage wait for the next one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching
from solver.kkt.kkt_problems import Builder, Pattern, Values, generic
from solver.kkt.motions import chain_of, structure
from solver.kkt.test_contract import check

import stc
from stc.solver.kkt.chain import ChainKKT
from stc.solver.kkt.planned import PlannedKKT
from stc.solver.kkt.postponing import postponed
from stc.solver.kkt.segments import row_of_stages

DOUBLE_CART = """
constants: n = 24, g = 9.81, M = 1.6, m1 = 0.3, m2 = 0.2, l1 = 0.5, l2 = 0.4, most = 42, T = 2.5;
variables: x, a, b, u;              # a cart with two rods, which hang at first and stand in the end
method: hermite-simpson;
definitions: h = T/n; x1 = x + l1/2*sin(a); z1 = -l1/2*cos(a); x2 = x + l1*sin(a) + l2/2*sin(b);
  z2 = -l1*cos(a) - l2/2*cos(b);
lagrangian: M/2*x'^2 + m1/2*(x1'^2 + z1'^2) + m1*l1^2/24*a'^2 + m2/2*(x2'^2 + z2'^2) + m2*l2^2/24*b'^2
  - m1*g*z1 - m2*g*z2;
forces: x: u;
guess: a = pi*i/n; b = pi*i/n;
constraints:
  [0, n]: -most <= u <= most; -2 <= x <= 2;
  [0]: x; a; b; x'; a'; b';
  [n]: x; a = pi; b = pi; x'; a'; b';
objective: [0, n]: integral(u^2/100);
"""


def from_a_given_state(
    rng: np.random.Generator,
    frames: int,
    states: int,
    controls: int,
    *,
    rates: bool = False,
    to_a_given_one: bool = False,
) -> tuple[Pattern, np.ndarray]:
    """The next state is a function of this one and of the controls; which variables are held, those of the first.

    Args:
        rates: whether it is one of rates, which are variables, too, and have equations with the controls of their own.
        to_a_given_one: whether the last state is held as well.
    """
    b = Builder(rng)
    count = states * (2 if rates else 1) + controls
    x = [b.variables(count, i) for i in range(frames)]
    for i in range(frames):
        b.curvature(x[i], 1.0)
        for k in range(states if rates else 0):
            b.row(i, [*x[i][:states], x[i][states + k], *x[i][2 * states :]])
        for k in range(states if i + 1 < frames else 0):
            own = [*x[i][:states], *x[i][states : 2 * states]] if rates else x[i]
            b.row(i, [*own, x[i + 1][k]])
    pattern = b.pattern()
    held = np.zeros(pattern.n, dtype=bool)
    held[x[0][:states]] = True
    if to_a_given_one:
        held[x[-1][:states]] = True
    return pattern, held


def stages_of(pattern: Pattern, held: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The stages of all unknowns, without and with waiting."""
    couplings, stage = structure(pattern)
    row = row_of_stages(couplings, stage)
    assert row is not None
    before = stage.astype(np.int32)
    return before, postponed(couplings, before, row.border, held, np.ones(pattern.m, dtype=bool))


def values_of(rng: np.random.Generator, pattern: Pattern, held: np.ndarray) -> Values:
    """Nothing on the diagonal of the rows, and nothing where variables are held but there."""
    values = generic(rng, pattern)
    values.dual[:] = 0.0
    values.jac[held[pattern.jac_cols]] = 0.0
    values.hess[held[pattern.hess_rows] | held[pattern.hess_cols]] = 0.0
    return values


@pytest.mark.parametrize(
    ("states", "controls", "wait"),
    [(4, 1, [3, 2, 1]), (4, 2, [2]), (6, 2, [4, 2]), (2, 2, []), (3, 5, [])],
)
def test_as_many_wait_as_variables_are_missing(states: int, controls: int, wait: list[int]) -> None:
    """Each stage brings as many variables too many as it has controls."""
    pattern, held = from_a_given_state(np.random.default_rng(states), 20, states, controls)
    before, after = stages_of(pattern, held)
    moved = np.flatnonzero(after != before)
    assert np.all(after[moved] == before[moved] + 1)
    assert np.bincount(before[moved]).tolist() == wait
    assert (after is before) == (not wait)


@pytest.mark.parametrize("states", [2, 4])
def test_controls_are_not_used_up(states: int) -> None:
    """Where rates come between, states wait in all stages but the last one: controls are for no equation to take."""
    pattern, held = from_a_given_state(
        np.random.default_rng(3), 20, states, 1, rates=True, to_a_given_one=True
    )
    before, after = stages_of(pattern, held)
    assert np.bincount(before[after != before]).tolist() == 18 * [states]  # the last state is given
    pattern, held = from_a_given_state(np.random.default_rng(3), 20, states, states, rates=True)
    before, after = stages_of(pattern, held)
    assert after is before  # there are enough


@given(st.integers(1, 6), st.integers(1, 3), st.booleans(), st.booleans(), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_what_is_left_has_variables_of_its_own(
    states: int, controls: int, rates: bool, ends: bool, seed: int
) -> None:
    """In each stage and those before it, by another matching; and nothing waits for longer than a stage."""
    pattern, held = from_a_given_state(
        np.random.default_rng(seed), 18, states, controls, rates=rates, to_a_given_one=ends
    )
    before, after = stages_of(pattern, held)
    couplings, _ = structure(pattern)
    assert np.all(np.abs(after[couplings.first] - after[couplings.second]) <= 1)
    assert set(np.unique(after - before)) <= {0, 1}
    entries = np.ones(pattern.jac_rows.size)
    jacobian = csr_matrix((entries, (pattern.jac_rows, pattern.jac_cols)), shape=(pattern.m, pattern.n))
    for last in range(17):  # what is left of the last state has none
        rows = np.flatnonzero(after[pattern.n :] <= last)
        free = np.flatnonzero((after[: pattern.n] <= last) & ~held)
        if rows.size:
            partners = maximum_bipartite_matching(csr_matrix(jacobian[rows][:, free]), perm_type="column")
            assert np.count_nonzero(partners >= 0) == rows.size


@pytest.mark.parametrize("folded", [False, True], ids=["from one end", "from both"])
@pytest.mark.parametrize("rates", [False, True], ids=["explicit", "rates between"])
@pytest.mark.parametrize(("states", "controls"), [(4, 1), (6, 2), (5, 3)])
def test_the_matrix_is_factorised_as_planned(states: int, controls: int, rates: bool, folded: bool) -> None:
    rng = np.random.default_rng(7 * states)
    pattern, held = from_a_given_state(rng, 20, states, controls, rates=rates)
    equations = np.ones(pattern.m, dtype=bool)
    kkt = chain_of(pattern, held, equations, folded=folded)
    for _ in range(3):
        check(kkt, pattern, values_of(rng, pattern, held), rng)
        assert kkt._by_plan
    other = chain_of(pattern, held, folded=folded)
    check(other, pattern, values_of(rng, pattern, held), rng)
    assert not other._by_plan


def test_a_motion_from_a_given_state_goes_to_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three coordinates and one force: six equations of the first stages wait."""
    whole: list[PlannedKKT] = []
    refactor_whole = PlannedKKT._refactor_whole

    def counted(self: PlannedKKT) -> object:
        assert isinstance(self, ChainKKT)
        whole.append(self)
        return refactor_whole(self)

    monkeypatch.setattr(PlannedKKT, "_refactor_whole", counted)
    solution = stc.load(DOUBLE_CART).solve(fewer_first=False)
    assert solution.status == "optimal"
    assert len(whole) <= 0.1 * solution.factorizations
