"""Inputs fetched in runs, from wherever they are, against each input fetched by itself."""

from __future__ import annotations

import numpy as np
import pytest
import tape_reference as reference
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from stc.codegen import engine
from stc.codegen.kernel import LANES, compile_tapes
from stc.codegen.runs import RUN, Runs, find_runs, used_inputs
from stc.codegen.tape import Tape, build_tape
from stc.symbolic import expr
from stc.transcription.assemble import blocks

Places = NDArray[np.int64]


def sums(count: int, left_out: int = 0) -> Tape:
    """A tape of ``count`` inputs: their weighted sums, and some of them as they are; the first few are not read."""
    inputs = [expr.sym(f"v{k}") for k in range(count)]
    read = inputs[left_out:]
    ahead = expr.sum_of([(k + 1.0) * e for k, e in enumerate(read)])
    back = expr.sum_of([expr.call("sin", e) * (k + 2.0) for k, e in enumerate(reversed(read))])
    return build_tape([ahead * back, read[-1], read[0] * back], [], [f"v{k}" for k in range(count)])


def evaluated(tape: Tape, places: Places, held: NDArray[np.float64], backend: str) -> NDArray[np.float64]:
    """The tape at all instances, by a kernel that fetches in runs. (outputs, instances)"""
    runs, starts = find_runs(tape, places)
    workspace = np.concatenate([held, np.full(RUN - 1, np.nan)])
    index = blocks(starts, np.int32)
    out = np.zeros((len(index), len(tape.outputs), LANES))
    kernels = compile_tapes([tape], [runs], backend=backend, cache=False)  # type: ignore[arg-type]
    kernels[0](workspace, np.zeros(0), index, out)
    return out.transpose(1, 0, 2).reshape(len(tape.outputs), -1)[:, : places.shape[1]]


@st.composite
def scattered_places(draw: st.DrawFn) -> Places:
    """Neighbours, strangers and the same place twice, with exceptions at some instances."""
    instances = draw(st.integers(1, 23))
    stride = draw(st.integers(0, 9))
    offsets = draw(st.lists(st.integers(0, 30), min_size=1, max_size=12))
    places = np.array(offsets)[:, None] + stride * np.arange(instances)
    for _ in range(draw(st.integers(0, 6))):
        v, k = draw(st.integers(0, len(offsets) - 1)), draw(st.integers(0, instances - 1))
        places[v, k] = draw(st.integers(0, 200))
    return places


@settings(max_examples=60, deadline=None)
@given(scattered_places(), st.integers(0, 3), st.sampled_from([4, 8]))
def test_any_places(places: Places, left_out: int, width: int) -> None:
    tape = sums(len(places), min(left_out, len(places) - 1))
    held = np.random.default_rng(1).uniform(-1.0, 1.0, int(places.max()) + 1)
    expected = reference.run(tape, [], held[places])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(engine, "vector_width", lambda: width)
        for backend in ("llvm", "interpreter"):
            found = evaluated(tape, places, held, backend)
            np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("registers", [1, 32])
@pytest.mark.parametrize("width", [4, 8])
@pytest.mark.parametrize("apart", [1, 2])
def test_many_runs(registers: int, width: int, apart: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "vector_width", lambda: width)
    monkeypatch.setattr(engine, "vector_registers", lambda: registers)
    rng = np.random.default_rng(2)
    places = apart * np.arange(150)[:, None] + rng.integers(0, 500, 21)
    tape, held = sums(150), rng.uniform(-1.0, 1.0, 1000)
    assert find_runs(tape, places)[0].count == (38, 75)[apart - 1]
    expected = reference.run(tape, [], held[places])
    np.testing.assert_allclose(evaluated(tape, places, held, "llvm"), expected, rtol=1e-11, atol=1e-9)


def test_neighbours_are_a_run() -> None:
    frame = 10 * np.arange(20)
    places = np.array([7, 3, 4, 5, 17, 0, 6])[:, None] + frame
    runs, starts = find_runs(sums(7), places)
    assert runs.places == (7, 3, 4, 5, 8, 0, 6)
    assert runs.count == 3
    np.testing.assert_array_equal(starts, np.array([0, 4, 17])[:, None] + frame)


def test_what_is_not_read_is_not_fetched() -> None:
    places = np.arange(4)[:, None] + 4 * np.arange(5)
    tape = sums(4, left_out=2)
    assert used_inputs(tape) == [2, 3]
    assert find_runs(tape, places)[0].places == (-1, -1, 0, 1)


def test_exceptions_make_runs_of_their_own() -> None:
    places = np.arange(3)[:, None] + 5 * np.arange(16)
    places[2, 4] = 90
    assert find_runs(sums(3), places)[0].places == (0, 1, RUN)


def test_inputs_that_differ_at_a_few_instances_only_stay_two() -> None:
    """Both sides of a quantity are one unknown wherever there is no jump."""
    before = 3 * np.arange(12)
    after = before.copy()
    after[5] = 40
    places = np.array([before, after, before + 1])
    held = np.random.default_rng(3).uniform(-1.0, 1.0, 50)
    runs, _ = find_runs(sums(3), places)
    assert runs.places[0] != runs.places[1]
    tape = sums(3)
    expected = reference.run(tape, [], held[places])
    np.testing.assert_allclose(evaluated(tape, places, held, "llvm"), expected, rtol=1e-12)
    # and what is the same everywhere is one
    same, _ = find_runs(sums(3), np.array([before, before, before + 1]))
    assert same.places == (0, 0, 1)


def test_no_instances_and_no_inputs() -> None:
    tape = sums(3)
    runs, starts = find_runs(tape, np.zeros((3, 0), np.int64))
    assert starts.shape == (runs.count, 0)
    constant = build_tape([expr.num(2.0)], [], [])
    assert find_runs(constant, np.zeros((0, 5), np.int64))[0].count == 0


def test_runs_are_part_of_what_is_compiled() -> None:
    tape = sums(3)
    together = find_runs(tape, np.arange(3)[:, None] + 3 * np.arange(8))[0]
    assert together.digest() != Runs.alone(3).digest()
    for runs in (together, Runs.alone(3), together):
        kernels = compile_tapes([tape], [runs], backend="llvm")
        workspace = np.arange(24.0 + RUN)
        index = np.zeros((1, runs.count, LANES), np.int32)
        for v, place in enumerate(runs.places):
            index[:, place // RUN] = v - place % RUN
        out = np.zeros((1, len(tape.outputs), LANES))
        kernels[0](workspace, np.zeros(0), index, out)
        np.testing.assert_allclose(out[0, :, 0], reference.run(tape, [], np.arange(3.0)[:, None])[:, 0])
