"""Instructions on vectors, as LLVM text.

A :class:`Vector` appends to a list of lines and hands out register names; it knows nothing of what is computed.
No instruction refers to a constant in memory of its own, so that machine code runs wherever it is copied to: numbers
come from the literals of the tape, where 1 and -0 follow the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from typing import Final

from stc.codegen.engine import function_numbers

_INTRINSICS: Final = ("sqrt", "trunc")


class Vector:
    """Emits instructions on ``<lanes x double>``.

    Args:
        lines: receives them.
        lanes: doubles per vector.
        n_literals: of the tape.
        prefix: of registers.
    """

    def __init__(self, lines: list[str], lanes: int, n_literals: int, prefix: str) -> None:
        self.lines = lines
        self.lanes = lanes
        self.size = 8 * lanes
        self.f = f"<{lanes} x double>"
        self._n_literals = n_literals
        self._prefix = prefix
        self._numbers = count()

    def let(self, instruction: str) -> str:
        """Append an instruction; returns the register of its result."""
        name = f"%{self._prefix}{next(self._numbers)}"
        self.lines.append(f"  {name} = {instruction}")
        return name

    def pointer(self, base: str, offset: int | str) -> str:
        """An address some bytes after another one."""
        return self.let(f"getelementptr inbounds i8, ptr {base}, i64 {offset}")

    def load(self, base: str, place: int) -> str:
        """The vector at a place of a list of vectors."""
        return self.let(f"load {self.f}, ptr {self.pointer(base, self.size * place)}, align {self.size}")

    def store(self, value: str, base: str, place: int) -> None:
        """Write a vector to a place of a list of vectors."""
        pointer = self.pointer(base, self.size * place)
        self.lines.append(f"  store {self.f} {value}, ptr {pointer}, align {self.size}")

    def spread(self, base: str, place: int) -> str:
        """The number at a place of a list of numbers, in all lanes."""
        one = self.let(f"load double, ptr {self.pointer(base, 8 * place)}, align 8")
        first = self.let(f"insertelement {self.f} poison, double {one}, i64 0")
        return self.shuffled(self.f, first, "poison", [0] * self.lanes)

    def shuffled(self, type_: str, a: str, b: str, chosen: Sequence[int]) -> str:
        """Lanes of two vectors, by number."""
        mask = ", ".join([f"i32 {k}" for k in chosen])
        return self.let(f"shufflevector {type_} {a}, {type_} {b}, <{len(chosen)} x i32> <{mask}>")

    def arithmetic(self, instruction: str, a: str, b: str) -> str:
        """``fadd``, ``fsub``, ``fmul`` or ``fdiv``."""
        return self.let(f"{instruction} {self.f} {a}, {b}")

    def intrinsic(self, name: str, operand: str) -> str:
        """``sqrt`` or ``trunc``."""
        return self.let(f"call {self.f} @llvm.{name}.v{self.lanes}f64({self.f} {operand})")

    def neg(self, a: str) -> str:
        """The negative; 0 becomes -0."""
        return self.arithmetic("fsub", self.spread("%literals", self._n_literals + 1), a)

    def one(self) -> str:
        """A vector with 1 in all lanes."""
        return self.spread("%literals", self._n_literals)

    def select(self, relation: str, a: str, b: str, yes: str, no: str) -> str:
        """By LLVM's ``fcmp``: olt, ole, ogt are false for nan."""
        condition = self.let(f"fcmp {relation} {self.f} {a}, {b}")
        return self.let(f"select <{self.lanes} x i1> {condition}, {self.f} {yes}, {self.f} {no}")

    def called(self, name: str, operands: Sequence[str], results: int) -> list[str]:
        """What a function of the core (``tape_functions`` of ``stc/core/calls.h``) finds for a vector or two."""
        for place, operand in enumerate(operands):
            self.store(operand, "%from", place)
        self.call(name, f"ptr %from, ptr %to, i64 {self.lanes}")
        return [self.load("%to", place) for place in range(results)]

    def call(self, name: str, arguments: str) -> None:
        """Call one of the functions whose addresses the kernel is given."""
        function = self.let(
            f"load ptr, ptr {self.pointer('%functions', 8 * function_numbers()[name])}, align 8"
        )
        self.lines.append(f"  call void {function}({arguments})")

    def declarations(self) -> str:
        """The declarations of the intrinsic functions that kernels use, as lines of LLVM."""
        return "".join(f"declare {self.f} @llvm.{name}.v{self.lanes}f64({self.f})\n" for name in _INTRINSICS)
