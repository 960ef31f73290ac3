"""From shared expressions to a straight-line program: the form that back ends compile or interpret.

A :class:`Tape` is in static single assignment form.  Values live in numbered *slots*, in this order:

    uniform inputs | varying inputs | literals | results of the operations, one each, in order

Uniform inputs have one value per call, varying inputs one per instance (frame).  Operations that depend on
uniform inputs and literals alone come first and are flagged, so that a back end can run them once per call.

The operators are those of :data:`OPERATORS` and nothing else.  What is reduced in strength on the way here:

- ``e^k`` with whole ``|k| <= 64`` becomes multiplications (repeated squaring, powers shared), ``e^(k/2)``
  with odd ``|k| <= 32`` multiplications and a square root; a negative exponent adds one division.  ``pow``
  remains for the rest.
- A varying value divided by a uniform one is multiplied by the uniform reciprocal, and where one divisor
  serves several quotients its reciprocal is computed once; the reciprocal of a product of such divisors is
  the product of their reciprocals.  Such a quotient has a relative error of a few units in the last place
  instead of a half; besides, it differs from a division only where the reciprocal of the divisor overflows
  (a divisor below 5.6e-309 in magnitude).
"""

from __future__ import annotations

import hashlib
import struct
from collections import Counter
from collections.abc import Collection, Container, Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from stc.symbolic.expr import FUNCTIONS, Expr, reachable

OPERATORS: Final[dict[str, int]] = {"add": 2, "sub": 2, "mul": 2, "div": 2, "pow": 2, "neg": 1, **FUNCTIONS}
"""The operators of a tape and how many operands each takes."""

_MAX_WHOLE_POWER: Final = 64
_MAX_HALF_POWER: Final = 32


@dataclass(frozen=True, eq=False)
class Tape:
    """A straight-line program; see the module's text for the numbering of its slots.

    ``ops`` holds ``(operator, slot, slot)``, the second slot -1 for unary operators.  ``outputs`` are slots
    of any kind, ``uniform_ops`` tells per operation whether it depends on uniform inputs and literals alone:
    True for the first ``n_uniform_ops`` operations, False for the others.
    """

    n_uniform: int
    n_varying: int
    constants: list[float]
    ops: list[tuple[str, int, int]]
    outputs: list[int]
    uniform_ops: list[bool]

    @property
    def first_literal(self) -> int:
        """The slot of the first literal."""
        return self.n_uniform + self.n_varying

    @property
    def first_op(self) -> int:
        """The slot of the first operation's result."""
        return self.first_literal + len(self.constants)

    @property
    def n_slots(self) -> int:
        return self.first_op + len(self.ops)

    @cached_property
    def n_uniform_ops(self) -> int:
        """How many operations run once per call: the first so many."""
        return sum(self.uniform_ops)

    @cached_property
    def last_use(self) -> list[int]:
        """Per slot, the last operation that reads it; -1 if none does, ``len(ops)`` for outputs."""
        last = [-1] * self.n_slots
        for number, (_, a, b) in enumerate(self.ops):
            last[a] = number
            if b >= 0:
                last[b] = number
        for slot in self.outputs:
            last[slot] = len(self.ops)
        return last

    def count_ops(self, uniform: bool | None = None) -> dict[str, int]:
        """How often each operator occurs, in all operations or, by flag, the uniform or the others."""
        wanted = [
            op[0] for op, flag in zip(self.ops, self.uniform_ops, strict=True) if uniform in (None, flag)
        ]
        return dict(sorted(Counter(wanted).items()))

    def digest(self) -> str:
        """A SHA-256 of the content: the same in every process for the same program."""
        return self._digest

    @cached_property
    def _digest(self) -> str:
        content = hashlib.sha256(b"stc tape 1\n")
        content.update(struct.pack("<4q", self.n_uniform, self.n_varying, len(self.constants), len(self.ops)))
        content.update(struct.pack(f"<{len(self.constants)}d", *self.constants))
        content.update("\n".join([f"{op} {a} {b}" for op, a, b in self.ops]).encode())
        content.update(struct.pack(f"<{len(self.outputs)}q", *self.outputs))
        return content.hexdigest()

    def text(
        self,
        uniform_names: Sequence[str] | None = None,
        varying_names: Sequence[str] | None = None,
        output_names: Sequence[str] | None = None,
    ) -> str:
        """A listing, one operation per line.  Inputs without names are ``u0, ...`` and ``v0, ...``."""
        names = list(uniform_names) if uniform_names is not None else [f"u{k}" for k in range(self.n_uniform)]
        names += varying_names if varying_names is not None else [f"v{k}" for k in range(self.n_varying)]
        names += [repr(value) for value in self.constants]
        names += [f"%{k}" for k in range(len(self.ops))]
        results = output_names if output_names is not None else [f"out{k}" for k in range(len(self.outputs))]
        lines = [
            f"tape: {self.n_uniform} uniform inputs, {self.n_varying} varying inputs, "
            f"{len(self.constants)} literals, {self.n_uniform_ops} operations once per call, "
            f"{len(self.ops) - self.n_uniform_ops} per instance, {len(self.outputs)} outputs"
        ]
        for number, (op, a, b) in enumerate(self.ops):
            if number == 0 and self.n_uniform_ops:
                lines.append("once per call:")
            if number == self.n_uniform_ops:
                lines.append("per instance:")
            operands = names[a] if b < 0 else f"{names[a]}, {names[b]}"
            lines.append(f"  %{number} = {op} {operands}")
        lines.append("outputs:")
        lines += [f"  {name} = {names[slot]}" for name, slot in zip(results, self.outputs, strict=True)]
        return "\n".join(lines)


