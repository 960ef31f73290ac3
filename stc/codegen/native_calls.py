"""Calls in the compiled subset of Python, as LLVM instructions: of what is compiled as well, and of known functions."""

from __future__ import annotations

import ast
import builtins
import math
from collections.abc import Callable
from typing import Any, NamedTuple

from stc.codegen import calls, native_math, native_vector
from stc.codegen.native_blocks import Value
from stc.codegen.native_expressions import ExpressionEmitter
from stc.codegen.native_types import Signature, Type
from stc.codegen.native_vector_ir import vector_call
from stc.codegen.vector import PREFETCH, hexadecimal


class Callee(NamedTuple):
    """Another compiled function."""

    symbol: str
    signature: Signature


#: Function object -> LLVM intrinsic or C library function of one float.
_UNARY_FLOAT: dict[Any, str] = {
    native_math.sqrt: "llvm.sqrt.f64",
    math.sqrt: "llvm.sqrt.f64",
    native_math.fabs: "llvm.fabs.f64",
    math.fabs: "llvm.fabs.f64",
    native_math.floor: "llvm.floor.f64",
    native_math.ceil: "llvm.ceil.f64",
    native_math.exp: "exp",
    native_math.log: "log",
}

_VECTOR = tuple(getattr(native_vector, name) for name in native_vector.__all__)

DECLARATIONS = (
    """\
declare double @llvm.sqrt.f64(double)
declare double @llvm.fabs.f64(double)
declare double @llvm.maximum.f64(double, double)
declare double @llvm.minimum.f64(double, double)
declare double @llvm.floor.f64(double)
declare double @llvm.ceil.f64(double)
declare double @llvm.copysign.f64(double, double)
declare i64 @llvm.abs.i64(i64, i1)
declare i64 @llvm.ctpop.i64(i64)
declare <4 x double> @llvm.fabs.v4f64(<4 x double>)
declare <8 x double> @llvm.fabs.v8f64(<8 x double>)
declare <4 x double> @llvm.arithmetic.fence.v4f64(<4 x double>)
declare <8 x double> @llvm.arithmetic.fence.v8f64(<8 x double>)
"""
    + PREFETCH
    + """
declare <8 x double> @llvm.masked.load.v8f64.p0(ptr, i32 immarg, <8 x i1>, <8 x double>)
declare double @llvm.vector.reduce.fmax.v8f64(<8 x double>)
declare double @llvm.vector.reduce.fadd.v8f64(double, <8 x double>)
declare double @exp(double) nounwind willreturn memory(none)
declare double @log(double) nounwind willreturn memory(none)
"""
)


