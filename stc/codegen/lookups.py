"""Looking up a table: the operations of :data:`~stc.codegen.tape.LOOKUPS` as instructions.

What they are made for, and how tables lie in memory, is told in :mod:`stc.symbolic.tables`.
"""

from __future__ import annotations

from collections.abc import Sequence

from stc.codegen.engine import LANES
from stc.codegen.runs import RUN
from stc.codegen.vector import Vector

__all__ = ["clip", "places", "reaches", "read", "read_run"]


def clip(v: Vector, x: str, last: str) -> str:
    """x rounded down, between 0 and ``last``; 0 where it is no number."""
    above = v.select("ogt", x, "zeroinitializer", x, "zeroinitializer")
    return v.intrinsic("trunc", v.select("olt", above, last, above, last))


def reaches(v: Vector, begin: str, x: str) -> str:
    """1 where ``begin`` is not above x, else 0."""
    return v.select("ole", begin, x, v.one(), "zeroinitializer")


def places(v: Vector, place: str) -> list[str]:
    """Where numbers lie, below 2^31, as a register for each lane."""
    whole = f"<{v.lanes} x i32>"
    numbers = v.let(f"fptosi {v.f} {place} to {whole}")
    found = []
    for k in range(v.lanes):
        lane = v.let(f"extractelement {whole} {numbers}, i64 {k}")
        found.append(v.let(f"getelementptr inbounds double, ptr %uniform, i32 {lane}"))
    return found


def read(v: Vector, at: Sequence[str], k: int = 0) -> str:
    """The numbers ``k`` places after given ones (:func:`places`)."""
    result = "poison"
    for lane, pointer in enumerate(at):
        value = v.let(f"load double, ptr {v.pointer(pointer, 8 * k)}, align 8")
        result = v.let(f"insertelement {v.f} {result}, double {value}, i64 {lane}")
    return result


def read_run(v: Vector, at: Sequence[str], k: int) -> list[str]:
    """The :data:`~stc.codegen.runs.RUN` numbers from ``k`` places after given ones on, with a load for each lane."""
    four = f"<{RUN} x double>"
    lanes = [v.let(f"load {four}, ptr {v.pointer(pointer, 8 * k)}, align 8") for pointer in at]
    if len(lanes) == 2 * LANES:
        # Two lanes share a register, those whose halves come to lie beside each other in the last step: that is then
        # a choice of halves, which machines have an instruction for.
        lanes = [v.shuffled(four, lanes[k], lanes[k + 2], range(2 * RUN)) for k in (0, 1, 4, 5)]
    a, b, c, d = lanes
    size = v.lanes
    even = [k + other for k in range(0, size, 2) for other in (0, size)]
    odd = [k + 1 for k in even]
    first = [k + within for k in range(0, 2 * size, 4) for within in (0, 1)]
    second = [k + 2 for k in first]
    pairs = [(v.shuffled(v.f, a, b, chosen), v.shuffled(v.f, c, d, chosen)) for chosen in (even, odd)]
    return [v.shuffled(v.f, *pair, chosen) for chosen in (first, second) for pair in pairs]
