"""From shared expressions to a straight-line program: the form that back ends compile or interpret.

A :class:`Tape` is in static single assignment form.  Values live in numbered *slots*, in this order:

    uniform inputs | varying inputs | literals | results of the operations, one each, in order

Uniform inputs have one value per call, varying inputs one per instance (frame).  Operations that depend on
uniform inputs and literals alone come first and are flagged, so that a back end can run them once per call.

The operators are those of :data:`~stc.symbolic.node.ARITY` and :data:`LOOKUPS` and nothing else.  What is reduced in
strength on the way here:

- ``e^k`` with whole ``|k| <= 64`` becomes multiplications (repeated squaring, powers shared), ``e^(k/2)``
  with odd ``|k| <= 32`` multiplications and a square root; a negative exponent adds one division.  ``pow``
  remains for the rest.
- A varying value divided by a uniform one is multiplied by the uniform reciprocal, and where one divisor
  serves several quotients its reciprocal is computed once; the reciprocal of a product of such divisors is
  the product of their reciprocals.  Such a quotient has a relative error of a few units in the last place
  instead of a half; besides, it differs from a division only where the reciprocal of the divisor overflows
  (a divisor below 5.6e-309 in magnitude).
- Uniform factors of a product are multiplied with each other first, once per call.
- Expressions that are equal as polynomials are computed once, whichever way they are written.

Operations come in the order of :func:`_schedule`.
"""

from __future__ import annotations

import struct
from collections.abc import Hashable, Iterator, Sequence
from functools import cached_property
from hashlib import sha256
from typing import TYPE_CHECKING, Final

from stc.records import dataclass
from stc.symbolic.expr import Expr, reachable
from stc.symbolic.tables import CLIP, REACHES, READ

if TYPE_CHECKING:
    from stc.codegen.lowering import Program

LOOKUPS: Final[dict[str, int]] = {CLIP: 2, REACHES: 2, READ: 2}
"""The operators that looking up a table takes, and how many operands each has.

``clip(x, last)`` is x rounded down, between 0 and last; 0 where x is no number.  ``reaches(begin, x)`` is 1 where begin
is not above x, else 0.  ``read(place, k)`` is the number k places after the place in what follows the uniform inputs,
counted from the first of those; k is a literal.
"""

CIRCULAR: Final = ("sin", "cos", "tan")
"""The operators that have most of their work in common, if they have their operand in common."""


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

    def reads(self) -> Iterator[tuple[int, tuple[int, ...]]]:
        """The per-instance operations, by number, with the distinct slots that each one reads."""
        for number in range(self.n_uniform_ops, len(self.ops)):
            _, a, b = self.ops[number]
            yield number, ((a, b) if b >= 0 and b != a else (a,))

    def digest(self) -> str:
        """A SHA-256 of the content: the same in every process for the same program."""
        return self._digest

    @cached_property
    def _digest(self) -> str:
        content = sha256(b"stc tape 1\n")
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


def _schedule(program: Program, roots: Sequence[int]) -> list[int]:
    """The operations that the roots need, operands first, depth first, the larger operand first.

    The order of Sethi & Ullman (J. ACM 17, 1970), optimal for trees: back ends emit the operations as they
    come, in one basic block without a scheduler, so it decides how many values are alive at once.
    """
    op, first, second = program.op, program.a, program.b
    need = [1] * len(op)
    for k in range(len(op)):
        if op[k] == "literal" or program.uniform[k]:
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

    Whole expressions may be varying inputs as well: what contains one of them takes it from there.  Only what the
    outputs need is computed, and every distinct value once.  The result depends on the structure of the expressions
    alone, so that equal problems give equal digests in every process.

    Raises:
        ValueError: an expression contains a symbol that is not an input, or an input is named twice.
    """
    from stc.codegen.lowering import ABSENT, Lowering, Program

    input_of: dict[Hashable, int] = {key: slot for slot, key in enumerate((*uniform, *varying))}
    if len(input_of) != len(uniform) + len(varying):
        raise ValueError("an input of the tape is named twice")
    program = Program(len(uniform), len(varying))
    given = frozenset(key for key in varying if isinstance(key, Expr))
    number = Lowering(program, reachable(outputs, given), input_of).number
    roots = [number[e] for e in outputs]
    order = _schedule(program, roots)
    order = [k for k in order if program.uniform[k]] + [k for k in order if not program.uniform[k]]

    used = set(roots)
    for k in order:
        used.add(program.a[k])
        used.add(program.b[k])
    literals = [k for k in sorted(program.literal) if k in used]
    slot = {k: k for k in range(len(input_of))}
    slot |= {k: len(input_of) + position for position, k in enumerate(literals + order)}
    slot[ABSENT] = -1
    return Tape(
        n_uniform=len(uniform),
        n_varying=len(varying),
        constants=[program.literal[k] for k in literals],
        ops=[(program.op[k], slot[program.a[k]], slot[program.b[k]]) for k in order],
        outputs=[slot[k] for k in roots],
        uniform_ops=[program.uniform[k] for k in order],
    )
