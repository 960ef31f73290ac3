"""Looking up a table: the operations of :data:`~stc.codegen.tape.LOOKUPS` as instructions.

What they are made for, and how tables lie in memory, is told in :mod:`stc.symbolic.tables`.
"""

from __future__ import annotations

from collections.abc import Sequence

from stc.codegen.fetching import transposed
from stc.codegen.runs import RUN
from stc.codegen.vector import Vector

__all__ = ["clip", "places", "reaches", "read", "read_run"]


def clip(v: Vector, x: str, last: str) -> str:
    """x rounded down, between 0 and ``last``; 0 where it is no number."""
    above = v.select(v.compare("ogt", x, v.real(0.0)), x, v.real(0.0))
    inside = v.select(v.compare("olt", above, last), above, last)
    return v.call("trunc", inside)


def reaches(v: Vector, begin: str, x: str) -> str:
    """1 where ``begin`` is not above x, else 0."""
    return v.select(v.compare("ole", begin, x), v.real(1.0), v.real(0.0))


def places(v: Vector, place: str) -> list[str]:
    """Where numbers lie, below 2^31, as a register for each lane."""
    if v.lanes == 1:
        return [_pointer(v, v.let(f"fptosi double {place} to i64"))]
    whole = f"<{v.lanes} x i32>"
    numbers = v.let(f"fptosi {v.f} {place} to {whole}")
    found = []
    for k in range(v.lanes):
        lane = v.let(f"extractelement {whole} {numbers}, i64 {k}")
        found.append(_pointer(v, v.let(f"zext i32 {lane} to i64")))
    return found


def _pointer(v: Vector, place: str) -> str:
    return v.let(f"getelementptr inbounds double, ptr %uniform, i64 {place}")


def _further(v: Vector, pointer: str, k: int) -> str:
    return v.let(f"getelementptr inbounds double, ptr {pointer}, i64 {k}") if k else pointer


def read(v: Vector, at: Sequence[str], k: int = 0) -> str:
    """The numbers ``k`` places after given ones (:func:`places`)."""
    result = "poison"
    for lane, pointer in enumerate(at):
        value = v.let(f"load double, ptr {_further(v, pointer, k)}, align 8")
        result = value if v.lanes == 1 else v.let(f"insertelement {v.f} {result}, double {value}, i64 {lane}")
    return result


def read_run(v: Vector, at: Sequence[str], k: int) -> list[str]:
    """The :data:`~stc.codegen.runs.RUN` numbers from ``k`` places after given ones on, with a load for each lane."""
    loads = [v.let(f"load <{RUN} x double>, ptr {_further(v, pointer, k)}, align 8") for pointer in at]
    return transposed(v, loads)
