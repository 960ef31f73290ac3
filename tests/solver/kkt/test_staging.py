"""Stages and slots: who is in the window when."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from solver.kkt.kkt_problems import STRUCTURES

from stc.solver.kkt.arrangement import Couplings, arrange
from stc.solver.kkt.staging import Staging, assign_stages


def entries(staging: Staging, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """First stage at which an unknown must be there: its own or a neighbour's."""
    entry = staging.stage.copy()
    for a, b in zip(first, second, strict=True):
        entry[a] = min(entry[a], staging.stage[b])
        entry[b] = min(entry[b], staging.stage[a])
    return entry


@given(st.integers(0, 10**6), st.sampled_from(sorted(STRUCTURES)), st.integers(1, 25))
def test_no_two_share_a_slot(seed, structure, frames):
    p = STRUCTURES[structure](np.random.default_rng(seed), frames)
    c = Couplings.of(p.n, p.m, p.jac_rows, p.jac_cols, p.hess_rows, p.hess_cols)
    staging = assign_stages(np.concatenate([p.var_stage, p.row_stage]), p.n, c.first, c.second)
    assert set(staging.stage) == set(range(staging.stages))
    entry = entries(staging, c.first, c.second)
    for stage in range(staging.stages):
        inside = (entry <= stage) & (stage <= staging.stage)
        slots = staging.slot[inside]
        assert np.unique(slots).size == slots.size
        assert slots.max(initial=-1) < staging.top[stage] <= staging.window


@pytest.mark.parametrize("structure", ["chain", "bordered", "absolute", "stencil", "five_points", "mirrored"])
def test_the_window_does_not_grow(structure):
    windows = []
    for frames in (60, 240):
        p = STRUCTURES[structure](np.random.default_rng(1), frames)
        c = Couplings.of(p.n, p.m, p.jac_rows, p.jac_cols, p.hess_rows, p.hess_cols)
        staging = assign_stages(np.concatenate([p.var_stage, p.row_stage]), p.n, c.first, c.second)
        windows.append(staging.window)
    assert windows[1] <= windows[0] + 12


def test_empty():
    none = np.zeros(0, dtype=np.int32)
    assert assign_stages(none, 0, none, none).stages == 0


@given(st.integers(0, 10**6), st.sampled_from(sorted(STRUCTURES)), st.integers(1, 12))
def test_arrangement_is_a_permutation_of_the_upper_triangle(seed, structure, frames):
    rng = np.random.default_rng(seed)
    p = STRUCTURES[structure](rng, frames)
    size = p.n + p.m
    c = Couplings.of(p.n, p.m, p.jac_rows, p.jac_cols, p.hess_rows, p.hess_cols)
    stage = rng.integers(0, 4, size).astype(np.int32)
    rank = rng.integers(0, 5, size).astype(np.int32)
    a = arrange(c, stage, 4, rank)
    assert sorted(a.order) == list(range(size))
    np.testing.assert_array_equal(a.position[a.order], np.arange(size))
    keys = stage[a.order].astype(int) * 10 + rank[a.order]
    assert (np.diff(keys) >= 0).all()
    np.testing.assert_array_equal(np.searchsorted(stage[a.order], np.arange(5)), a.stage_pointers)
    rows = np.repeat(np.arange(size), np.diff(a.pointers))
    assert (a.columns > rows).all()

    def place(one: int, other: int) -> tuple[int, int]:
        return tuple(sorted((int(a.position[one]), int(a.position[other]))))

    for k in range(p.hess_rows.size):
        target = a.hess_target[k] - size
        if target < 0:
            assert p.hess_rows[k] == p.hess_cols[k] == a.order[target + size]
        else:
            assert (rows[target], a.columns[target]) == place(p.hess_rows[k], p.hess_cols[k])
    for k in range(p.jac_rows.size):
        target = a.jac_target[k] - size
        assert (rows[target], a.columns[target]) == place(p.n + p.jac_rows[k], p.jac_cols[k])
    targets = np.concatenate([a.hess_target, a.jac_target])
    assert np.unique(targets).size == targets.size
