"""Instructions that fetch a run of varying inputs (:mod:`stc.codegen.runs`) for all lanes at once.

Each lane's numbers come with one load.  So that registers hold one of them for all lanes each, they are transposed:
eight shuffles for four vectors of four or of eight lanes.
"""

from __future__ import annotations

from collections.abc import Sequence

from stc.codegen.engine import LANES
from stc.codegen.runs import RUN
from stc.codegen.vector import Vector


def fetch(vector: Vector, indices: Sequence[str], offset: int | str) -> list[str]:
    """Registers with the :data:`~stc.codegen.runs.RUN` numbers of a run.

    Args:
        vector: receives the instructions; as wide as one block or two.
        indices: per block the register that points to its indices.
        offset: bytes from there to the indices of the run, a number or a register.
    """
    lanes = []
    for block in indices:
        base = vector.let(f"getelementptr inbounds i8, ptr {block}, i64 {offset}")
        for lane in range(LANES):
            place = vector.let(f"getelementptr inbounds i32, ptr {base}, i64 {lane}")
            position = vector.let(f"load i32, ptr {place}, align 4")
            source = vector.let(f"getelementptr inbounds double, ptr %workspace, i32 {position}")
            lanes.append(vector.let(f"load <{RUN} x double>, ptr {source}, align 8"))
    return transposed(vector, lanes)


def transposed(vector: Vector, lanes: Sequence[str]) -> list[str]:
    """What four or eight registers hold of each of four numbers, as four registers."""
    if len(lanes) == 2 * LANES:
        # Two lanes share a register, those whose halves come to lie beside each other in the last step: that is then
        # a choice of halves, which machines have an instruction for.
        four = f"<{RUN} x double>"
        both = range(2 * RUN)
        lanes = [_shuffled(vector, four, lanes[k], lanes[k + 2], both) for k in (0, 1, 4, 5)]
    a, b, c, d = lanes
    size = vector.lanes
    even = [k + other for k in range(0, size, 2) for other in (0, size)]
    odd = [k + 1 for k in even]
    first = [k + within for k in range(0, 2 * size, 4) for within in (0, 1)]
    second = [k + 2 for k in first]
    pairs = [
        (_shuffled(vector, vector.f, a, b, chosen), _shuffled(vector, vector.f, c, d, chosen))
        for chosen in (even, odd)
    ]
    return [_shuffled(vector, vector.f, *pair, chosen) for chosen in (first, second) for pair in pairs]


def _shuffled(vector: Vector, type_: str, a: str, b: str, chosen: Sequence[int]) -> str:
    mask = ", ".join([f"i32 {k}" for k in chosen])
    return vector.let(f"shufflevector {type_} {a}, {type_} {b}, <{len(chosen)} x i32> <{mask}>")
