"""Rules for products, quotients and powers."""

from __future__ import annotations

import math

from stc.symbolic.node import ONE, ZERO, Expr, call, div, finite, mul, neg, num, pow_
from stc.symbolic.rules.table import ANY, coefficient, rule, scale


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


@rule("e1 * (e1*e2)", "(e1*e1) * e2", "mul", ANY[1:], "mul")
def _mul_square(a: Expr, b: Expr) -> Expr | None:
    if b.op != "mul":
        a, b = b, a
    first, second = b.args
    if a is first:
        return mul(mul(a, a), second) if second is not a else None
    return mul(mul(a, a), first) if a is second else None


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
