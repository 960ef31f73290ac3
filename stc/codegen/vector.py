"""Instructions on vectors of lanes, or on scalars, as LLVM text.

A :class:`Vector` appends to a list of lines and hands out register names; it knows nothing of what is
computed.  Operands are strings: a register, or a literal made by :meth:`Vector.real` or :meth:`Vector.whole`.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from itertools import count
from typing import Final

_INTRINSICS: Final = ("sqrt", "fabs", "rint", "trunc", "fma", "copysign")
_OPERANDS: Final = {"fma": 3, "copysign": 2}

_SIGN_BIT: Final = -(2**63)


def hexadecimal(value: float) -> str:
    """LLVM's exact spelling of a double (minus zero and nan included)."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


#: Stands for how many doubles registers hold, until it is known what machine code is made for.
WIDTH = "{WIDTH}"

#: How LLVM knows what ``prefetch`` calls.
PREFETCH = "declare void @llvm.prefetch.p0(ptr, i32 immarg, i32 immarg, i32 immarg)"


def prefetch(address: str) -> str:
    """The instruction that asks for the memory at an address, which may lie anywhere."""
    return f"call void @llvm.prefetch.p0(ptr {address}, i32 0, i32 3, i32 1)"


class Vector:
    """Emits instructions on ``<lanes x double>``, or on ``double`` for one lane.

    ``fused`` tells whether the machine has fused multiply-add instructions.
    """

    def __init__(self, lines: list[str], lanes: int, fused: bool, prefix: str) -> None:
        self.lines = lines
        self.lanes = lanes
        self.fused = fused
        self.f = "double" if lanes == 1 else f"<{lanes} x double>"
        self.i = "i64" if lanes == 1 else f"<{lanes} x i64>"
        self.b = "i1" if lanes == 1 else f"<{lanes} x i1>"
        self.suffix = "f64" if lanes == 1 else f"v{lanes}f64"
        self._prefix = prefix
        self._numbers = count()
        self._literals: dict[float | str, str] = {}

    def declarations(self) -> str:
        """Declarations of the intrinsics used."""
        return "".join(
            f"declare {self.f} @llvm.{name}.{self.suffix}({', '.join([self.f] * _OPERANDS.get(name, 1))})\n"
            for name in _INTRINSICS
        )

    def name(self) -> str:
        """A fresh register."""
        return f"%{self._prefix}{next(self._numbers)}"

    def let(self, instruction: str) -> str:
        """Append an instruction; returns the register of its result."""
        name = f"%{self._prefix}{next(self._numbers)}"
        self.lines.append(f"  {name} = {instruction}")
        return name

    # ---- literals -----------------------------------------------------------------------------------

    def _splat(self, scalar: str, text: str) -> str:
        return text if self.lanes == 1 else "<" + ", ".join([f"{scalar} {text}"] * self.lanes) + ">"

    def real(self, value: float) -> str:
        """A floating-point literal in every lane."""
        key = hexadecimal(value)
        found = self._literals.get(key)
        if found is None:
            found = self._literals[key] = self._splat("double", key)
        return found

    def whole(self, value: int) -> str:
        """A 64-bit integer literal in every lane."""
        return self._splat("i64", str(value))

    # ---- arithmetic ---------------------------------------------------------------------------------

    def add(self, a: str, b: str) -> str:
        return self.let(f"fadd {self.f} {a}, {b}")

    def sub(self, a: str, b: str) -> str:
        return self.let(f"fsub {self.f} {a}, {b}")

    def mul(self, a: str, b: str) -> str:
        return self.let(f"fmul {self.f} {a}, {b}")

    def div(self, a: str, b: str) -> str:
        return self.let(f"fdiv {self.f} {a}, {b}")

    def neg(self, a: str) -> str:
        return self.let(f"fneg {self.f} {a}")

    def call(self, intrinsic: str, *operands: str) -> str:
        """One of the intrinsics sqrt, fabs, rint (to even), trunc, fma, copysign."""
        arguments = ", ".join([f"{self.f} {operand}" for operand in operands])
        return self.let(f"call {self.f} @llvm.{intrinsic}.{self.suffix}({arguments})")

    def exact_fma(self, a: str, b: str, c: str) -> str:
        """``a*b + c`` with one rounding, on any machine (slowly where hardware lacks it)."""
        return self.call("fma", a, b, c)

    def fma(self, a: str, b: str, c: str) -> str:
        """``a*b + c`` with one rounding or two, whichever is fast."""
        return self.call("fma", a, b, c) if self.fused else self.add(self.mul(a, b), c)

    def polynomial(self, x: str, coefficients: tuple[float, ...]) -> str:
        """Horner's rule; coefficients from the constant term up."""
        return self.polynomials([x], coefficients)[0]

    def polynomials(self, xs: Sequence[str], coefficients: tuple[float, ...]) -> list[str]:
        """The same for some arguments, step by step."""
        results = [self.real(coefficients[-1])] * len(xs)
        for coefficient in reversed(coefficients[:-1]):
            results = [self.fma(each, x, self.real(coefficient)) for each, x in zip(results, xs, strict=True)]
        return results

    # ---- selection and bits -------------------------------------------------------------------------

    def compare(self, relation: str, a: str, b: str) -> str:
        """LLVM's ``fcmp``: olt, ole, ogt, oge, oeq are false and uno, une, ugt are true for nan."""
        return self.let(f"fcmp {relation} {self.f} {a}, {b}")

    def compare_whole(self, relation: str, a: str, b: str) -> str:
        """LLVM's ``icmp``: eq, ne, slt..."""
        return self.let(f"icmp {relation} {self.i} {a}, {b}")

    def both(self, a: str, b: str) -> str:
        return self.let(f"and {self.b} {a}, {b}")

    def either(self, a: str, b: str) -> str:
        return self.let(f"or {self.b} {a}, {b}")

    def select(self, condition: str, yes: str, no: str) -> str:
        return self.let(f"select {self.b} {condition}, {self.f} {yes}, {self.f} {no}")

    def bits(self, a: str) -> str:
        """The representation of a double as an integer."""
        return self.let(f"bitcast {self.f} {a} to {self.i}")

    def from_bits(self, a: str) -> str:
        """The double with this representation."""
        return self.let(f"bitcast {self.i} {a} to {self.f}")

    def integer(self, operation: str, a: str, b: str) -> str:
        """Integer operation of LLVM: add, sub, and, or, xor, shl, lshr, ashr."""
        return self.let(f"{operation} {self.i} {a}, {b}")

    def flip_sign(self, a: str, sign: str) -> str:
        """``a`` with its sign flipped where the integer ``sign`` has its top bit set (other bits clear)."""
        return self.from_bits(self.integer("xor", self.bits(a), sign))

    def sign_bit(self, a: str) -> str:
        """The sign of a double, as the top bit of an integer."""
        return self.integer("and", self.bits(a), self.whole(_SIGN_BIT))
