from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from symbolic.random_expressions import NAMES, SMOOTH, expressions, points, simplified

from stc.symbolic.differentiate import (
    BY_ARGUMENT,
    derivative,
    gradient,
    hessian,
    jacobian,
    total_derivative,
)
from stc.symbolic.expr import (
    ARITY,
    OF_TABLES,
    ONE,
    ZERO,
    Expr,
    call,
    evaluate,
    num,
    raw,
    reachable,
    render,
    sym,
)
from stc.symbolic.slopes import Sweep

X, Y, Z = sym("x"), sym("y"), sym("z")
COMPLEX_STEP = 1e-40


def complex_step(e: Expr, at: dict[str, float], key: str) -> float:
    """The derivative of an analytic expression, exact to rounding (Squire & Trapp, SIAM Review 40, 1998)."""
    values = {k: complex(v, COMPLEX_STEP if k == key else 0.0) for k, v in at.items()}
    return complex(evaluate(e, values)).imag / COMPLEX_STEP


def test_every_operator_has_an_entry_per_operand() -> None:
    assert {op: len(entries) for op, entries in BY_ARGUMENT.items()} == {**ARITY, **OF_TABLES}


@pytest.mark.parametrize("op", [op for op in ARITY if op != "atan2"])
def test_derivative_table_by_complex_steps(op: str) -> None:
    random = np.random.default_rng(11)
    operands = [sym("x"), sym("y")][: ARITY[op]]
    e = raw(op, *operands)
    for _ in range(20):
        at = {"x": float(random.uniform(0.1, 0.9)), "y": float(random.uniform(0.1, 0.9))}
        for key in ("x", "y")[: ARITY[op]]:
            exact = pytest.approx(complex_step(e, at, key), rel=1e-13)
            assert evaluate(derivative(e, key), at) == exact
            assert Sweep([e], at).slopes(0, {key})[key] == exact


@pytest.mark.parametrize("quadrant", [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)])
def test_derivative_of_atan2_in_every_quadrant(quadrant: tuple[float, float]) -> None:
    y, x = 0.4 * quadrant[0], 0.7 * quadrant[1]
    e = call("atan2", Y, X)
    for key, step in (("x", (0.0, 1e-6)), ("y", (1e-6, 0.0))):
        difference = math.atan2(y + step[0], x + step[1]) - math.atan2(y - step[0], x - step[1])
        assert evaluate(derivative(e, key), {"x": x, "y": y}) == pytest.approx(difference / 2e-6, rel=1e-8)


@pytest.mark.parametrize(
    ("e", "text"),
    [
        (X**2, "2*x"),
        (X**1, "1"),
        (X**3, "3*x^2"),
        (X**-1, "-1/x^2"),
        (X**-0.71, "-0.71*x^-1.71"),
        (raw("pow", X, num(1.0)), "1"),
        (raw("pow", X, num(2.0)), "2*x"),
        (X**Y, "y*x^(y - 1)"),
        (num(2.0) ** X, "0.6931471805599453*2^x"),
        (call("exp", 3 * X), "3*exp(3*x)"),
        (call("sqrt", X), "0.5/sqrt(x)"),
        (X * Y + X * X, "2*x + y"),
        (X / Y, "1/y"),
        (num(7.0), "0"),
        (Y, "0"),
    ],
    ids=lambda value: render(value) if isinstance(value, Expr) else None,
)
def test_derivatives_are_simple(e: Expr, text: str) -> None:
    assert render(derivative(e, "x")) == text


def test_the_report_s_example() -> None:
    # d/dt (l*m + t^2/y - cos(t + m)); the report prints t/y where it means 2t/y.
    t, m = sym("t"), sym("m")
    e = sym("l") * m + t**2 / Y - call("cos", t + m)
    assert render(derivative(e, "t")) == "sin(m + t) + 2*t/y"


@pytest.mark.parametrize("exponent", [1.0, 2.0, 3.0, 4.0, 7.0])
def test_whole_powers_are_differentiable_at_zero(exponent: float) -> None:
    for e in (raw("pow", X, num(exponent)), X**exponent):
        slope = derivative(e, "x")
        assert evaluate(slope, {"x": 0.0}) == (1.0 if exponent == 1.0 else 0.0)
        assert evaluate(derivative(slope, "x"), {"x": 0.0}) == (2.0 if exponent == 2.0 else 0.0)


def test_powers_with_a_symbolic_exponent_are_differentiable_at_zero() -> None:
    slope = derivative(X**Y, "x")
    assert evaluate(slope, {"x": 0.0, "y": 2.0}) == 0.0
    assert evaluate(slope, {"x": 0.0, "y": 1.0}) == 1.0


@settings(max_examples=200)
@given(expressions(SMOOTH))
def test_gradient_matches_complex_steps(unsimplified: Expr) -> None:
    e = simplified(unsimplified)
    columns = points(count=4)
    for k in range(4):
        at = {key: float(v[k]) for key, v in columns.items()}
        for key, slope in zip(NAMES, gradient(e, NAMES), strict=True):
            expected = complex_step(e, at, key)
            if math.isfinite(expected) and abs(expected) < 1e8:
                assert evaluate(slope, at) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@settings(max_examples=100)
