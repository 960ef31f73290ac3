"""Blocks of instructions of one compiled function: the ground that expressions and statements stand on.

Locals live in stack slots, which LLVM turns into registers; so no phi nodes are needed.
"""

from __future__ import annotations

import ast
from typing import NamedTuple

from stc.codegen.native_types import NativeError, Type
from stc.codegen.vector import hexadecimal


class Value(NamedTuple):
    """A typed operand."""

    type: Type
    text: str


class BlockBuilder:
    """Appends instructions, keeps track of blocks, names registers."""

    def __init__(self, filename: str) -> None:
        self.filename = filename
        self.lines: list[str] = []
        self.entry: list[str] = []
        self.terminated = False
        self.targets: set[str] = set()  # blocks that something jumps to
        self._registers = 0
        self._labels = 0

    def error(self, node: ast.AST, message: str) -> NativeError:
        """The refusal of a piece of source, to be raised."""
        return NativeError(f"{self.filename}:{getattr(node, 'lineno', 0)}: {message}")

    def register(self) -> str:
        """A fresh register name."""
        self._registers += 1
        return f"%r{self._registers}"

    def label(self, hint: str) -> str:
        """A fresh block name."""
        self._labels += 1
        return f"{hint}{self._labels}"

    def emit(self, instruction: str) -> None:
        """Append an instruction; what follows a terminator in the source is unreachable and dropped."""
        if not self.terminated:
            self.lines.append("  " + instruction)

    def compute(self, type_: Type, instruction: str) -> Value:
        """Append an instruction with a result."""
        name = self.register()
        self.emit(f"{name} = {instruction}")
        return Value(type_, name)

    def branch(self, target: str, hint: str = "") -> None:
        """End the block with a jump, with metadata for it."""
        if not self.terminated:
            self.targets.add(target)
        self.emit(f"br label %{target}{hint}")
        self.terminated = True

    def branch_if(self, condition: Value, yes: str, no: str) -> None:
        """End the block with a two-way jump."""
        self.emit(f"br i1 {condition.text}, label %{yes}, label %{no}")
        self.terminated = True

    def begin(self, label: str) -> None:
        """Start a block; control falls into it from the block before, if that is still open."""
        if not self.terminated:
            self.branch(label)
        self.lines.append(f"{label}:")
        self.terminated = False

    def slot(self, type_: Type, initial: str | None = None) -> str:
        """A stack slot for a local, made in the entry block."""
        name = f"%s{len(self.entry)}"
        self.entry.append(f"  {name} = alloca {type_.ir}")
        zero = {Type.F64: "0.0", Type.I64: "0", Type.BOOL: "false"}.get(type_, "null")
        if type_.lanes:
            zero = "zeroinitializer"
        self.entry.append(f"  store {type_.ir} {initial or zero}, ptr {name}")
        return name

    def convert(self, value: Value, type_: Type, node: ast.AST, what: str = "value") -> Value:
        """Implicit conversion: bool to integer to float, nothing else."""
        if value.type is type_:
            return value
        if value.type is Type.BOOL and type_ is Type.I64:
            return self.compute(Type.I64, f"zext i1 {value.text} to i64")
        if value.type is Type.BOOL and type_ is Type.F64:
            return self.compute(Type.F64, f"uitofp i1 {value.text} to double")
        if value.type is Type.I64 and type_ is Type.F64:
            if value.text.lstrip("-").isdigit():
                return Value(Type.F64, hexadecimal(float(value.text)))
            return self.compute(Type.F64, f"sitofp i64 {value.text} to double")
        if type_.lanes and value.type in (Type.F64, Type.I64, Type.BOOL):
            number = self.convert(value, Type.F64, node)
            first = self.compute(type_, f"insertelement {type_.ir} poison, double {number.text}, i64 0")
            same = f"<{type_.lanes} x i32> zeroinitializer"
            return self.compute(type_, f"shufflevector {type_.ir} {first.text}, {type_.ir} poison, {same}")
        raise self.error(node, f"{what} is {value.type.value} where {type_.value} is needed")
