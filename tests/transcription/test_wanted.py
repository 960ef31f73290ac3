"""What evaluators of one program share, and that parts of it are evaluated as the whole is."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from stc.core.calls import chain
from stc.errors import Source
from stc.language.elaborate import elaborate
from stc.language.parser import parse
from stc.solver.evaluator import Part, Scaling
from stc.transcription import evaluation, transcribe
from stc.transcription.bind import BoundProgram

PROBLEMS = Path(__file__).parent.parent / "problems" / "traj"


@pytest.fixture(scope="module")
def program() -> BoundProgram:
    """Seven groups of nodes, parameters among the unknowns."""
    source = Source("hop", (PROBLEMS / "hop_free_durations.stc").read_text())
    transcription = transcribe(elaborate(parse(source), {"n": 16, "a": 6, "b": 10}))
    transcription.compile()
    return transcription.bind(check=False)


def some_part(nlp: BoundProgram, seed: int) -> Part:
    """Some variables, and the rows that they are in."""
    variables = np.random.default_rng(seed).random(nlp.n) > 0.6
    rows = np.zeros(nlp.m, bool)
    rows[nlp.jac_rows[variables[nlp.jac_cols]]] = True
    assert not rows.all()
    return Part.of(nlp, nlp.x0, variables, rows)


@pytest.mark.parametrize("seed", range(4))
def test_a_part_is_evaluated_as_it_is_in_the_whole(program: BoundProgram, seed: int) -> None:
    rng = np.random.default_rng(seed)
    part = some_part(program, seed)
    x = part.x.copy()
    x[part.cols] += 0.1 * rng.standard_normal(len(part.cols))
    y = np.zeros(program.m)
    y[part.rows] = rng.standard_normal(len(part.rows))
    scaling = Scaling.none(len(part.cols), len(part.rows))
    for _ in range(2):  # what the first one has found serves the second
        own = program.part_evaluator(scaling, part)
        own.x[:], own.y[:] = x[part.cols], y[part.rows]
        chain([own.values_call, own.derivatives_call])()
        f, rows = program.values(x)
        assert own.f[0] == f
        np.testing.assert_array_equal(own.r, rows[part.rows])
        gradient, jac, hess = program.derivatives(x, y, 1.0)
        np.testing.assert_array_equal(own.gradient, gradient[part.cols])
        np.testing.assert_array_equal(own.jac, jac[part.jac])
        np.testing.assert_array_equal(own.hess, hess[part.hess])


def test_what_does_not_depend_on_the_scaling_is_found_once(program: BoundProgram) -> None:
    parts = [some_part(program, seed) for seed in range(3)]
    whole = program.wanted(None)
    assert program.wanted(None) is whole
    first = program.wanted(parts[0])
    assert program.wanted(parts[0]) is first and program.wanted(None) is whole
    program.wanted(parts[1])  # of two that are remembered it displaces the first one
    program.wanted(parts[2])
    assert program.wanted(parts[0]) is not first
    outputs = whole.outputs(0, program.program.varying_size)
    assert whole.outputs(0, program.program.varying_size) is outputs
    assert program.pieces(values=False, cut=True) is program.pieces(values=False, cut=True)


@pytest.mark.parametrize(("outputs", "operations"), [(1, 1), (200, 10**9), (10**9, 3000), (10**9, 10**9)])
def test_short_pieces_are_taken_together(
    program: BoundProgram, monkeypatch: pytest.MonkeyPatch, outputs: int, operations: int
) -> None:
    pieces = program.pieces(values=False, cut=False)
    monkeypatch.setattr(evaluation, "OUTPUTS", outputs)
    monkeypatch.setattr(evaluation, "OPERATIONS", operations)
    together = list(evaluation._together(pieces))
    assert [piece for some in together for piece in some] == pieces
    for some in together:
        assert all(one.end == other.begin for one, other in pairwise(some))
        if len(some) > 1:
            assert some[-1].end - some[0].begin <= outputs
            assert sum(piece.operations for piece in some) <= operations
    for some, following in pairwise(together):
        more = [*some, following[0]]
        assert more[-1].end - more[0].begin > outputs or sum(p.operations for p in more) > operations
