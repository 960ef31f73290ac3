"""The simplification rules, as a table.

Each :class:`Rule` states an identity in the notation of the 2001 report (``e`` for expressions, ``l`` for
literals) and carries the action that performs it.  The constructors of :mod:`stc.symbolic.node` try the
actions registered for the operators of their operands in the order of this table, so that every expression is
simplified as it is built and operands are always simplified already.

What holds for all rules:

- Nothing is folded to a value that is not finite: ``1/0`` and ``log(-1)`` stay as they are and evaluate to
  inf or nan.
- ``0*e``, ``0/e``, ``e - e`` and ``e^0`` become literals although ``e`` may be undefined somewhere; quotients
  are never cancelled (``e/e`` stays), nor are ``sqrt(e)^2``, ``sqrt(e*e)`` and ``exp(log(e))``.
- A negative coefficient or a minus sign moves outwards (and into ``-`` of a sum), so that ``a*b`` and
  ``(-a)*b`` share their product.

The table is checked rule by rule on random values in ``tests/symbolic/test_rules.py``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from stc.symbolic.node import (
    ARITY,
    COMMUTATIVE,
    FUNCTIONS,
    ONE,
    ZERO,
    Expr,
    Rewrite,
    add,
    binary_rules,
    call,
    div,
    finite,
    mul,
    neg,
    num,
    pow_,
    sub,
    unary_rules,
)

ANY: Final = ("num", "sym", *ARITY)
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
    """``(l, e')`` with ``e = l*e'``: the literal factor that stands outermost, 1 where there is none."""
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


# --- sums ---------------------------------------------------------------------------------------------------


@rule("l1 + l2", "l", "add", "num", "num")
def _add_literals(a: Expr, b: Expr) -> Expr | None:
    return finite(a.payload + b.payload)


@rule("0 + e", "e", "add", "num", ANY)
def _add_zero(a: Expr, b: Expr) -> Expr | None:
    return b if a.payload == 0.0 else None


@rule("l1 + (l2 + e)", "(l1+l2) + e", "add", "num", "add")
def _add_literal_to_sum(a: Expr, b: Expr) -> Expr | None:
    first, rest = b.args
    total = finite(a.payload + first.payload) if first.op == "num" else None
    return None if total is None else add(total, rest)


@rule("l1 + (l2 - e)", "(l1+l2) - e", "add", "num", "sub")
def _add_literal_to_difference(a: Expr, b: Expr) -> Expr | None:
    first, rest = b.args
    total = finite(a.payload + first.payload) if first.op == "num" else None
    return None if total is None else sub(total, rest)


def _combine(la: float, ra: Expr, lb: float, rb: Expr) -> Expr | None:
    """``la*ra + lb*rb`` where something can be gained."""
    if ra is rb:
        total = la + lb
        return scale(total, ra) if math.isfinite(total) else None
    if la == lb:
        return None if la == 1.0 else scale(la, add(ra, rb))
    if la == -lb:
        return scale(la, sub(ra, rb)) if la > 0.0 else scale(lb, sub(rb, ra))
    if lb < 0.0:
        return sub(scale(la, ra), scale(-lb, rb))
    if la < 0.0:
        return sub(scale(lb, rb), scale(-la, ra))
    return None


@rule("l1*e1 + l2*e2", "l1*(e1+e2) if l1 = l2; (l1+l2)*e1 if e1 = e2; signs", "add", ("neg", "mul"), ANY)
def _add_multiples(a: Expr, b: Expr) -> Expr | None:
    la, ra = coefficient(a)
    lb, rb = coefficient(b)
    if la == 1.0 and lb == 1.0 and ra is not rb:
        return None
    result = _combine(la, ra, lb, rb)
    return None if result is None or (result.op == "sub" and result.args == (a, b)) else result


def _double(a: Expr, b: Expr) -> Expr | None:
    return mul(num(2.0), a) if a is b else None


for _op in ANY[1:]:
    if _op not in SCALED:
        rule("e + e", "2*e", "add", _op, _op)(_double)


@rule("(e1 - e2) + e2", "e1", "add", "sub", ANY)
def _add_back(a: Expr, b: Expr) -> Expr | None:
    if a.op == "sub" and a.args[1] is b:
        return a.args[0]
    if b.op == "sub" and b.args[1] is a:
        return b.args[0]
    return None


@rule("e1/e3 + e2/e3", "(e1+e2)/e3", "add", "div", "div")
def _add_fractions(a: Expr, b: Expr) -> Expr | None:
    return div(add(a.args[0], b.args[0]), a.args[1]) if a.args[1] is b.args[1] else None


@rule("sin(e)*sin(e) + cos(e)*cos(e)", "1", "add", "mul", "mul")
def _add_squares(a: Expr, b: Expr) -> Expr | None:
    p, q = a.args[0], b.args[0]
    if p is a.args[1] and q is b.args[1] and {p.op, q.op} == {"sin", "cos"} and p.args[0] is q.args[0]:
        return ONE
    return None


# --- differences --------------------------------------------------------------------------------------------


@rule("l1 - l2", "l", "sub", "num", "num")
def _sub_literals(a: Expr, b: Expr) -> Expr | None:
    return finite(a.payload - b.payload)


@rule("0 - e", "-e", "sub", "num", ANY)
def _sub_from_zero(a: Expr, b: Expr) -> Expr | None:
    return neg(b) if a.payload == 0.0 else None


@rule("e - l", "(-l) + e", "sub", ANY, "num")
def _sub_literal(a: Expr, b: Expr) -> Expr | None:
    return add(num(-b.payload), a) if a.op != "num" else None


@rule("l1 - (l2 + e)", "(l1-l2) - e", "sub", "num", "add")
def _sub_sum_from_literal(a: Expr, b: Expr) -> Expr | None:
    first, rest = b.args
    total = finite(a.payload - first.payload) if first.op == "num" else None
    return None if total is None else sub(total, rest)


@rule("l1 - (l2 - e)", "(l1-l2) + e", "sub", "num", "sub")
def _sub_difference_from_literal(a: Expr, b: Expr) -> Expr | None:
    first, rest = b.args
    total = finite(a.payload - first.payload) if first.op == "num" else None
    return None if total is None else add(total, rest)


def _vanish(a: Expr, b: Expr) -> Expr | None:
    return ZERO if a is b else None


for _op in ANY[1:]:
    rule("e - e", "0", "sub", _op, _op)(_vanish)


def _sub_multiples(a: Expr, b: Expr) -> Expr | None:
    la, ra = coefficient(a)
    lb, rb = coefficient(b)
    if la == 1.0 and lb == 1.0:
        return None
    if ra is rb:
        total = la - lb
        return scale(total, ra) if math.isfinite(total) else None
    if la == lb:
        return scale(la, sub(ra, rb)) if la > 0.0 else scale(-la, sub(rb, ra))
    if la == -lb:
        return scale(la, add(ra, rb))
    if lb < 0.0:
        return add(a, scale(-lb, rb))
    if la < 0.0:
        return neg(add(scale(-la, ra), b))
    return None


for _left, _right in (
    (("neg", "mul"), ANY),
    (ANY[1:2] + tuple(o for o in ARITY if o not in SCALED), ("neg", "mul")),
):
    rule("l1*e1 - l2*e2", "l1*(e1-e2) if l1 = l2; (l1-l2)*e1 if e1 = e2; signs", "sub", _left, _right)(
        _sub_multiples
    )
rule("l1 - l2*e", "l1 + (-l2)*e if l2 < 0", "sub", "num", ("neg", "mul"))(
    lambda a, b: add(a, neg(b)) if coefficient(b)[0] < 0.0 else None
)


@rule("(e1 + e2) - e2", "e1", "sub", "add", ANY)
def _sub_back(a: Expr, b: Expr) -> Expr | None:
    p, q = a.args
    if q is b:
        return p
    return q if p is b else None


@rule("e1 - (e1 - e2)", "e2", "sub", ANY, "sub")
def _sub_rest(a: Expr, b: Expr) -> Expr | None:
    return b.args[1] if b.args[0] is a else None


@rule("e1/e3 - e2/e3", "(e1-e2)/e3", "sub", "div", "div")
def _sub_fractions(a: Expr, b: Expr) -> Expr | None:
    return div(sub(a.args[0], b.args[0]), a.args[1]) if a.args[1] is b.args[1] else None


# --- signs --------------------------------------------------------------------------------------------------


@rule("-l", "(-l)", "neg", "num")
def _neg_literal(a: Expr) -> Expr:
    return num(-a.payload)


@rule("--e", "e", "neg", "neg")
def _neg_neg(a: Expr) -> Expr:
    return a.args[0]


@rule("-(l*e)", "(-l)*e", "neg", "mul")
def _neg_multiple(a: Expr) -> Expr | None:
    first, rest = a.args
    return scale(-first.payload, rest) if first.op == "num" else None


@rule("-(e1 - e2)", "e2 - e1", "neg", "sub")
def _neg_difference(a: Expr) -> Expr:
    return sub(a.args[1], a.args[0])


@rule("-(l + e)", "(-l) - e", "neg", "add")
def _neg_sum(a: Expr) -> Expr | None:
    first, rest = a.args
    return sub(num(-first.payload), rest) if first.op == "num" else None


# --- products -----------------------------------------------------------------------------------------------


@rule("l1 * l2", "l", "mul", "num", "num")
def _mul_literals(a: Expr, b: Expr) -> Expr | None:
    return finite(a.payload * b.payload)


@rule("0*e, 1*e, (-1)*e", "0, e, -e", "mul", "num", ANY)
def _mul_unit(a: Expr, b: Expr) -> Expr | None:
    value = a.payload
    if value == 0.0:
        return ZERO if b.op != "num" else None
    if value == 1.0:
        return b
    return neg(b) if value == -1.0 else None


@rule("(l1*e1) * (l2*e2)", "(l1*l2) * (e1*e2)", "mul", ("neg", "mul"), ANY)
def _mul_multiples(a: Expr, b: Expr) -> Expr | None:
    la, ra = (a.payload, ONE) if a.op == "num" else coefficient(a)
    lb, rb = coefficient(b)
    if (la == 1.0 or a.op == "num") and lb == 1.0:
        return None
    product = la * lb
    return scale(product, mul(ra, rb)) if math.isfinite(product) and product != 0.0 else None


@rule("(e1/e2) * (e3/e4)", "(e1*e3) / (e2*e4)", "mul", "div", "div")
def _mul_fractions(a: Expr, b: Expr) -> Expr | None:
    return div(mul(a.args[0], b.args[0]), mul(a.args[1], b.args[1]))


@rule("(e1/e2) * e3", "(e1*e3) / e2", "mul", "div", ANY)
def _mul_fraction(a: Expr, b: Expr) -> Expr | None:
    if a.op != "div":
        a, b = b, a
    return div(mul(a.args[0], b), a.args[1])


# --- quotients ----------------------------------------------------------------------------------------------


@rule("l1 / l2", "l", "div", "num", "num")
def _div_literals(a: Expr, b: Expr) -> Expr | None:
    return finite(a.payload / b.payload) if b.payload != 0.0 else None


@rule("e / l", "(1/l) * e", "div", ANY, "num")
def _div_by_literal(a: Expr, b: Expr) -> Expr | None:
    # The reciprocal must be a normal number: 1/l costs half a unit in the last place, a subnormal one all
    # digits.
    value = abs(b.payload)
    return mul(num(1.0 / b.payload), a) if 1e-300 < value < 1e300 and a.op != "num" else None


@rule("0 / e", "0", "div", "num", ANY[1:])
def _div_zero(a: Expr, b: Expr) -> Expr | None:
    return ZERO if a.payload == 0.0 else None


@rule("e1 / (l*e2)", "((1/l)*e1) / e2", "div", ANY, ("neg", "mul"))
def _div_by_multiple(a: Expr, b: Expr) -> Expr | None:
    factor, rest = coefficient(b)
    if factor == 1.0 or not 1e-300 < abs(factor) < 1e300:
        return None
    return div(scale(1.0 / factor, a), rest)


@rule("(-e1) / e2", "-(e1/e2)", "div", "neg", ANY)
def _div_neg(a: Expr, b: Expr) -> Expr | None:
    return neg(div(a.args[0], b))


@rule("(e1/e2) / e3", "e1 / (e2*e3)", "div", "div", ANY)
def _div_fraction(a: Expr, b: Expr) -> Expr | None:
    return div(a.args[0], mul(a.args[1], b))


@rule("e1 / (e2/e3)", "(e1*e3) / e2", "div", ANY, "div")
def _div_by_fraction(a: Expr, b: Expr) -> Expr | None:
    return div(mul(a, b.args[1]), b.args[0])


# --- powers -------------------------------------------------------------------------------------------------


def _is_whole(value: float) -> bool:
    return math.isfinite(value) and value == math.floor(value)


@rule("l1 ^ l2", "l", "pow", "num", "num")
def _pow_literals(a: Expr, b: Expr) -> Expr | None:
    try:
        value = a.payload**b.payload
    except (OverflowError, ZeroDivisionError):
        return None
    return finite(value) if isinstance(value, float) else None


@rule("e^0, e^1, e^2, e^-1, e^0.5", "1, e, e*e, 1/e, sqrt(e)", "pow", ANY, "num")
def _pow_small(a: Expr, b: Expr) -> Expr | None:
    value = b.payload
    if value == 2.0:
        return mul(a, a)
    if value == 1.0:
        return a
    if value == 0.0:
        return ONE
    if value == -1.0:
        return div(ONE, a)
    return call("sqrt", a) if value == 0.5 else None


@rule("(l*e) ^ k", "l^k * e^k, k whole", "pow", ("neg", "mul"), "num")
def _pow_multiple(a: Expr, b: Expr) -> Expr | None:
    factor, rest = coefficient(a)
    if factor == 1.0 or not _is_whole(b.payload):
        return None
    try:
        power = factor**b.payload
    except OverflowError:
        return None
    return scale(power, pow_(rest, b)) if 1e-300 < abs(power) < 1e300 else None


@rule("(e^j) ^ k", "e^(j*k), j and k whole", "pow", "pow", "num")
def _pow_pow(a: Expr, b: Expr) -> Expr | None:
    base, inner = a.args
    if inner.op != "num" or not (_is_whole(inner.payload) and _is_whole(b.payload)):
        return None
    return pow_(base, num(inner.payload * b.payload))


# --- functions ----------------------------------------------------------------------------------------------

_FOLD: Final[dict[str, Callable[[float], float]]] = {
    name: getattr(math, name) for name in FUNCTIONS if name != "atan2"
}


def _folding(name: str) -> Rewrite:
    function = _FOLD[name]

    def fold(a: Expr) -> Expr | None:
        try:
            return finite(function(a.payload))
        except (ValueError, OverflowError):
            return None

    return fold


for _name in _FOLD:
    rule(f"{_name}(l)", "l", _name, "num")(_folding(_name))


@rule("atan2(l1, l2)", "l", "atan2", "num", "num")
def _fold_atan2(a: Expr, b: Expr) -> Expr | None:
    return finite(math.atan2(a.payload, b.payload))


def opposite(e: Expr) -> Expr | None:
    """``-e`` where ``e`` is negative in form: a negative multiple, or a difference in descending order."""
    if e.op == "sub":
        return sub(e.args[1], e.args[0]) if e.args[0].order > e.args[1].order else None
    return neg(e) if coefficient(e)[0] < 0.0 else None


def _odd(name: str) -> Rewrite:
    def flip(a: Expr) -> Expr | None:
        positive = opposite(a)
        return None if positive is None else neg(call(name, positive))

    return flip


def _even(name: str) -> Rewrite:
    def flip(a: Expr) -> Expr | None:
        positive = opposite(a)
        return None if positive is None else call(name, positive)

    return flip


for _name in ("sin", "tan", "asin", "atan", "sinh", "tanh"):
    rule(f"{_name}(-e)", f"-{_name}(e)", _name, ("neg", "mul", "sub"))(_odd(_name))
for _name in ("cos", "cosh"):
    rule(f"{_name}(-e)", f"{_name}(e)", _name, ("neg", "mul", "sub"))(_even(_name))


@rule("log(exp(e))", "e", "log", "exp")
def _log_exp(a: Expr) -> Expr:
    return a.args[0]
