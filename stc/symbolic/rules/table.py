"""The simplification rules, as a table.

Each :class:`Rule` states an identity in the notation of the 2001 report (``e`` for expressions, ``l`` for
literals) and carries the action that performs it.  The constructors of :mod:`stc.symbolic.node` try the
actions registered for the operators of their operands in the order of this table, so that every expression is
simplified as it is built and operands are always simplified already.

All rules have these properties:

- Nothing is folded to a value that is not finite: ``1/0`` and ``log(-1)`` stay as they are and evaluate to
  inf or nan.
- ``0*e``, ``0/e``, ``e - e`` and ``e^0`` become literals although ``e`` may be undefined somewhere; quotients
  are never cancelled (``e/e`` stays), nor are ``sqrt(e)^2``, ``sqrt(e*e)`` and ``exp(log(e))``.
- A negative coefficient or a minus sign moves outwards (and into ``-`` of a sum), so that ``a*b`` and
  ``(-a)*b`` share their product.

The table is checked rule by rule on random values in ``tests/symbolic/test_rules.py``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from stc.records import dataclass
from stc.symbolic.node import (
    ARITY,
    COMMUTATIVE,
    LOOK,
    ZERO,
    Expr,
    Rewrite,
    add,
    binary_rules,
    mul,
    neg,
    num,
    unary_rules,
)

ANY: Final = ("num", "sym", *ARITY, LOOK)
SCALED: Final = ("num", "neg", "mul")


@dataclass(frozen=True, slots=True)
class Rule:
    """One line of the table: ``pattern => result`` for ``op`` applied to operands with one of the given
    operators.

    For a commutative ``op`` the heads are listed for one order of the operands and registered for both:
    ``action`` receives the operands in canonical order, whichever it is.
    """

    pattern: str
    result: str
    op: str
    heads: tuple[tuple[str, ...], ...]
    action: Rewrite


RULES: list[Rule] = []
"""The table, in the order in which rules are tried."""


def rule(pattern: str, result: str, op: str, *heads: str | tuple[str, ...]) -> Callable[[Rewrite], Rewrite]:
    """Add a line to the table and register its action for the constructors."""
    spread = tuple((head,) if isinstance(head, str) else head for head in heads)

    def register(action: Rewrite) -> Rewrite:
        RULES.append(Rule(pattern, result, op, spread, action))
        if len(spread) == 1:
            for head in spread[0]:
                unary_rules[op, head] = (*unary_rules.get((op, head), ()), action)
            return action
        pairs = {(a, b) for a in spread[0] for b in spread[1]}
        if op in COMMUTATIVE:
            pairs |= {(b, a) for a, b in pairs}
        for a, b in sorted(pairs):
            binary_rules[op, a, b] = (*binary_rules.get((op, a, b), ()), action)
        return action

    return register


def coefficient(e: Expr) -> tuple[float, Expr]:
    """``(l, e')`` with ``e = l*e'``: the outermost literal factor, or 1."""
    if e.op == "mul":
        first = e.args[0]
        if first.op == "num":
            return first.payload, e.args[1]
    elif e.op == "neg":
        return -1.0, e.args[0]
    return 1.0, e


def scale(factor: float, e: Expr) -> Expr:
    """``factor*e``."""
    if factor == 0.0:
        return ZERO
    if factor == 1.0:
        return e
    return neg(e) if factor == -1.0 else mul(num(factor), e)


def collect(terms: Sequence[Expr]) -> Expr:
    """The sum of the terms with like ones merged first: ``l1*e + f + l2*e => (l1+l2)*e + f``."""
    if len(terms) <= 2:
        return (terms[0] if len(terms) == 1 else add(terms[0], terms[1])) if terms else ZERO
    factors: dict[Expr, float] = {}
    for term in terms:
        factor, rest = coefficient(term)
        factors[rest] = factors.get(rest, 0.0) + factor
    if len(factors) == len(terms):
        merged = terms
    else:
        merged = [scale(factor, rest) for rest, factor in factors.items() if factor != 0.0]
    total = ZERO
    for term in merged:
        total = add(total, term)
    return total
