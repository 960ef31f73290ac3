"""Operations of tapes as instructions: arithmetic in place, elementary functions written out or called.

An elementary function written out is a hundred instructions, a power two hundred.  Where there are many, they
would be most of a kernel, and compiling them (the register allocation above all) most of the time to start.
So they become functions of the module, compiled once and called with vectors in registers; such a call loses
what the caller holds in registers, so :mod:`stc.codegen.residency` moves that to memory first.  The functions'
instructions are the same either way.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from stc.codegen.fusion import Fused
from stc.codegen.lookups import clip, places, reaches, read, read_run
from stc.codegen.runs import RUN
from stc.codegen.tape import CIRCULAR, Tape
from stc.codegen.vector import Vector
from stc.codegen.vector_math import BINARY, UNARY, sine_cosine, sines_cosines
from stc.symbolic.tables import CLIP, REACHES, READ

_ARITHMETIC: Final = {
    "add": "fadd",
    "sub": "fsub",
    "mul": "fmul",
    "div": "fdiv",
}

#: What functions are in code, in hundreds of instructions, where it is not one.
_LENGTH: Final = {"pow": 2}

#: Tapes that together would write out more code for elementary functions than this call them.
WRITTEN_OUT: Final = 64


def function_length(tapes: Sequence[Tape]) -> int:
    """How much code the elementary functions of tapes would be, in hundreds of instructions."""
    total = 0
    for tape in tapes:
        total += len({a for op, a, _ in tape.ops if op in CIRCULAR})
        total += sum(_LENGTH.get(op, 1) for op, _, _ in tape.ops if op in UNARY or op in BINARY)
    return total


class MathFunctions:
    """The elementary functions that the kernels of one module call.

    Args:
        fused: the machine has fused multiply-add instructions.
        called: False writes all of them out.
    """

    def __init__(self, fused: bool, called: bool) -> None:
        self.called = called
        self._fused = fused
        self._texts: dict[str, str] = {}

    def text(self) -> str:
        """Definitions of the functions called so far."""
        return "".join(self._texts.values())

    def circular(self, vector: Vector, wanted: set[str], a: str) -> tuple[str, str]:
        """Sine and cosine as far as they are wanted; tan wants both.  One not wanted may be an empty name."""
        want_sine, want_cosine = wanted != {"cos"}, wanted != {"sin"}
        if not self.called:
            return sine_cosine(vector, a, want_sine, want_cosine)
        if want_sine and want_cosine:
            pair = self._call(vector, "sincos", [a])
            type_ = f"{{ {vector.f}, {vector.f} }}"
            first, second = (vector.let(f"extractvalue {type_} {pair}, {k}") for k in (0, 1))
            return first, second
        single = self._call(vector, "sin" if want_sine else "cos", [a])
        return (single, "") if want_sine else ("", single)

    def value(self, vector: Vector, op: str, *operands: str) -> str:
        """A function of :data:`~stc.codegen.vector_math.UNARY` or :data:`~stc.codegen.vector_math.BINARY`."""
        if self.called:
            return self._call(vector, op, operands)
        return written_out(vector, op, operands)

    def _call(self, vector: Vector, name: str, operands: Sequence[str]) -> str:
        symbol = f"{name}.{vector.suffix}"
        result = f"{{ {vector.f}, {vector.f} }}" if name == "sincos" else vector.f
        if symbol not in self._texts:
            self._texts[symbol] = self._definition(symbol, result, name, vector.lanes, len(operands))
        arguments = ", ".join([f"{vector.f} {operand}" for operand in operands])
        return vector.let(f"call {result} @{symbol}({arguments})")

    def _definition(self, symbol: str, result: str, name: str, lanes: int, arity: int) -> str:
        lines: list[str] = []
        inner = Vector(lines, lanes, self._fused, "t")
        names = [f"%x{k}" for k in range(arity)]
        if name in ("sin", "cos", "sincos"):
            sine, cosine = sine_cosine(inner, names[0], name != "cos", name != "sin")
            if name == "sincos":
                half = inner.let(f"insertvalue {result} poison, {inner.f} {sine}, 0")
                value = inner.let(f"insertvalue {result} {half}, {inner.f} {cosine}, 1")
            else:
                value = sine or cosine
        else:
            value = written_out(inner, name, names)
        parameters = ", ".join([f"{inner.f} {argument}" for argument in names])
        head = f"define internal {result} @{symbol}({parameters}) noinline nounwind {{"
        return "\n".join([head, *lines, f"  ret {result} {value}", "}", ""])


def written_out(vector: Vector, op: str, operands: Sequence[str]) -> str:
    """Any operation but the circular functions, in place."""
    instruction = _ARITHMETIC.get(op)
    if instruction is not None:
        return vector.let(f"{instruction} {vector.f} {operands[0]}, {operands[1]}")
    if op == "neg":
        return vector.neg(operands[0])
    if op == "sqrt":
        return vector.call("sqrt", operands[0])
    return UNARY[op](vector, operands[0]) if op in UNARY else BINARY[op](vector, operands[0], operands[1])


class Operations:
    """Emits a tape's operations through a :class:`Vector`, pairing sines and cosines of one argument."""

    def __init__(self, tape: Tape, vector: Vector, functions: MathFunctions) -> None:
        self.vector = vector
        self._functions = functions
        wanted: dict[int, set[str]] = {}
        for op, a, _ in tape.ops:
            if op in CIRCULAR:
                wanted.setdefault(a, set()).add(op)
        self._wanted = wanted
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
        if not self._functions.called:
            return False
        return op in UNARY or op in BINARY or (op in CIRCULAR and slot not in self._circular)

    def emit(self, op: str, slot: int, a: str, b: str, other: int = -1) -> str:
        """Result of one operation; ``slot`` identifies the first operand, ``other`` the second one."""
        vector = self.vector
        if op == READ:
            return self.read(slot, a, other)[other]
        if op == CLIP:
            return clip(vector, a, b)
        if op == REACHES:
            return reaches(vector, a, b)
        if op in CIRCULAR:
            pair = self.circular(slot, a)
            return vector.div(*pair) if op == "tan" else pair[op == "cos"]
        operands = (a, b) if b else (a,)
        if op in UNARY or op in BINARY:
            return self._functions.value(vector, op, *operands)
        return written_out(vector, op, operands)

    def emit_fused(self, fused: Fused, first: str, second: str, other: str) -> str:
        """A sum together with the product that it takes in."""
        vector = self.vector
        if fused.negates_product:
            first = vector.neg(first)
        return vector.exact_fma(first, second, vector.neg(other) if fused.negates_other else other)

    def circular_together(self, slots: Sequence[int], angles: Sequence[str]) -> None:
        """Compute sines and cosines of some slots step by step, for ``circular`` to return."""
        each = []
        for slot, a in zip(slots, angles, strict=True):
            wanted = self._wanted[slot]
            each.append((a, wanted != {"cos"}, wanted != {"sin"}))
        self._circular.update(zip(slots, sines_cosines(self.vector, each), strict=True))

    def read(self, slot: int, place: str, number: int) -> dict[int, str]:
        """The number so many places after each lane's, and what is wanted of the three after it: by their literals."""
        at = self._places.get(slot)
        if at is None:
            at = self._places[slot] = places(self.vector, place)
        for first, together in self._runs[slot]:
            if number in together:
                if self.vector.lanes == 1 or len(together) == 1:
                    return {number: read(self.vector, at, self._literals[number])}
                found = read_run(self.vector, at, first)
                return {each: found[self._literals[each] - first] for each in together}
        raise KeyError(number)

    def circular(self, slot: int, a: str) -> tuple[str, str]:
        """Sine and cosine of a slot, as far as the tape wants them, computed at the first call."""
        pair = self._circular.get(slot)
        if pair is None:
            pair = self._functions.circular(self.vector, self._wanted[slot], a)
            self._circular[slot] = pair
        return pair