class CallEmitter(ExpressionEmitter):
    """Emits the instructions of one function's expressions, calls among them."""

    def __init__(
        self,
        filename: str,
        flags: str,
        resolve: Callable[[str], Any],
        callee_of: Callable[[Any], Callee | None],
    ) -> None:
        super().__init__(filename, flags, resolve)
        self.callee_of = callee_of

    def _call(self, node: ast.Call) -> Value:
        if node.keywords or any(isinstance(argument, ast.Starred) for argument in node.args):
            raise self.error(node, "only plain positional arguments can be compiled")
        target = self.lookup(node.func)
        callee = self.callee_of(target)
        if callee is not None:
            return self._call_native(node, callee)
        name = ast.unparse(node.func)
        if target in _UNARY_FLOAT:
            (value,) = self.arguments(node, 1, name, Type.F64)
            return self.compute(
                Type.F64, f"call{self.flags} double @{_UNARY_FLOAT[target]}(double {value.text})"
            )
        if target is native_math.isnan:
            (value,) = self.arguments(node, 1, name, Type.F64)
            return self.compute(Type.BOOL, f"fcmp uno double {value.text}, 0.0")
        if target in (native_math.isfinite, math.isfinite):
            (value,) = self.arguments(node, 1, name, Type.F64)
            size = self.compute(Type.F64, f"call double @llvm.fabs.f64(double {value.text})")
            return self.compute(Type.BOOL, f"fcmp olt double {size.text}, {hexadecimal(math.inf)}")
        if target in (native_math.copysign, math.copysign):
            x, y = self.arguments(node, 2, name, Type.F64)
            return self.compute(Type.F64, f"call double @llvm.copysign.f64(double {x.text}, double {y.text})")
        if target is native_math.count_bits:
            (value,) = self.arguments(node, 1, name, Type.I64)
            return self.compute(Type.I64, f"call i64 @llvm.ctpop.i64(i64 {value.text})")
        if target is calls.invoke:
            return self._invoke(node, name)
        if target in _VECTOR:
            return vector_call(self, node, target, name)
        if target in (builtins.min, builtins.max):
            return self._extremum(node, "lt" if target is builtins.min else "gt")
        if target in (builtins.abs, builtins.float, builtins.int):
            return self._builtin(node, target)
        what = "is not defined" if target is None else "is not compiled itself"
        raise self.error(node, f"{name}() cannot be called from compiled code: it {what}")

    def arguments(self, node: ast.Call, count: int, name: str, type_: Type | None = None) -> list[Value]:
        """The arguments of a call, so many, converted to a type."""
        if len(node.args) != count:
            raise self.error(
                node, f"{name}() takes {count} argument{'s' * (count > 1)}, not {len(node.args)}"
            )
        values = [self.number(argument) for argument in node.args]
        return values if type_ is None else [self.convert(value, type_, node, "argument") for value in values]

    def _invoke(self, node: ast.Call, name: str) -> Value:
        """A prepared call of a table: its entry and the address of its cells stand side by side."""
        if len(node.args) != 2:
            raise self.error(node, f"{name}() takes a table and a place")
        table = self.expression(node.args[0])
        if table.type is not Type.I64S:
            raise self.error(node, f"{name}() takes the cells of a table of calls, not {table.type.value}")
        place = self.integer(node.args[1], "place")
        first = self.compute(Type.I64, f"shl i64 {place.text}, 1")
        second = self.compute(Type.I64, f"or i64 {first.text}, 1")
        loaded = []
        for at in (first, second):
            cell = self.compute(Type.I64S, f"getelementptr inbounds i64, ptr {table.text}, i64 {at.text}")
            loaded.append(self.compute(Type.I64S, f"load ptr, ptr {cell.text}, align 8"))
        return self.compute(Type.I64, f"call i64 {loaded[0].text}(ptr {loaded[1].text})")

    def _builtin(self, node: ast.Call, target: Any) -> Value:
        (value,) = self.arguments(node, 1, target.__name__)
        if target is builtins.float:
            return self.convert(value, Type.F64, node)
        if value.type is Type.BOOL:
            value = self.convert(value, Type.I64, node)
        if target is builtins.int:
            if value.type is Type.I64:
                return value
            return self.compute(Type.I64, f"fptosi double {value.text} to i64")
        if value.type is Type.I64:
            return self.compute(Type.I64, f"call i64 @llvm.abs.i64(i64 {value.text}, i1 true)")
        return self.compute(Type.F64, f"call double @llvm.fabs.f64(double {value.text})")

    def _extremum(self, node: ast.Call, relation: str) -> Value:
        """min and max keep the first of equals, and the first where nan is involved, as Python's do.

        Fast ones give nan where nan is involved: that leaves loops over them to vectors.
        """
        if len(node.args) < 2:
            raise self.error(node, "min and max need at least two numbers")
        best = self.number(node.args[0])
        for argument in node.args[1:]:
            best, other, type_ = self.common(best, self.number(argument), node)
            if type_ is Type.F64 and self.flags:
                name = "maximum" if relation == "gt" else "minimum"
                best = self.compute(
                    type_, f"call nsz double @llvm.{name}.f64(double {best.text}, double {other.text})"
                )
                continue
            compare = f"fcmp o{relation} double" if type_ is Type.F64 else f"icmp s{relation} i64"
            better = self.compute(Type.BOOL, f"{compare} {other.text}, {best.text}")
            best = self.compute(
                type_, f"select i1 {better.text}, {type_.ir} {other.text}, {type_.ir} {best.text}"
            )
        return best

    def _call_native(self, node: ast.Call, callee: Callee) -> Value:
        signature = callee.signature
        name = ast.unparse(node.func)
        if len(node.args) != len(signature.types):
            raise self.error(node, f"{name}() takes {len(signature.types)} arguments, not {len(node.args)}")
        arguments = []
        for parameter, type_, argument in zip(signature.names, signature.types, node.args, strict=True):
            value = self.convert(
                self.expression(argument), type_, argument, f"argument {parameter} of {name}()"
            )
            arguments.append(f"{type_.ir} {value.text}")
        call = f"call {signature.result.ir} @{callee.symbol}({', '.join(arguments)})"
        if signature.result is Type.NONE:
            self.emit(call)
            return Value(Type.NONE, "")
        return self.compute(signature.result, call)
