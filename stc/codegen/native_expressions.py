"""Expressions of the compiled subset of Python, all but calls (:mod:`stc.codegen.native_calls`), as LLVM instructions.

Values are ``(type, text)`` pairs: the text names a register or spells a literal.
"""

from __future__ import annotations

import ast
from collections.abc import Callable
from typing import Any

from stc.codegen.native_blocks import BlockBuilder, Value
from stc.codegen.native_types import Type
from stc.codegen.vector import hexadecimal

_COMPARE = {
    ast.Lt: ("olt", "slt"),
    ast.LtE: ("ole", "sle"),
    ast.Gt: ("ogt", "sgt"),
    ast.GtE: ("oge", "sge"),
    ast.Eq: ("oeq", "eq"),
    ast.NotEq: ("une", "ne"),
}
_ARITHMETIC = {ast.Add: "add", ast.Sub: "sub", ast.Mult: "mul"}
_BITWISE = {ast.BitAnd: "and", ast.BitOr: "or", ast.BitXor: "xor"}


class ExpressionEmitter(BlockBuilder):
    """Emits the instructions of one function's expressions."""

    def __init__(self, filename: str, flags: str, resolve: Callable[[str], Any]) -> None:
        super().__init__(filename)
        self.resolve = resolve
        self.flags = flags
        self.locals: dict[str, tuple[Type, str]] = {}
        self.assigned_names: frozenset[str] = frozenset()

    def number(self, node: ast.expr) -> Value:
        """A scalar."""
        value = self.expression(node)
        if value.type.is_array or value.type is Type.NONE:
            raise self.error(node, f"a number is needed, not {value.type.value}")
        return value

    def integer(self, node: ast.expr, what: str) -> Value:
        """An integer scalar."""
        return self.convert(self.number(node), Type.I64, node, what)

    def common(self, left: Value, right: Value, node: ast.AST) -> tuple[Value, Value, Type]:
        """Bring two scalars to one arithmetic type."""
        type_ = Type.F64 if Type.F64 in (left.type, right.type) else Type.I64
        return self.convert(left, type_, node), self.convert(right, type_, node), type_

    def condition(self, node: ast.expr) -> Value:
        """Truth of an expression, as in ``if``."""
        value = self.number(node)
        if value.type is Type.BOOL:
            return value
        if value.type is Type.I64:
            return self.compute(Type.BOOL, f"icmp ne i64 {value.text}, 0")
        value = self.convert(value, Type.F64, node, "condition")
        return self.compute(Type.BOOL, f"fcmp une double {value.text}, 0.0")

    # ---- expressions --------------------------------------------------------------------------------

    def expression(self, node: ast.expr) -> Value:
        """Emit any expression."""
        method = getattr(self, "_" + type(node).__name__.lower(), None)
        if method is None:
            raise self.error(
                node, f"{type(node).__name__} expressions cannot be compiled: {ast.unparse(node)}"
            )
        value: Value = method(node)
        return value

    def literal(self, value: Any, node: ast.AST) -> Value:
        """A Python number as an operand."""
        if isinstance(value, bool):
            return Value(Type.BOOL, "true" if value else "false")
        if isinstance(value, int):
            if not -(2**63) <= value < 2**63:
                raise self.error(node, f"integer {value} does not fit 64 bits")
            return Value(Type.I64, str(value))
        if isinstance(value, float):
            return Value(Type.F64, hexadecimal(value))
        raise self.error(node, f"{value!r} is not a number")

    def _constant(self, node: ast.Constant) -> Value:
        return self.literal(node.value, node)

    def _name(self, node: ast.Name) -> Value:
        if node.id in self.locals:
            type_, slot = self.locals[node.id]
            return self.compute(type_, f"load {type_.ir}, ptr {slot}")
        if node.id in self.assigned_names:
            raise self.error(node, f"{node.id} is read before anything is assigned to it")
        return self._constant_object(node)

    def _attribute(self, node: ast.Attribute) -> Value:
        return self._constant_object(node)

    def lookup(self, node: ast.expr) -> Any:
        """The Python object that a dotted name means outside the function; None when there is none."""
        if isinstance(node, ast.Name):
            if node.id in self.locals:
                return None
            return self.resolve(node.id)
        if isinstance(node, ast.Attribute):
            return getattr(self.lookup(node.value), node.attr, None)
        return None

    def _constant_object(self, node: ast.expr) -> Value:
        found = self.lookup(node)
        if isinstance(found, (bool, int, float)):
            return self.literal(found, node)
        what = "is not defined" if found is None else "is not a number"
        raise self.error(
            node, f"{ast.unparse(node)} {what} (only module-level numeric constants can be used)"
        )

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return self.compute(Type.BOOL, f"xor i1 {self.condition(node.operand).text}, true")
        value = self.number(node.operand)
        if value.type is Type.BOOL:
            value = self.convert(value, Type.I64, node)
        if isinstance(node.op, ast.UAdd):
            return value
        if not isinstance(node.op, ast.USub):
            raise self.error(node, f"operator cannot be compiled: {ast.unparse(node)}")
        if value.type is Type.F64:
            if value.text.startswith("0x"):
                bits = int(value.text, 16) ^ (1 << 63)
                return Value(Type.F64, f"0x{bits:016X}")
            return self.compute(Type.F64, f"fneg{self.flags} double {value.text}")
        if value.type.lanes:
            return self.compute(value.type, f"fneg{self.flags} {value.type.ir} {value.text}")
        if value.text.lstrip("-").isdigit():
            return Value(Type.I64, str(-int(value.text)))
        return self.compute(Type.I64, f"sub nsw i64 0, {value.text}")

    def _binop(self, node: ast.BinOp) -> Value:
        if isinstance(node.op, ast.Pow):
            return self._power(node)
        return self.binary(node.op, self.number(node.left), self.number(node.right), node)

    def binary(self, op: ast.operator, left: Value, right: Value, node: ast.AST) -> Value:
        """``left op right`` on scalars."""
        vector = left.type if left.type.lanes else right.type
        if isinstance(op, ast.Div) and not vector.lanes:
            left, right = self.convert(left, Type.F64, node), self.convert(right, Type.F64, node)
            return self.compute(Type.F64, f"fdiv{self.flags} double {left.text}, {right.text}")
        name = _ARITHMETIC.get(type(op))
        if isinstance(op, ast.Div):
            name = "div"
        if name is not None and vector.lanes:
            left, right = self.convert(left, vector, node), self.convert(right, vector, node)
            return self.compute(vector, f"f{name}{self.flags} {vector.ir} {left.text}, {right.text}")
        left, right, type_ = self.common(left, right, node)
        if name is not None:
            if type_ is Type.F64:
                return self.compute(type_, f"f{name}{self.flags} double {left.text}, {right.text}")
            return self.compute(type_, f"{name} nsw i64 {left.text}, {right.text}")
        if type_ is Type.I64:
            if isinstance(op, ast.FloorDiv):
                return self._floor_divide(left, right)
            if isinstance(op, ast.Mod):
                return self._modulo(left, right)
            if type(op) in _BITWISE:
                return self.compute(type_, f"{_BITWISE[type(op)]} i64 {left.text}, {right.text}")
        symbol = type(op).__name__
        raise self.error(node, f"operator {symbol} cannot be compiled for {type_.value} operands")

    def _power_of_two(self, value: Value) -> int | None:
        if value.text.isdigit() and int(value.text) > 0 and int(value.text).bit_count() == 1:
            return int(value.text).bit_length() - 1
        return None

    def _floor_divide(self, left: Value, right: Value) -> Value:
        shift = self._power_of_two(right)
        if shift is not None:
            return self.compute(Type.I64, f"ashr i64 {left.text}, {shift}")
        quotient = self.compute(Type.I64, f"sdiv i64 {left.text}, {right.text}")
        wrong = self._signs_differ(left, right)
        return self.compute(
            Type.I64, f"sub i64 {quotient.text}, {self.convert(wrong, Type.I64, ast.Pass()).text}"
        )

    def _modulo(self, left: Value, right: Value) -> Value:
        if self._power_of_two(right) is not None:
            return self.compute(Type.I64, f"and i64 {left.text}, {int(right.text) - 1}")
        remainder = self.compute(Type.I64, f"srem i64 {left.text}, {right.text}")
        wrong = self._signs_differ(left, right)
        shift = self.compute(Type.I64, f"select i1 {wrong.text}, i64 {right.text}, i64 0")
        return self.compute(Type.I64, f"add i64 {remainder.text}, {shift.text}")

    def _signs_differ(self, left: Value, right: Value) -> Value:
        """Whether division left a remainder whose sign is not the divisor's: Python rounds down there."""
        remainder = self.compute(Type.I64, f"srem i64 {left.text}, {right.text}")
        nonzero = self.compute(Type.BOOL, f"icmp ne i64 {remainder.text}, 0")
        mixed = self.compute(Type.I64, f"xor i64 {remainder.text}, {right.text}")
        negative = self.compute(Type.BOOL, f"icmp slt i64 {mixed.text}, 0")
        return self.compute(Type.BOOL, f"and i1 {nonzero.text}, {negative.text}")

    def _power(self, node: ast.BinOp) -> Value:
        base, exponent = self.number(node.left), self.number(node.right)
        if exponent.type is not Type.I64 or not exponent.text.lstrip("-").isdigit():
            raise self.error(node, "the exponent must be a constant whole number")
        n = int(exponent.text)
        if base.type is Type.BOOL or (n < 0 and base.type is Type.I64):
            base = self.convert(base, Type.F64 if n < 0 else Type.I64, node)
        square = base
        result: Value | None = None
        remaining = abs(n)
        while remaining:
            if remaining & 1:
                result = square if result is None else self.binary(ast.Mult(), result, square, node)
            remaining >>= 1
            if remaining:
                square = self.binary(ast.Mult(), square, square, node)
        if result is None:
            return self.convert(Value(Type.I64, "1"), base.type, node)
        if n < 0:
            return self.binary(ast.Div(), Value(Type.F64, hexadecimal(1.0)), result, node)
        return result

    def _compare(self, node: ast.Compare) -> Value:
        left = self.number(node.left)
        if len(node.ops) == 1:
            return self._compare_one(node.ops[0], left, self.number(node.comparators[0]), node)
        # a < b < c: as in Python, b once, and c only if a < b
        slot, end = self.slot(Type.BOOL), self.label("chained")
        for position, (op, comparator) in enumerate(zip(node.ops, node.comparators, strict=True)):
            right = self.number(comparator)
            result = self._compare_one(op, left, right, node)
            self.emit(f"store i1 {result.text}, ptr {slot}")
            if position < len(node.ops) - 1:
                more = self.label("chain")
                self.branch_if(result, more, end)
                self.begin(more)
            left = right
        self.begin(end)
        return self.compute(Type.BOOL, f"load i1, ptr {slot}")

    def _compare_one(self, op: ast.cmpop, left: Value, right: Value, node: ast.AST) -> Value:
        if type(op) not in _COMPARE:
            raise self.error(node, f"comparison {type(op).__name__} cannot be compiled")
        left, right, type_ = self.common(left, right, node)
        real, whole = _COMPARE[type(op)]
        if type_ is Type.F64:
            return self.compute(Type.BOOL, f"fcmp {real} double {left.text}, {right.text}")
        return self.compute(Type.BOOL, f"icmp {whole} i64 {left.text}, {right.text}")

    def _boolop(self, node: ast.BoolOp) -> Value:
        slot, end = self.slot(Type.BOOL), self.label("decided")
        for position, operand in enumerate(node.values):
            value = self.number(operand)
            if value.type is not Type.BOOL:
                raise self.error(operand, "operands of and/or must be conditions; write a comparison")
            self.emit(f"store i1 {value.text}, ptr {slot}")
            if position < len(node.values) - 1:
                more = self.label("operand")
                if isinstance(node.op, ast.And):
                    self.branch_if(value, more, end)
                else:
                    self.branch_if(value, end, more)
                self.begin(more)
        self.begin(end)
        return self.compute(Type.BOOL, f"load i1, ptr {slot}")

    def _ifexp(self, node: ast.IfExp) -> Value:
        yes, no, end = self.label("then"), self.label("otherwise"), self.label("chosen")
        self.branch_if(self.condition(node.test), yes, no)
        self.begin(yes)
        first = self.number(node.body)
        # The result's type is known only after both sides: finish the first block then.
        resume = len(self.lines)
        self.terminated = True
        self.begin(no)
        second = self.number(node.orelse)
        type_ = first.type if first.type is second.type else None
        if type_ is None:
            type_ = Type.F64 if Type.F64 in (first.type, second.type) else Type.I64
        slot = self.slot(type_)
        second = self.convert(second, type_, node)
        self.emit(f"store {type_.ir} {second.text}, ptr {slot}")
        self.branch(end)
        tail = self.lines[resume:]
        del self.lines[resume:]
        self.terminated = False
        first = self.convert(first, type_, node)
        self.emit(f"store {type_.ir} {first.text}, ptr {slot}")
        self.branch(end)
        self.lines.extend(tail)
        self.begin(end)
        return self.compute(type_, f"load {type_.ir}, ptr {slot}")

    # ---- arrays -------------------------------------------------------------------------------------

    def element_address(self, node: ast.Subscript) -> tuple[Type, str]:
        """Type of the array and address of one element."""
        array = self.expression(node.value)
        if not array.type.is_array:
            raise self.error(node, f"{ast.unparse(node.value)} is not an array")
        index = self.integer(node.slice, "index")
        if index.text.startswith("-"):
            raise self.error(node, "negative indices cannot be compiled: lengths are not known")
        pointer = self.compute(
            array.type, f"getelementptr inbounds {array.type.element_ir}, ptr {array.text}, i64 {index.text}"
        )
        return array.type, pointer.text

    def load_element(self, type_: Type, address: str) -> Value:
        """Read an element."""
        if type_ is Type.I32S:
            narrow = self.compute(Type.I64, f"load i32, ptr {address}, align 4")
            return self.compute(Type.I64, f"sext i32 {narrow.text} to i64")
        return self.compute(type_.element, f"load {type_.element_ir}, ptr {address}, align 8")

    def _subscript(self, node: ast.Subscript) -> Value:
        if not isinstance(node.slice, ast.Slice):
            return self.load_element(*self.element_address(node))
        array = self.expression(node.value)
        if not array.type.is_array:
            raise self.error(node, f"{ast.unparse(node.value)} is not an array")
        if node.slice.step is not None:
            raise self.error(node, "views with a step cannot be compiled")
        if node.slice.lower is None:
            return array
        offset = self.integer(node.slice.lower, "offset")
        return self.compute(
            array.type, f"getelementptr inbounds {array.type.element_ir}, ptr {array.text}, i64 {offset.text}"
        )
