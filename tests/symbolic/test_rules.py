"""Every line of the rule table, on every pair of operands from a pool: values must not change."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from stc.symbolic.expr import (
    RULES,
    ZERO,
    Expr,
    add,
    call,
    div,
    evaluate,
    looked_up,
    mul,
    neg,
    num,
    pow_,
    raw,
    render,
    sub,
    sym,
)
from stc.symbolic.rules import Rule
from stc.symbolic.tables import TableRef, interpolated
from stc.symbolic.traverse import NUMPY_MEANING

X, Y, Z = sym("x"), sym("y"), sym("z")
POINTS = {key: np.random.default_rng(7).uniform(0.1, 0.9, 12) for key in "xyz"}


def _pool() -> list[Expr]:
    """Simplified expressions with every operator on top, few enough leaves that operands often coincide."""
    leaves = [num(-2.0), num(-1.0), ZERO, num(0.5), num(1.0), num(2.0), num(3.0), X, Y]
    small = [
        neg(X),
        2.0 * X,
        -3.0 * X,
        2.0 * Y,
        -2.0 * Y,
        X * Y,
        2.0 * (X * Y),
        X + 1.0,
        3.0 - X,
        X + Y,
        X - Y,
    ]
    small += [Y - X, X / Y, Y / X, X / Z, Y / Z, X**3.0, X**-0.71, X**Y, call("exp", X), call("log", X)]
    small += [call(name, X) for name in ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh")]
    small += [call("sqrt", X), call("atan2", X, Y)]
    curve = interpolated([np.array([0.0, 0.3, 1.0])], np.array([1.0, -0.5, 2.0]), "cubic", "hold")
    small.append(looked_up(TableRef("T", curve, (0,)), X))
    squares = [call("sin", X) ** 2.0, call("cos", X) ** 2.0]
    wide = [(X + Y) + X * Y, (X + Y) - X * Y, X - (X * Y), neg(X * Y), neg(X / Y), call("exp", Y) + (X + Y)]
    return [*leaves, *small, *squares, *wide]


POOL = _pool()
VALUES = {e: np.broadcast_to(np.asarray(evaluate(e, POINTS), dtype=float), (12,)) for e in POOL}
OPERANDS: dict[int, list[tuple[Expr, ...]]] = {
    arity: list(itertools.product(POOL, repeat=arity)) for arity in (1, 2)
}


def _instances(rule: Rule) -> list[tuple[Expr, ...]]:
    found = []
    for operands in OPERANDS[len(rule.heads)]:
        ops = tuple(e.op for e in operands)
        if rule.op in ("add", "mul"):
            if operands[0].order > operands[1].order:
                continue
            if not any(
                all(o in h for o, h in zip(turned, rule.heads, strict=True)) for turned in (ops, ops[::-1])
            ):
                continue
        elif not all(o in h for o, h in zip(ops, rule.heads, strict=True)):
            continue
        found.append(operands)
    return found


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: f"{rule.op}: {rule.pattern} => {rule.result}")
def test_rule_keeps_values(rule: Rule) -> None:
    fired = 0
    for operands in _instances(rule):
        result = rule.action(*operands)
        if result is None:
            continue
        fired += 1
        with np.errstate(all="ignore"):
            expected = np.broadcast_to(NUMPY_MEANING[rule.op](*[VALUES[e] for e in operands]), (12,))
        actual = np.broadcast_to(np.asarray(evaluate(result, POINTS), dtype=float), (12,))
        told = np.isfinite(expected)
        np.testing.assert_allclose(
            actual[told], expected[told], rtol=1e-12, atol=1e-13, err_msg=f"{[render(e) for e in operands]}"
        )
    assert fired, "no pair of the pool makes this rule apply"


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (lambda: ZERO + X, "x"),
        (lambda: ZERO * call("log", X), "0"),
        (lambda: num(1.0) * X, "x"),
        (lambda: 3.0 * X + 3.0 * Y, "3*(x + y)"),
        (lambda: 3.0 * X + 2.0 * X, "5*x"),
        (lambda: ZERO - 3.0 * X, "-3*x"),
        (lambda: (2.0 * X) * (3.0 * Y), "6*x*y"),
        (lambda: (X / Y) * Z, "x*z/y"),
        (lambda: X**2.0, "x^2"),
        (lambda: X / 4.0, "0.25*x"),
        (lambda: X - X, "0"),
        (lambda: X + X, "2*x"),
        (lambda: neg(neg(X)), "x"),
        (lambda: X * neg(Y), "-x*y"),
        (lambda: X + neg(Y), "x - y"),
        (lambda: X**0.5, "sqrt(x)"),
        (lambda: X**-1.0, "1/x"),
        (lambda: (2.0 * X) ** 3.0, "8*x^3"),
        (lambda: call("sin", neg(X)), "-sin(x)"),
        (lambda: call("cos", Y - X) - call("cos", X - Y), "0"),
        (lambda: call("sin", X) ** 2.0 + call("cos", X) ** 2.0, "1"),
        (lambda: X / Y + Z / Y, "(x + z)/y"),
        (lambda: (X / Y) / Z, "x/(y*z)"),
        (lambda: X / (Y / Z), "x*z/y"),
        (lambda: num(2.0) + (X + 3.0), "x + 5"),
        (lambda: (X + Y) - Y, "x"),
    ],
)
def test_the_report_s_transformations(before: object, after: str) -> None:
    assert callable(before)
    assert render(before()) == after


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        (lambda: div(num(1.0), ZERO), np.inf),
        (lambda: div(ZERO, ZERO), np.nan),
        (lambda: call("log", ZERO), -np.inf),
        (lambda: call("log", num(-1.0)), np.nan),
        (lambda: call("sqrt", num(-1.0)), np.nan),
        (lambda: call("exp", num(1e4)), np.inf),
        (lambda: pow_(num(-8.0), num(1.0 / 3.0)), np.nan),
        (lambda: pow_(ZERO, num(-1.0)), np.inf),
        (lambda: mul(num(1e200), num(1e200)), np.inf),
        (lambda: mul(ZERO, num(np.inf)), np.nan),
        (lambda: sub(num(np.inf), num(np.inf)), np.nan),
        (lambda: mul(ZERO, call("log", num(-1.0))), 0.0),
    ],
)
def test_undefined_literals_are_not_folded(expression: object, value: float) -> None:
    assert callable(expression)
    e = expression()
    assert e is ZERO or e.op != "num"
    np.testing.assert_equal(evaluate(e, {}), value)


@pytest.mark.parametrize(
    "e", [X / X, call("sqrt", X) ** 2.0, call("sqrt", X * X), call("exp", call("log", X))]
)
def test_nothing_is_cancelled_that_restricts_the_domain(e: Expr) -> None:
    assert e not in (X, num(1.0))
    bad = evaluate(e, {"x": 0.0}) if e is X / X else evaluate(e, {"x": -1.0})
    assert np.isnan(bad) or e is call("sqrt", X * X)


def test_operands_of_commutative_operators_are_ordered_by_structure() -> None:
    assert add(X, Y) is add(Y, X)
    assert mul(X, call("sin", Y)) is mul(call("sin", Y), X)
    assert raw("add", X, Y) in (add(X, Y), raw("add", X, Y))
