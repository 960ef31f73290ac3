"""Rules for sums, differences and signs."""

from __future__ import annotations

import math
from typing import Final

from stc.symbolic.node import ARITY, LOOK, ONE, ZERO, Expr, add, div, finite, mul, neg, num, sub
from stc.symbolic.rules.table import ANY, SCALED, coefficient, rule, scale


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


@rule("e1/e3 + e2/e3", "(e1+e2)/e3", "add", "div", "div")
def _add_fractions(a: Expr, b: Expr) -> Expr | None:
    return div(add(a.args[0], b.args[0]), a.args[1]) if a.args[1] is b.args[1] else None


@rule("sin(e)*sin(e) + cos(e)*cos(e)", "1", "add", "mul", "mul")
def _add_squares(a: Expr, b: Expr) -> Expr | None:
    p, q = a.args[0], b.args[0]
    if p is a.args[1] and q is b.args[1] and {p.op, q.op} == {"sin", "cos"} and p.args[0] is q.args[0]:
        return ONE
    return None


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
    (ANY[1:2] + tuple(o for o in (*ARITY, LOOK) if o not in SCALED), ("neg", "mul")),
):
    rule("l1*e1 - l2*e2", "l1*(e1-e2) if l1 = l2; (l1-l2)*e1 if e1 = e2; signs", "sub", _left, _right)(
        _sub_multiples
    )
rule("l1 - l2*e", "l1 + (-l2)*e if l2 < 0", "sub", "num", ("neg", "mul"))(
    lambda a, b: add(a, neg(b)) if coefficient(b)[0] < 0.0 else None
)


@rule("e1/e3 - e2/e3", "(e1-e2)/e3", "sub", "div", "div")
def _sub_fractions(a: Expr, b: Expr) -> Expr | None:
    return div(sub(a.args[0], b.args[0]), a.args[1]) if a.args[1] is b.args[1] else None


# Names that cancel only after sums of sums are written out ((z + a + b) - (z + a)) would stay in the expression, and
# with them entries of Jacobian and Hessian that are zero everywhere.  So sums are compared term by term, as far
# down as a fixed number of additions, which bounds the cost of building long sums.
_LOOK_THROUGH: Final = 16
_SUMS: Final = ("add", "sub")


def _terms(e: Expr, sign: float) -> list[tuple[float, Expr]]:
    """The summands of ``sign*e`` with their literal factors."""
    budget = _LOOK_THROUGH
    found: list[tuple[float, Expr]] = []
    stack = [(e, sign)]
    while stack:
        node, factor = stack.pop()
        op = node.op
        if budget and op in _SUMS:
            budget -= 1
            first, second = node.args
            stack.append((second, factor if op == "add" else -factor))
            stack.append((first, factor))
        else:
            own, rest = coefficient(node)
            found.append((factor * own, rest))
    return found


def _cancel(a: Expr, b: Expr, sign: float) -> Expr | None:
    """``a + sign*b`` without the summands that cancel; None if none cancel."""
    terms = _terms(a, 1.0) + _terms(b, sign)
    if len({rest for _, rest in terms}) == len(terms):
        return None
    totals: dict[Expr, float] = {}
    for factor, rest in terms:
        totals[rest] = totals.get(rest, 0.0) + factor
    if all(totals.values()) or not all(math.isfinite(rest.fingerprint) for rest in totals):
        return None  # nothing cancels, or inf - inf would
    # The innermost summands first: what is left shares its beginning with the sums that it came from.
    left = [(factor, rest) for rest, factor in reversed(totals.items()) if factor != 0.0]
    result = ZERO
    for factor, rest in left:
        result = add(result, scale(factor, rest)) if factor > 0.0 else sub(result, scale(-factor, rest))
    return result


@rule("(e1 + e2 - e3) + e3", "e1 + e2", "add", ("add", "sub"), ANY)
def _cancel_in_sum(a: Expr, b: Expr) -> Expr | None:
    return _cancel(a, b, 1.0)


def _cancel_in_difference(a: Expr, b: Expr) -> Expr | None:
    return _cancel(a, b, -1.0)


rule("(e1 + e2 + e3) - e3", "e1 + e2", "sub", ("add", "sub"), ANY)(_cancel_in_difference)
rule("e1 - (e1 - e2)", "e2", "sub", tuple(op for op in ANY if op not in _SUMS), ("add", "sub"))(
    _cancel_in_difference
)


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
