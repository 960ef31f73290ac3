"""How many operations the derivatives of a chain of rods take, and how the number grows with the rods."""

from __future__ import annotations

import pytest
from chains import WAYS, chain

from stc.errors import Source
from stc.language import read_problem
from stc.transcription import transcribe


def operations(rods: int, relative: bool, way: str) -> tuple[int, int]:
    """Per node: of the equations, and of their derivatives."""
    program = transcribe(read_problem(Source("chain.stc", chain(rods, relative, way)))).program
    tapes = [(group.programs.values_tape, group.programs.derivatives_tape) for group in program.groups]
    values, derivatives = (max(len(tape.ops) for tape in of_kind) for of_kind in zip(*tapes, strict=True))
    return values, derivatives


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("relative", [False, True], ids=["absolute", "relative"])
def test_equations_grow_linearly_and_derivatives_hardly_faster_than_their_number(
    relative: bool, way: str
) -> None:
    few, many = operations(5, relative, way), operations(10, relative, way)
    assert many[0] < 2**1.6 * few[0]
    assert many[1] < 2**2.8 * few[1]
    assert few[0] < 400
    assert few[1] < 3500
