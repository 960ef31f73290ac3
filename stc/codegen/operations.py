"""Operations of tapes as instructions: arithmetic in place, elementary functions by calls of the core.

Such a call (``stc/core/tapes.c``) loses what registers hold, so :mod:`stc.codegen.residency` moves that to memory
first.  What looking up a table is made for, and how tables lie in memory, is told in :mod:`stc.symbolic.tables`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from stc.codegen.engine import LANES
from stc.codegen.runs import RUN
from stc.codegen.tape import CIRCULAR, Tape
from stc.codegen.vector import Vector
from stc.symbolic.tables import CLIP, REACHES, READ

_ARITHMETIC: Final = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
_IN_PLACE: Final = {*_ARITHMETIC, "neg", "sqrt", CLIP, REACHES, READ}


class Operations:
    """Emits a tape's operations through a :class:`Vector`, pairing sines and cosines of one argument."""

    def __init__(self, tape: Tape, vector: Vector) -> None:
        self.vector = vector
        self._circular: dict[int, tuple[str, str]] = {}
        self._places: dict[int, list[str]] = {}
        self._literals: dict[int, int] = {}
        self._runs = self._read_together(tape)

    def _read_together(self, tape: Tape) -> dict[int, list[tuple[int, list[int]]]]:
        """Per slot of a place, the runs of numbers that one load brings: the first one, and the literals wanted."""
        wanted: dict[int, set[int]] = {}
        for op, a, b in tape.ops:
            if op == READ:
                self._literals[b] = int(tape.constants[b - tape.first_literal])
                wanted.setdefault(a, set()).add(b)
        found: dict[int, list[tuple[int, list[int]]]] = {}
        for slot, literals in wanted.items():
            runs: list[tuple[int, list[int]]] = []
            for literal in sorted(literals, key=self._literals.__getitem__):
                k = self._literals[literal]
                if not runs or k >= runs[-1][0] + RUN:
                    runs.append((k, []))
                runs[-1][1].append(literal)
            found[slot] = runs
        return found

    def calls(self, op: str, slot: int) -> bool:
        """Whether emitting the operation now would call a function; ``slot`` identifies the first operand."""
        return op not in _IN_PLACE and slot not in self._circular

    def emit(self, op: str, slot: int, a: str, b: str, other: int = -1) -> str:
        """Result of one operation; ``slot`` identifies the first operand, ``other`` the second one."""
        vector = self.vector
        if op in _ARITHMETIC:
            return vector.arithmetic(_ARITHMETIC[op], a, b)
        if op == "neg":
            return vector.neg(a)
        if op == "sqrt":
            return vector.intrinsic("sqrt", a)
        if op == READ:
            return self.read(slot, a, other)[other]
        if op == CLIP:
            return _clip(vector, a, b)
        if op == REACHES:
            return _reaches(vector, a, b)
        if op in CIRCULAR:
            sine, cosine = self.circular(slot, a)
            if op == "tan":
                return vector.arithmetic("fdiv", sine, cosine)
            return sine if op == "sin" else cosine
        return vector.called(op, [a, b] if b else [a], 1)[0]

    def read(self, slot: int, place: str, number: int) -> dict[int, str]:
        """The number so many places after each lane's, and what is wanted of the three after it: by their literals."""
        at = self._places.get(slot)
        if at is None:
            at = self._places[slot] = _places(self.vector, place)
        for first, together in self._runs[slot]:
            if number in together:
                if len(together) == 1:
                    return {number: _read(self.vector, at, self._literals[number])}
                found = _read_run(self.vector, at, first)
                return {each: found[self._literals[each] - first] for each in together}
        raise KeyError(number)

    def circular(self, slot: int, angle: str) -> tuple[str, str]:
        """Sine and cosine of an angle, which its slot identifies: by a call where they are not known yet."""
        if slot not in self._circular:
            sine, cosine = self.vector.called("sincos", [angle], 2)
            self._circular[slot] = sine, cosine
        return self._circular[slot]


# What looks up a table (:data:`~stc.codegen.tape.LOOKUPS`).


def _clip(v: Vector, x: str, last: str) -> str:
    """x rounded down, between 0 and ``last``; 0 where it is no number."""
    above = v.select("ogt", x, "zeroinitializer", x, "zeroinitializer")
    return v.intrinsic("trunc", v.select("olt", above, last, above, last))


def _reaches(v: Vector, begin: str, x: str) -> str:
    """1 where ``begin`` is not above x, else 0."""
    return v.select("ole", begin, x, v.one(), "zeroinitializer")


def _places(v: Vector, place: str) -> list[str]:
    """Where numbers lie, below 2^31, as a register for each lane."""
    whole = f"<{v.lanes} x i32>"
    numbers = v.let(f"fptosi {v.f} {place} to {whole}")
    found = []
    for k in range(v.lanes):
        lane = v.let(f"extractelement {whole} {numbers}, i64 {k}")
        found.append(v.let(f"getelementptr inbounds double, ptr %uniform, i32 {lane}"))
    return found


def _read(v: Vector, at: Sequence[str], k: int = 0) -> str:
    """The numbers ``k`` places after given ones (:func:`_places`)."""
    result = "poison"
    for lane, pointer in enumerate(at):
        value = v.let(f"load double, ptr {v.pointer(pointer, 8 * k)}, align 8")
        result = v.let(f"insertelement {v.f} {result}, double {value}, i64 {lane}")
    return result


def _read_run(v: Vector, at: Sequence[str], k: int) -> list[str]:
    """The :data:`RUN` numbers from ``k`` places after given ones on, with a load for each lane."""
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