class _Builder:
    """Operations under construction, value-numbered; operands before results but in no particular order yet.

    Node numbers: inputs first, then literals and operations as they come.
    """

    def __init__(self, n_uniform: int, n_varying: int) -> None:
        self.op: list[str] = ["input"] * (n_uniform + n_varying)
        self.a: list[int] = [-1] * len(self.op)
        self.b: list[int] = [-1] * len(self.op)
        self.literal: dict[int, float] = {}
        self.uniform: list[bool] = [True] * n_uniform + [False] * n_varying
        self._literals: dict[float | str, int] = {}
        self._known: dict[tuple[str, int, int], int] = {}

    def constant(self, value: float) -> int:
        key: float | str = value if value == value else "nan"
        number = self._literals.get(key)
        if number is None:
            number = self._literals[key] = self._append("literal", -1, -1, True)
            self.literal[number] = value
        return number

    def _append(self, op: str, a: int, b: int, uniform: bool) -> int:
        self.op.append(op)
        self.a.append(a)
        self.b.append(b)
        self.uniform.append(uniform)
        return len(self.op) - 1

    def emit(self, op: str, a: int, b: int = -1) -> int:
        key = (op, b, a) if b < a and (op == "add" or op == "mul") else (op, a, b)
        number = self._known.get(key)
        if number is None:
            uniform = self.uniform[a] and (b < 0 or self.uniform[b])
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
        if 1.0 <= size <= _MAX_WHOLE_POWER and size == int(size):
            result = self.whole_power(a, int(size))
        elif 0.5 <= size <= _MAX_HALF_POWER / 2 and 2 * size == int(2 * size):
            result = self.emit("sqrt", a)
            if size > 0.5:
                result = self.emit("mul", self.whole_power(a, int(size)), result)
        else:
            return None
        return result if exponent > 0 else self.emit("div", self.constant(1.0), result)


