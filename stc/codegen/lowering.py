"""From expressions to operations, cheaper ones where there are any: the first half of making a tape.

What is reduced in strength is listed in :mod:`stc.codegen.tape`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Container, Hashable, Sequence
from typing import Final

from stc.symbolic.expr import Expr
from stc.symbolic.fingerprint import Fingerprint
from stc.symbolic.tables import (
    AXIS,
    BEGINS,
    BUCKET,
    BUCKETS,
    CLIP,
    COEFFICIENTS,
    FIRST,
    LAST,
    LOWEST,
    ORDER,
    ORIGIN,
    REACHES,
    READ,
    ROW,
    SCALE,
    STEP,
    TOLD,
)

MAX_WHOLE_POWER: Final = 64
MAX_HALF_POWER: Final = 32
ABSENT: Final = -1


class Program:
    """Operations under construction, each computed once; operands before results, not in their final order.

    Values are numbered: inputs first (uniform, then varying), then literals and operations as they come.
    ``op[k]`` is ``"input"``, ``"literal"`` or an operator, ``a[k]`` and ``b[k]`` its operands or ABSENT,
    ``uniform[k]`` whether it depends on uniform inputs and literals alone.
    """

    def __init__(self, n_uniform: int, n_varying: int) -> None:
        self.op: list[str] = ["input"] * (n_uniform + n_varying)
        self.a: list[int] = [ABSENT] * len(self.op)
        self.b: list[int] = [ABSENT] * len(self.op)
        self.uniform: list[bool] = [True] * n_uniform + [False] * n_varying
        self.literal: dict[int, float] = {}
        self._literals: dict[float | str, int] = {}
        self._known: dict[tuple[str, int, int], int] = {}

    def constant(self, value: float) -> int:
        """The number of a literal."""
        key: float | str = value if value == value else "nan"
        number = self._literals.get(key)
        if number is None:
            number = self._literals[key] = self._append("literal", ABSENT, ABSENT, True)
            self.literal[number] = value
        return number

    def _append(self, op: str, a: int, b: int, uniform: bool) -> int:
        self.op.append(op)
        self.a.append(a)
        self.b.append(b)
        self.uniform.append(uniform)
        return len(self.op) - 1

    def emit(self, op: str, a: int, b: int = ABSENT) -> int:
        """The number of an operation's result; the operation is added where it is not there yet."""
        key = (op, b, a) if b < a and (op == "add" or op == "mul") else (op, a, b)
        number = self._known.get(key)
        if number is None:
            uniform = self.uniform[a] and (b == ABSENT or self.uniform[b])
            number = self._known[key] = self._append(op, a, b, uniform)
        return number

    def whole_power(self, a: int, exponent: int) -> int:
        """``a^exponent``, exponent >= 1, by repeated squaring: powers of one base share factors."""
        if exponent == 1:
            return a
        half = self.whole_power(a, exponent // 2)
        square = self.emit("mul", half, half)
        return square if exponent % 2 == 0 else self.emit("mul", square, a)

    def power(self, a: int, exponent: float) -> int | None:
        """``a^exponent`` in cheaper operations, None where there are none."""
        size = abs(exponent)
        if size == 0.0:
            return self.constant(1.0)
        if 1.0 <= size <= MAX_WHOLE_POWER and size == int(size):
            result = self.whole_power(a, int(size))
        elif 0.5 <= size <= MAX_HALF_POWER / 2 and 2 * size == int(2 * size):
            result = self.emit("sqrt", a)
            if size > 0.5:
                result = self.emit("mul", self.whole_power(a, int(size)), result)
        else:
            return None
        return result if exponent > 0 else self.emit("div", self.constant(1.0), result)


def inverted_divisors(
    nodes: Sequence[Expr], uniform: Collection[Hashable], given: Container[Hashable] = ()
) -> set[Expr]:
    """The divisors whose reciprocal is to be computed once instead of dividing by them.

    Of all nodes; the keys of symbols that are uniform, and the nodes that are varying inputs, tell which vary.

    Those that serve several quotients, the uniform ones, products of such and uniform factors, and the
    factors of those products (derivatives of ``a/b`` divide by ``b*b``).
    """
    quotients = Counter(node.args[1] for node in nodes if node.op == "div" and node.args[1].op != "num")
    if not quotients:
        return set()
    varying: set[Expr] = set()
    chosen: set[Expr] = set()
    for node in nodes:
        if node.op == "sym":
            if node.payload not in uniform:
                varying.add(node)
        elif node in given or any(arg in varying for arg in node.args):
            varying.add(node)
        if node in quotients:
            if quotients[node] > 1 or node not in varying:
                chosen.add(node)
            if _is_product(node, quotients, varying):
                chosen.update(arg for arg in (node, *node.args) if arg in quotients)
    return chosen


def _is_product(node: Expr, divisors: Container[Expr], varying: Container[Expr]) -> bool:
    """Whether both factors of a product are divisors themselves, or uniform."""
    return node.op == "mul" and all(arg in divisors or arg not in varying for arg in node.args)


class Lowering:
    """Turns expressions into operations of a :class:`Program`.

    Expressions that are equal as polynomials, told by their fingerprints, are computed once, in the form that
    comes first in the order of :attr:`~stc.symbolic.node.Expr.order`: the one of least height.
    """

    def __init__(self, program: Program, nodes: Sequence[Expr], input_of: dict[Hashable, int]) -> None:
        self.program = program
        self.number: dict[Expr, int] = {}
        self._input_of = input_of
        self._inverted = inverted_divisors(
            nodes, {k for k, slot in input_of.items() if program.uniform[slot]}, input_of
        )
        self._inverse: dict[Expr, int] = {}
        self._uses = Counter(arg for node in nodes for arg in node.args)
        self._equal: dict[Fingerprint, int] = {}
        for node in nodes:
            if not node.args:
                self.number[node] = self._leaf(node)
            elif node.op == "at":
                self.number[node] = self.number[node.args[0]]
            elif node in input_of:
                self.number[node] = self._equal[node.fingerprint] = input_of[node]
            else:
                self.number[node] = self._once(node)

    def _leaf(self, node: Expr) -> int:
        if node.op == "num":
            return self.program.constant(node.payload)
        try:
            return self._input_of[node.payload.base if node.op == "table" else node.payload]
        except KeyError:
            raise ValueError(f"the symbol {node.payload!r} is not an input of the tape") from None

    def _once(self, node: Expr) -> int:
        if node.fingerprint != node.fingerprint:
            return self._operation(node)
        known = self._equal.get(node.fingerprint)
        if known is None:
            known = self._equal[node.fingerprint] = self._operation(node)
        return known

    def _operation(self, node: Expr) -> int:
        op, program, number = node.op, self.program, self.number
        if len(node.args) == 1:
            return program.emit(op, number[node.args[0]])
        left, right = node.args
        a, b = number[left], number[right]
        if op == "look":
            return self._looked_up(a, right)
        if op == "mul" and program.uniform[a] != program.uniform[b]:
            return self._scaled(a, right) if program.uniform[a] else self._scaled(b, left)
        if op == "div" and right in self._inverted and not (program.uniform[a] and program.uniform[b]):
            inverse = self._reciprocal(right)
            return inverse if program.literal.get(a) == 1.0 else program.emit("mul", a, inverse)
        if op == "pow" and right.op == "num":
            power = program.power(a, right.payload)
            if power is not None:
                return power
        return program.emit(op, a, b)

    def _looked_up(self, x: int, place: Expr) -> int:
        """A table, or a derivative of it: the polynomial of the piece that x lies in."""
        emit = self.program.emit
        leaf = place if place.op == "table" else place.args[1]
        table, orders = self.number[leaf], leaf.payload.orders
        axes = leaf.payload.table.axes
        piece, first = self._piece(x, table, 0, axes[0].search)
        begin = emit("add", table, self._read(table, COEFFICIENTS))
        begin = emit("add", begin, emit("mul", piece, self._read(table, ROW)))
        if place.op == "table":
            return self._polynomial(first, [self._read(begin, k) for k in range(ORDER)], orders[0])
        piece, second = self._piece(self.number[place], table, AXIS, axes[1].search)
        begin = emit("add", begin, emit("mul", piece, self.program.constant(float(ORDER * ORDER))))
        rows = []
        for k in range(ORDER):
            row = [self._read(begin, ORDER * k + j) for j in range(ORDER)]
            rows.append(self._polynomial(second, row, orders[1]) if k >= orders[0] else ABSENT)
        return self._polynomial(first, rows, orders[0])

    def _read(self, place: int, k: int) -> int:
        return self.program.emit(READ, place, self.program.constant(float(k)))

    def _piece(self, x: int, table: int, axis: int, search: int) -> tuple[int, int]:
        """The number of the piece that x lies in along an axis, and what x is more than where its variable is zero."""
        emit, constant = self.program.emit, self.program.constant
        offset = emit("sub", x, self._read(table, axis + LOWEST))
        scaled = emit("mul", offset, self._read(table, axis + SCALE))
        piece = emit(CLIP, scaled, self._read(table, axis + LAST))
        if not search:
            origin = emit("mul", piece, self._read(table, axis + STEP))
            return piece, emit("sub", x, emit("add", origin, self._read(table, axis + ORIGIN)))
        buckets = emit("add", table, self._read(table, axis + BUCKETS))
        if search <= TOLD:
            bucket = emit("add", buckets, emit("mul", piece, constant(float(BUCKET))))
            piece, zero = self._read(bucket, FIRST), self._read(bucket, 0)
            before = zero
            for k in range(1, search + 1):
                place = self._read(bucket, k)
                there = emit(REACHES, place, x)
                piece = emit("add", piece, there)
                zero = emit("add", zero, emit("mul", there, emit("sub", place, before)))
                before = place
            return piece, emit("sub", x, zero)
        begins = emit("add", table, self._read(table, axis + BEGINS))
        piece = self._read(emit("add", buckets, piece), 0)
        for step in reversed(range(search - TOLD)):
            stride = 1 << step
            begin = self._read(emit("add", begins, piece), stride)
            there = emit(REACHES, begin, x)
            piece = emit("add", piece, there if stride == 1 else emit("mul", constant(float(stride)), there))
        return piece, emit("sub", x, self._read(emit("add", begins, piece), 0))

    def _polynomial(self, x: int, coefficients: Sequence[int], order: int) -> int:
        """Of a cubic polynomial with these coefficients the derivative of this order."""
        emit, constant = self.program.emit, self.program.constant
        result = ABSENT
        for k in reversed(range(order, ORDER)):
            factor = math.perm(k, order)
            term = coefficients[k] if factor == 1 else emit("mul", constant(float(factor)), coefficients[k])
            result = term if result == ABSENT else emit("add", emit("mul", x, result), term)
        return result

    def _scaled(self, factor: int, node: Expr) -> int:
        """``factor*node`` with a uniform factor; where the node is for this alone, with all its uniform factors."""
        program, number = self.program, self.number[node]
        if self._uses[node] == 1 and program.op[number] == "mul":
            first, second = program.a[number], program.b[number]
            if program.uniform[first]:
                return program.emit("mul", program.emit("mul", factor, first), second)
            if program.uniform[second]:
                return program.emit("mul", program.emit("mul", factor, second), first)
        return program.emit("mul", factor, number)

    def _reciprocal(self, divisor: Expr) -> int:
        known = self._inverse.get(divisor)
        if known is None:
            program, number = self.program, self.number
            factors = divisor.args
            if (
                divisor.op == "mul"
                and not program.uniform[number[divisor]]
                and all(map(self._invertible, factors))
            ):
                known = program.emit("mul", self._reciprocal(factors[0]), self._reciprocal(factors[1]))
            else:
                known = program.emit("div", program.constant(1.0), number[divisor])
            self._inverse[divisor] = known
        return known

    def _invertible(self, factor: Expr) -> bool:
        return factor in self._inverted or self.program.uniform[self.number[factor]]
