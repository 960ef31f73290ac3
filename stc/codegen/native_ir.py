"""Statements and functions of the compiled subset of Python, as one LLVM module."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable
from itertools import count
from typing import Any

from stc.codegen.native_blocks import Value
from stc.codegen.native_calls import DECLARATIONS, Callee, CallEmitter
from stc.codegen.native_types import Signature, Type, type_of_annotation
from stc.codegen.vector import PAST_CACHES_NODE

#: Vectors of sums and extrema that a loop keeps side by side: each waits for its last operation.
_CHAINS = 4
#: Stands for the hint to do so, which every loop has to have a number of its own for.
_REDUCTION = "!reduction"

#: Attributes of functions whose loops LLVM is not to replace by calls.
_IN_PLACE = ' "no-builtin-memcpy" "no-builtin-memmove" "no-builtin-memset"'


class FunctionEmitter(CallEmitter):
    """Emits one function: its body, and a second entry that takes its arguments from memory."""

    def __init__(
        self,
        filename: str,
        definition: ast.FunctionDef,
        symbol: str,
        signature: Signature,
        *,
        flags: str,
        inline: bool,
        small: bool,
        short: bool,
        shared: bool,
        exported: bool,
        resolve: Callable[[str], Any],
        callee_of: Callable[[Any], Callee | None],
    ) -> None:
        super().__init__(filename, flags, resolve, callee_of)
        self.definition = definition
        self.symbol = symbol
        self.signature = signature
        self.attributes = (
            "nounwind" + " alwaysinline" * inline + " minsize optsize" * small + _IN_PLACE * short
        )
        self.exported = exported
        self.array_attributes = " noundef" if shared else " noalias noundef"
        self._loops: list[tuple[str, str]] = []  # labels to go to on continue and on break
        stores = (n for n in ast.walk(definition) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store))
        self.assigned_names = frozenset(n.id for n in stores) | frozenset(signature.names)

    def function(self) -> str:
        """The function's IR."""
        parameters = []
        for position, (name, type_) in enumerate(
            zip(self.signature.names, self.signature.types, strict=True)
        ):
            self.locals[name] = (type_, self.slot(type_, f"%a{position}"))
            attributes = self.array_attributes if type_.is_array else " noundef"
            parameters.append(f"{type_.ir}{attributes} %a{position}")
        self.block(self.definition.body)
        if not self.terminated:
            if self.signature.result is not Type.NONE:
                raise self.error(
                    self.definition, f"{self.definition.name}() may end without returning a value"
                )
            self.emit("ret void")
        linkage = "" if self.exported else "internal "
        result = self.signature.result.ir
        head = f"define {linkage}{result} @{self.symbol}({', '.join(parameters)}) {self.attributes} {{"
        text = [head, "entry:", *self.entry, *self.lines, "}"]
        if self.exported:
            text.extend(self._packed_entry())
        return "\n".join(text) + "\n"

    def _packed_entry(self) -> list[str]:
        """An entry for prepared calls: all arguments come from consecutive 8-byte cells."""
        lines = [f"define {self.signature.result.ir} @{self.symbol}.packed(ptr %cells) nounwind {{"]
        arguments = []
        for position, type_ in enumerate(self.signature.types):
            lines.append(f"  %p{position} = getelementptr inbounds i64, ptr %cells, i64 {position}")
            lines.append(f"  %v{position} = load {type_.ir}, ptr %p{position}, align 8")
            arguments.append(f"{type_.ir} %v{position}")
        call = f"call {self.signature.result.ir} @{self.symbol}({', '.join(arguments)})"
        if self.signature.result is Type.NONE:
            return [*lines, "  " + call, "  ret void", "}"]
        return [*lines, f"  %result = {call}", f"  ret {self.signature.result.ir} %result", "}"]

    # ---- statements ---------------------------------------------------------------------------------

    def block(self, statements: list[ast.stmt]) -> None:
        """Emit statements in order."""
        for statement in statements:
            if self.terminated:  # unreachable, but LLVM wants it well formed: a block that nothing jumps to
                self.begin(self.label("dead"))
            self.statement(statement)

    def statement(self, node: ast.stmt) -> None:
        """Emit one statement."""
        method = getattr(self, "_do_" + type(node).__name__.lower(), None)
        if method is None:
            raise self.error(node, f"{type(node).__name__} statements cannot be compiled")
        method(node)

    def _do_pass(self, node: ast.Pass) -> None:
        pass

    def _do_expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            return  # documentation
        if not isinstance(node.value, ast.Call):
            raise self.error(node, "an expression without effect")
        self.expression(node.value)

    def _do_assign(self, node: ast.Assign) -> None:
        if len(node.targets) == 1 and isinstance(node.targets[0], ast.Tuple):
            targets = node.targets[0].elts
            if not isinstance(node.value, ast.Tuple) or len(node.value.elts) != len(targets):
                raise self.error(node, "a tuple can only be assigned from as many values")
            values = [self.expression(element) for element in node.value.elts]
            for target, value in zip(targets, values, strict=True):
                self.assign(target, value)
            return
        value = self.expression(node.value)
        for target in node.targets:
            self.assign(target, value)

    def _do_annassign(self, node: ast.AnnAssign) -> None:
        type_ = type_of_annotation(ast.unparse(node.annotation))
        if type_ is None or type_ is Type.NONE:
            raise self.error(node, f"{ast.unparse(node.annotation)} is not a type of compiled code")
        if not isinstance(node.target, ast.Name):
            raise self.error(node, "only names can be declared")
        if node.target.id not in self.locals:
            self.locals[node.target.id] = (type_, self.slot(type_))
        elif self.locals[node.target.id][0] is not type_:
            raise self.error(node, f"{node.target.id} already is {self.locals[node.target.id][0].value}")
        if node.value is not None:
            self.assign(node.target, self.expression(node.value))

    def _do_augassign(self, node: ast.AugAssign) -> None:
        if isinstance(node.op, ast.Pow):
            raise self.error(node, "**= cannot be compiled; write x = x**n")
        if isinstance(node.target, ast.Subscript):
            type_, address = self.element_address(node.target)
            result = self.binary(node.op, self.load_element(type_, address), self.number(node.value), node)
            self.store_element(type_, address, result, node)
            return
        if not isinstance(node.target, ast.Name) or node.target.id not in self.locals:
            raise self.error(node, f"{ast.unparse(node.target)} is changed before anything is assigned to it")
        current = self.number(node.target)
        self.assign(node.target, self.binary(node.op, current, self.number(node.value), node))

    def assign(self, target: ast.expr, value: Value) -> None:
        """Store a value to a name or an array element."""
        if isinstance(target, ast.Subscript):
            if isinstance(target.slice, ast.Slice):
                raise self.error(target, "only single elements can be assigned")
            type_, address = self.element_address(target)
            self.store_element(type_, address, value, target)
            return
        if not isinstance(target, ast.Name):
            raise self.error(target, f"cannot assign to {ast.unparse(target)}")
        if value.type is Type.NONE:
            raise self.error(target, "the call returns nothing")
        if target.id not in self.locals:
            self.locals[target.id] = (value.type, self.slot(value.type))
        type_, slot = self.locals[target.id]
        if type_ is Type.I64 and value.type is Type.F64:
            raise self.error(
                target, f"{target.id} was first assigned an integer and now a float; start it with a float"
            )
        value = self.convert(value, type_, target, f"value for {target.id}")
        self.emit(f"store {type_.ir} {value.text}, ptr {slot}")

    def store_element(self, type_: Type, address: str, value: Value, node: ast.AST) -> None:
        """Write an element."""
        value = self.convert(value, type_.element, node, "value for an element")
        if type_ is Type.I32S:
            value = self.compute(Type.I64, f"trunc i64 {value.text} to i32")
            self.emit(f"store i32 {value.text}, ptr {address}, align 4")
        else:
            self.emit(f"store {type_.element_ir} {value.text}, ptr {address}, align 8")

    def _do_return(self, node: ast.Return) -> None:
        result = self.signature.result
        if node.value is None or (isinstance(node.value, ast.Constant) and node.value.value is None):
            if result is not Type.NONE:
                raise self.error(node, f"a value of type {result.value} must be returned")
            self.emit("ret void")
        else:
            if result is Type.NONE:
                raise self.error(node, "the function is declared to return nothing")
            value = self.convert(self.expression(node.value), result, node, "returned value")
            self.emit(f"ret {result.ir} {value.text}")
        self.terminated = True

    def _do_if(self, node: ast.If) -> None:
        yes, no, end = self.label("if"), self.label("else"), self.label("endif")
        self.branch_if(self.condition(node.test), yes, no)
        self.begin(yes)
        self.block(node.body)
        first_open = not self.terminated
        if first_open:
            self.branch(end)
        self.begin(no)
        self.block(node.orelse)
        second_open = not self.terminated
        if second_open:
            self.branch(end)
        if first_open or second_open:
            self.begin(end)

    def _do_while(self, node: ast.While) -> None:
        test, body, other, end = (self.label(hint) for hint in ("test", "while", "whileelse", "endwhile"))
        endless = isinstance(node.test, ast.Constant) and bool(node.test.value)
        self.begin(test)
        if endless:
            self.branch(body)
        else:
            self.branch_if(self.condition(node.test), body, other)
        self.begin(body)
        left_by_break = self._loop_body(node.body, test, end)
        if not self.terminated:
            self.branch(test)
        after_open = left_by_break
        if not endless:
            self.begin(other)
            self.block(node.orelse)
            if not self.terminated:
                after_open = True
                self.branch(end)
        if after_open:
            self.begin(end)

    def _loop_body(self, statements: list[ast.stmt], again: str, end: str) -> bool:
        """Emit a loop's body; returns whether some break leaves it."""
        self._loops.append((again, end))
        self.block(statements)
        self._loops.pop()
        return end in self.targets

    def _do_for(self, node: ast.For) -> None:
        start, stop, step = self._range(node)
        if not isinstance(node.target, ast.Name):
            raise self.error(node, "the loop variable must be a name")
        counter = self.slot(Type.I64)
        test, body, again, other, end = (
            self.label(hint) for hint in ("fortest", "for", "fornext", "forelse", "endfor")
        )
        self.emit(f"store i64 {start.text}, ptr {counter}")
        self.begin(test)
        now = self.compute(Type.I64, f"load i64, ptr {counter}")
        if step.text.lstrip("-").isdigit():
            relation = "slt" if int(step.text) > 0 else "sgt"
            more = self.compute(Type.BOOL, f"icmp {relation} i64 {now.text}, {stop.text}")
        else:
            up = self.compute(Type.BOOL, f"icmp sgt i64 {step.text}, 0")
            below = self.compute(Type.BOOL, f"icmp slt i64 {now.text}, {stop.text}")
            above = self.compute(Type.BOOL, f"icmp sgt i64 {now.text}, {stop.text}")
            more = self.compute(Type.BOOL, f"select i1 {up.text}, i1 {below.text}, i1 {above.text}")
        self.branch_if(more, body, other)
        self.begin(body)
        self.assign(node.target, now)
        self._loop_body(node.body, again, end)
        self.begin(again)
        last = self.compute(Type.I64, f"load i64, ptr {counter}")
        following = self.compute(Type.I64, f"add nsw i64 {last.text}, {step.text}")
        self.emit(f"store i64 {following.text}, ptr {counter}")
        self.branch(test, f", !llvm.loop {_REDUCTION}" if self.flags and self._reduces(node) else "")
        self.begin(other)
        self.block(node.orelse)
        self.begin(end)

    def _reduces(self, node: ast.For) -> bool:
        """Whether a loop adds up a number, or finds the largest or smallest, and has no loops inside."""
        if any(isinstance(inner, ast.For | ast.While) for part in node.body for inner in ast.walk(part)):
            return False
        return any(self._is_reduction(statement) for statement in node.body)

    def _is_reduction(self, node: ast.stmt) -> bool:
        target: ast.expr
        if isinstance(node, ast.AugAssign):
            target = node.target
            reduces = isinstance(node.op, ast.Add | ast.Sub)
        elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Call):
            target = node.targets[0]
            names = {argument.id for argument in node.value.args if isinstance(argument, ast.Name)}
            extremum = self.lookup(node.value.func) in (min, max)
            reduces = extremum and isinstance(target, ast.Name) and target.id in names
        else:
            return False
        return reduces and isinstance(target, ast.Name) and self.locals[target.id][0] is Type.F64

    def _range(self, node: ast.For) -> tuple[Value, Value, Value]:
        call = node.iter
        if not (isinstance(call, ast.Call) and self.lookup(call.func) is range and not call.keywords):
            raise self.error(node, "only loops over range(...) can be compiled")
        if not 1 <= len(call.args) <= 3:
            raise self.error(node, "range takes one to three arguments")
        values = [self.integer(argument, "range argument") for argument in call.args]
        if len(values) == 1:
            values.insert(0, Value(Type.I64, "0"))
        if len(values) == 2:
            values.append(Value(Type.I64, "1"))
        if values[2].text == "0":
            raise self.error(node, "the step of range is zero")
        return values[0], values[1], values[2]

    def _do_break(self, node: ast.Break) -> None:
        self.branch(self._loops[-1][1])

    def _do_continue(self, node: ast.Continue) -> None:
        self.branch(self._loops[-1][0])


def module_text(functions: list[str]) -> str:
    """One LLVM module from functions."""
    code = "\n".join(functions)
    numbers = count(1)
    code = re.sub(_REDUCTION, lambda _: f"!{next(numbers)}", code)
    hints = [f"!{k} = distinct !{{!{k}, !0}}" for k in range(1, next(numbers))]
    chains = f'!0 = !{{!"llvm.loop.interleave.count", i32 {_CHAINS}}}'
    return "\n".join([DECLARATIONS, code, PAST_CACHES_NODE, chains, *hints]) + "\n"