def _inverted(nodes: Sequence[Expr], uniform: Collection[Hashable]) -> set[Expr]:
    """The divisors whose reciprocal is to be computed once instead of dividing by them.

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
        elif any(arg in varying for arg in node.args):
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


def _lower(builder: _Builder, nodes: Sequence[Expr], slot_of: dict[Hashable, int]) -> dict[Expr, int]:
    """Turn nodes (operands first) into operations; returns the number of each node's value."""
    inverted = _inverted(nodes, {key for key, slot in slot_of.items() if builder.uniform[slot]})
    number: dict[Expr, int] = {}
    inverse: dict[Expr, int] = {}

    def reciprocal(divisor: Expr) -> int:
        known = inverse.get(divisor)
        if known is None:
            factors = divisor.args
            varying = not builder.uniform[number[divisor]]
            if (
                varying
                and divisor.op == "mul"
                and all(f in inverted or builder.uniform[number[f]] for f in factors)
            ):
                known = builder.emit("mul", reciprocal(factors[0]), reciprocal(factors[1]))
            else:
                known = builder.emit("div", builder.constant(1.0), number[divisor])
            inverse[divisor] = known
        return known

    for node in nodes:
        op = node.op
        if op == "num":
            number[node] = builder.constant(node.payload)
        elif op == "sym":
            try:
                number[node] = slot_of[node.payload]
            except KeyError:
                raise ValueError(f"the symbol {node.payload!r} is not an input of the tape") from None
        elif len(node.args) == 1:
            number[node] = builder.emit(op, number[node.args[0]])
        else:
            left, right = node.args
            a, b = number[left], number[right]
            if op == "div" and right in inverted and not (builder.uniform[a] and builder.uniform[b]):
                inverse_b = reciprocal(right)
                is_one = builder.literal.get(a) == 1.0
                number[node] = inverse_b if is_one else builder.emit("mul", a, inverse_b)
                continue
            if op == "pow" and right.op == "num":
                power = builder.power(a, right.payload)
                if power is not None:
                    number[node] = power
                    continue
            number[node] = builder.emit(op, a, b)
    return number


def _schedule(builder: _Builder, roots: Sequence[int]) -> list[int]:
    """The operations that the roots need, operands first, depth first, the larger operand first.

    The order of Sethi & Ullman (J. ACM 17, 1970), optimal for trees: back ends emit the operations as they
    come, in one basic block without a scheduler, so it decides how many values are alive at once.
    """
    op, first, second = builder.op, builder.a, builder.b
    need = [1] * len(op)
    for k in range(len(op)):
        if op[k] == "literal" or builder.uniform[k]:
            need[k] = 0
        elif first[k] >= 0:
            x = need[first[k]]
            y = need[second[k]] if second[k] >= 0 else 0
            need[k] = max(x, y, 1) if x != y else x + 1
    done = [first[k] < 0 for k in range(len(op))]
    order: list[int] = []
    for root in roots:
        stack = [root]
        while stack:
            k = stack[-1]
            if done[k]:
                stack.pop()
                continue
            a, b = first[k], second[k]
            if b >= 0 and not done[b]:
                if not done[a] and need[a] >= need[b]:
                    stack.append(b)
                    stack.append(a)
                else:
                    if not done[a]:
                        stack.append(a)
                    stack.append(b)
            elif not done[a]:
                stack.append(a)
            else:
                done[k] = True
                order.append(k)
                stack.pop()
    return order


def build_tape(outputs: Sequence[Expr], uniform: Sequence[Hashable], varying: Sequence[Hashable]) -> Tape:
    """Compile expressions to a tape whose inputs are the symbols with the given keys, in the given order.

    Only what the outputs need is computed, and every distinct value once.  The result depends on the
    structure of the expressions alone, so that equal problems give equal digests in every process.

    Raises:
        ValueError: an expression contains a symbol that is not an input, or an input is named twice.
    """
    slot_of: dict[Hashable, int] = {key: slot for slot, key in enumerate((*uniform, *varying))}
    if len(slot_of) != len(uniform) + len(varying):
        raise ValueError("an input of the tape is named twice")
    builder = _Builder(len(uniform), len(varying))
    number = _lower(builder, reachable(outputs), slot_of)
    roots = [number[e] for e in outputs]
    order = _schedule(builder, roots)
    order = [k for k in order if builder.uniform[k]] + [k for k in order if not builder.uniform[k]]

    used = set(roots)
    for k in order:
        used.add(builder.a[k])
        used.add(builder.b[k])
    literals = [k for k in sorted(builder.literal) if k in used]
    slot = {k: k for k in range(len(slot_of))}
    slot |= {k: len(slot_of) + position for position, k in enumerate(literals + order)}
    slot[-1] = -1
    return Tape(
        n_uniform=len(uniform),
        n_varying=len(varying),
        constants=[builder.literal[k] for k in literals],
        ops=[(builder.op[k], slot[builder.a[k]], slot[builder.b[k]]) for k in order],
        outputs=[slot[k] for k in roots],
        uniform_ops=[builder.uniform[k] for k in order],
    )