@given(expressions(SMOOTH, leaves=8))
def test_hessian_matches_complex_steps_of_the_gradient(unsimplified: Expr) -> None:
    e = simplified(unsimplified)
    at = {key: float(v[0]) for key, v in points(seed=5).items()}
    slopes = gradient(e, NAMES)
    entries = hessian(e, NAMES)
    assert list(entries) == sorted(entries)
    for i, slope in enumerate(slopes):
        for j, key in enumerate(NAMES):
            expected = complex_step(slope, at, key)
            entry = entries.get((max(i, j), min(i, j)), ZERO)
            assert entry is not ZERO or (i, j) not in entries
            if math.isfinite(expected) and abs(expected) < 1e8:
                assert evaluate(entry, at) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@settings(max_examples=100)
@given(expressions())
def test_gradient_and_single_derivatives_agree(unsimplified: Expr) -> None:
    e = simplified(unsimplified)
    at = points(count=3)
    for key, slope in zip(NAMES, gradient(e, NAMES), strict=True):
        ours, alone = (np.broadcast_to(evaluate(d, at), (3,)) for d in (slope, derivative(e, key)))
        both = np.isfinite(ours) & np.isfinite(alone) & (np.abs(ours) < 1e6)
        np.testing.assert_allclose(ours[both], alone[both], rtol=1e-6, atol=1e-6)


def test_jacobian_holds_nonzeros_only_in_order() -> None:
    rows = [X * Y, Z, num(3.0), call("sin", X) + Z * Z]
    entries = jacobian(rows, ["z", "x", "y"])
    assert {key: render(e) for key, e in entries.items()} == {
        (0, 1): "y",
        (0, 2): "x",
        (1, 0): "1",
        (3, 0): "2*z",
        (3, 1): "cos(x)",
    }
    assert list(entries) == sorted(entries)
    assert jacobian(rows, []) == {}


def test_hessian_of_linear_and_quadratic_forms() -> None:
    assert hessian(3 * X - Y, ["x", "y"]) == {}
    assert hessian(X * Y + 2 * X * X, ["x", "y"]) == {(0, 0): num(4.0), (1, 0): ONE}
    assert hessian(X * Y * Z, ["x", "y", "z"]) == {(1, 0): Z, (2, 0): Y, (2, 1): X}


def _nested(count: int) -> tuple[list[Expr], list[str]]:
    """Rows that are built from one another: tangents are shared by columns."""
    keys = [f"q{k}" for k in range(count)]
    rows = [sym(keys[0]) * 2.0]
    for key in keys[1:]:
        rows.append(rows[-1] * call("sin", sym(key)) + call("cos", sym(key) * rows[-1]))
    return rows, keys


@pytest.mark.parametrize(
    ("rows", "keys"),
    [
        _nested(6),
        ([X * Y, Y / Z, X**Y, num(1.0), X], ["x", "y", "z"]),
        ([sum((sym(f"v{k}") ** 2.0 for k in range(300)), ZERO)], [f"v{k}" for k in range(300)]),
        ([sym("p") * float(k + 2) + call("sin", sym("p") * float(k + 2)) for k in range(40)], ["p", "q"]),
    ],
    ids=["nested rows", "mixed", "one long row", "one long column"],
)
def test_jacobian_and_hessian_agree_with_gradients(rows: list[Expr], keys: list[str]) -> None:
    random = np.random.default_rng(2)
    at = {key: float(random.uniform(0.3, 1.3)) for key in keys}
    total = sum((row * float(k + 1) for k, row in enumerate(rows)), ZERO)
    first, second = jacobian(rows, keys), hessian(total, keys)
    assert list(first) == sorted(first)
    assert list(second) == sorted(second)
    for row, e in enumerate(rows):
        for col, slope in enumerate(gradient(e, keys)):
            assert (slope is ZERO) == ((row, col) not in first)
            if slope is not ZERO:
                assert evaluate(first[row, col], at) == pytest.approx(evaluate(slope, at), rel=1e-12)
    for i, slope in enumerate(gradient(total, keys)):
        for j, curvature in enumerate(gradient(slope, keys[: i + 1])):
            assert (curvature is ZERO) == ((i, j) not in second)
            if curvature is not ZERO:
                assert evaluate(second[i, j], at) == pytest.approx(evaluate(curvature, at), rel=1e-11)


def test_entries_that_vanish_everywhere_are_left_out() -> None:
    # The moment about the sole, of a body that hangs on it by two links, does not depend on the sole's height.
    z, a, b = sym("z"), sym("a"), sym("b")
    joint = z + 0.3 * call("cos", a)
    end = joint + 0.4 * call("cos", a + b)
    moment = (end - z) * call("sin", b) - (joint - z) * call("sin", a)
    assert set(jacobian([moment], ["z", "a", "b"])) == {(0, 1), (0, 2)}
    assert set(hessian(moment, ["z", "a", "b"])) == {(1, 1), (2, 1), (2, 2)}


def test_total_derivative_follows_the_motion() -> None:
    rate = {"x": sym("x'"), "y": sym("y'"), "z": ZERO}.__getitem__
    assert render(total_derivative(sym("z") * call("sin", X), rate)) == "x'*z*cos(x)"
    assert total_derivative(sym("z") * 3.0, rate) is ZERO
    assert render(total_derivative(X * Y, rate)) in ("y*x' + x*y'", "x*y' + y*x'", "x'*y + x*y'")


def test_derivatives_share_with_the_function() -> None:
    e = call("sin", X * Y) * call("exp", X * Y)
    outputs = [e, *gradient(e, ["x", "y"]), *hessian(e, ["x", "y"]).values()]
    functions = [node for node in reachable(outputs) if node.op in ("sin", "cos", "exp")]
    assert len(functions) == 3
