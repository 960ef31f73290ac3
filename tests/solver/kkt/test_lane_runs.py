"""Entries of several steps at once: what eight segments load must be what each of their steps has in memory."""

from __future__ import annotations

import numpy as np
import pytest
from chains import chain
from hypothesis import given, settings
from hypothesis import strategies as st

import stc
from stc.solver import Options, minimize
from stc.solver.kkt import lane_runs, lanes, segments, structured_kkt
from stc.solver.kkt.segments import LANES


def _blocks(steps: int, entries: int, shift: int, width: int, interleaved: int) -> np.ndarray:
    """Where kernels leave entries, in blocks of ``width`` points of which a step has ``interleaved``, (steps, ...)."""
    point = np.arange(steps)[:, None] * interleaved + shift + np.arange(interleaved)
    block, inside = point // width, point % width
    return (block[..., None] * width * entries + width * np.arange(entries) + inside[..., None]).reshape(
        steps, -1
    )


@st.composite
def sources(draw):
    """Entries in blocks, in pairs, and anywhere; segments begin at whole runs of each other, or do not."""
    steps = draw(st.integers(3, 19))
    apart = draw(st.sampled_from([4 * steps, 4 * steps + 8, 4 * steps + 1]))
    parts, begin = [], 0
    for interleaved, width in draw(
        st.lists(st.sampled_from([(1, 4), (1, 8), (2, 4), (2, 8), (3, 4)]), max_size=4)
    ):
        shift, entries = draw(st.integers(0, 7)), draw(st.integers(1, 3))
        lanes_ = [
            begin + _blocks(steps, entries, shift + interleaved * lane * apart, width, interleaved)
            for lane in range(LANES)
        ]
        parts.append(np.stack(lanes_, axis=2))
        begin = int(parts[-1].max()) + 5
    single = draw(st.integers(0, 2))
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    parts.append(begin + rng.integers(0, 400, size=(steps, single, LANES)))
    whole = np.concatenate(parts, axis=1).astype(np.int32)
    return whole[:, rng.permutation(whole.shape[1])]


@settings(deadline=None, max_examples=100)
@given(sources())
def test_each_step_finds_its_own_entries(where):
    steps, entries, _ = where.shape
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lane_runs, "MOST_SINGLE", 1.0)
        runs = lane_runs.runs_of(where)
    assert runs is not None
    listed = np.sort(runs[lane_runs.LISTED :])
    np.testing.assert_array_equal(listed, np.arange(entries))
    memory = np.random.default_rng(0).normal(size=int(where.max(initial=0)) + 1)
    ring = np.full(8 * lane_runs.RUN * max(entries, 1), np.nan)
    flat = where.reshape(-1) if entries else np.zeros(1, np.int32)
    for step in range(steps):
        lane_runs.bring_entries(step, steps, entries, runs, flat, memory, ring)
        own = ring[8 * entries * (step % lane_runs.RUN) :][: 8 * entries].reshape(entries, LANES)
        np.testing.assert_array_equal(own, memory[where[step]])


def test_runs_are_found_as_long_as_they_are_and_others_left():
    blocks = np.stack([_blocks(16, 3, 2 + 64 * lane, 4, 1) for lane in range(LANES)], axis=2).astype(np.int32)
    runs = lane_runs.runs_of(blocks)
    assert runs[: lane_runs.LISTED].tolist() == [0, 0, 3, 0, 0, 0, 0]
    pairs = np.stack([_blocks(16, 3, 128 * lane, 4, 2) for lane in range(LANES)], axis=2).astype(np.int32)
    runs = lane_runs.runs_of(pairs)
    assert runs[: lane_runs.LISTED].tolist() == [0, 0, 0, 0, 3, 0, 0]
    shifted = np.stack([_blocks(16, 3, 65 * lane, 4, 1) for lane in range(LANES)], axis=2).astype(np.int32)
    assert lane_runs.runs_of(shifted) is None


@pytest.mark.parametrize("spec", ["cart_pole_swing_up", chain(3, relative=False)], ids=["pairs", "fours"])
def test_factors_are_the_same_bits(monkeypatch, spec):
    found = []
    for many in (0, 10**9):
        monkeypatch.setattr(lane_runs, "MANY_ENTRIES", many)
        monkeypatch.setattr(lane_runs, "NOT_NEAR", 0)
        monkeypatch.setattr(segments, "WHOLE", 1.0)
        monkeypatch.setattr("stc.solver.kkt.reuse.LARGEST", 0)  # nothing is taken over
        systems = []

        def new(*pattern, systems=systems):
            systems.append(structured_kkt(*pattern))
            return systems[-1]

        problem, transcription = stc.load(spec).transcription(n=130)
        result = minimize(
            transcription.bind(problem.constants), Options(max_iterations=8, retries=0), new_kkt=new
        )
        segmented = systems[0].system
        used = [int(row[lanes.RUNS]) > 0 for row in segmented._layout.table]
        assert any(used) == (many == 0)
        found.append((result.x, segmented._plan_in_use().factors.copy(), segmented._matrix.copy()))
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)
