"""Fingerprints tell equal expressions from different ones; sums that are zero everywhere vanish by them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from symbolic.random_expressions import expressions, points, simplified

from stc.symbolic.expr import FUNCTIONS, ZERO, Expr, call, evaluate, evaluate_all, num, raw, render, sub, sym
from stc.symbolic.fingerprint import PRIME, of_literal

X, Y, Z = sym("x"), sym("y"), sym("z")


def function(name: str) -> Expr:
    return call(name, X)


@pytest.mark.parametrize(
    ("e", "f"),
    [
        ((X + Y) * (X - Y), X * X - Y * Y),
        ((X * Y) * Z, (Z * X) * Y),
        ((X + Y) ** 3, X**3 + 3 * X * X * Y + 3 * X * Y * Y + Y**3),
        (X * (Y + Z), X * Y + X * Z),
        (raw("pow", X, num(3.0)), X * X * X),
        (function("sin") ** 2, 1 - function("cos") ** 2),
        (function("cosh") ** 2, 1 + function("sinh") ** 2),
        (function("cosh") + function("sinh"), function("exp")),
        (function("tan"), function("sin") / function("cos")),
        (raw("sin", raw("neg", X)), raw("neg", raw("sin", X))),
        (raw("cos", X - Y), raw("cos", Y - X)),
        ((X / Y) * Z, X * Z / Y),
        (call("sin", X * (Y + Z)), call("sin", X * Y + X * Z)),
        (raw("div", X, raw("neg", Y)), raw("neg", raw("div", X, Y))),
        (num(0.5) + num(0.25), num(0.75)),
    ],
    ids=lambda e: render(e),
)
def test_equal_expressions_have_equal_fingerprints(e: Expr, f: Expr) -> None:
    at = {"x": 0.7, "y": -1.3, "z": 0.4}
    assert evaluate(e, at) == pytest.approx(evaluate(f, at), rel=1e-12)
    assert e.fingerprint == f.fingerprint
    assert sub(e, f) is ZERO
    assert e - f * 2.0 is not ZERO


@pytest.mark.parametrize(
    ("e", "f"),
    [
        (X / X, num(1.0)),
        (X * X / X, X),
        (call("sqrt", X) * call("sqrt", X), X),
        (call("sqrt", X * X), X),
        (call("exp", call("log", X)), X),
        (call("log", X * Y), call("log", X) + call("log", Y)),
        (num(0.1) * X + num(0.2) * X, num(0.3) * X),
        (call("sin", X), call("cos", X)),
        (call("asin", X), call("acos", X)),
        (call("atan2", X, Y), call("atan2", Y, X)),
        (X**Y, Y**X),
        (raw("pow", X, num(0.5)), raw("pow", X, num(1.5))),
        (1 / (X * Y), 1 / (X + Y)),
        (sym("x"), sym(("x",))),
        (num(float(PRIME % 1000003)), num(float(PRIME % 1000003 + 1))),
    ],
    ids=lambda e: render(e),
)
def test_what_differs_somewhere_has_another_fingerprint(e: Expr, f: Expr) -> None:
    assert e.fingerprint != f.fingerprint
    assert sub(e, f) is not ZERO


A, B = sym("a"), sym("b")

SHIFTED = [
    (call("atan2", Y, num(31.0)), call("atan2", Y + 1.0, num(0.0))),
    (call("atan2", Y, X), call("atan2", Y + 1.0, X - 31.0)),
    (X**Y, (X + 1.0) ** (Y - 31.0)),
    (X**Y, (X - 1.0) ** (Y + 31.0)),
    (num(2.0**61) * X, X),
    (num(2.0**-61) * X, X),
    (num(2.0**122), num(1.0)),
]


@pytest.mark.parametrize(("e", "f"), SHIFTED, ids=lambda e: render(e))
def test_operands_that_make_up_for_each_other_are_told_apart(e: Expr, f: Expr) -> None:
    at = {"x": 0.7, "y": 1.3}
    assert evaluate(e, at) != pytest.approx(evaluate(f, at))
    assert e.fingerprint != f.fingerprint
    assert e - f is not ZERO


OPAQUE = {
    "reciprocal": lambda e: 1 / e,
    "root": lambda e: e**0.5,
    "power": lambda e: e**Z,
    "exponent": lambda e: Z**e,
    "atan2, first": lambda e: call("atan2", e, Z),
    "atan2, second": lambda e: call("atan2", Z, e),
    **{name: (lambda e, name=name: call(name, e)) for name, k in FUNCTIONS.items() if k == 1},
}


@pytest.mark.parametrize("name", OPAQUE)
def test_differences_of_functions_depend_on_where_they_are_taken(name: str) -> None:
    """f(a + d) - f(a) is another one at b, for no function but a straight line: so for the fingerprints."""
    f = OPAQUE[name]
    for number in range(60):
        a, b = sym(("a", number)), sym(("b", number))
        for step in (1.0, 31.0, 0.5, Z):
            one, other = f(a + step) - f(a), f(b + step) - f(b)
            assert one.fingerprint != other.fingerprint
            assert one - other is not ZERO


@settings(max_examples=400)
@given(
    st.sampled_from(sorted(OPAQUE)),
    st.tuples(*[st.sampled_from([-31.0, -2.0, -1.0, 0.0, 0.5, 1.0, 2.0, 31.0, 2.0**61])] * 4),
    st.tuples(*[st.sampled_from([A, B, X, Y, A + B, A - X, 2 * Y])] * 4),
    st.tuples(*[st.sampled_from([-31.0, -1.0, 1.0, 2.0, 31.0])] * 4),
)
def test_sums_of_a_function_at_shifted_arguments_vanish_only_where_they_are_zero(
    name: str, shifts: tuple[float, ...], arguments: tuple[Expr, ...], factors: tuple[float, ...]
) -> None:
    """Sums of ``c*f(u + d)`` with equal fingerprints agree in value: evaluated by NumPy, which knows no fingerprint."""
    f = OPAQUE[name]
    terms = [num(c) * f(u + d) for c, u, d in zip(factors, arguments, shifts, strict=True)]
    e, g = terms[0] + terms[1], terms[2] + terms[3]
    if e.fingerprint == g.fingerprint:
        at = {**points(), "x": points(5)["a"], "y": points(5)["b"], "z": np.full(16, 1.7)}
        with np.errstate(all="ignore"):
            a, b = (np.broadcast_to(v, (16,)) for v in evaluate_all([e, g], at))
        both = np.isfinite(a) & np.isfinite(b)
        np.testing.assert_allclose(a[both], b[both], rtol=1e-6, atol=1e-6)


def test_powers_of_infinite_and_undefined_literals_tell_nothing() -> None:
    for exponent in (np.inf, -np.inf, np.nan):
        e = raw("pow", X, num(exponent))
        assert np.isnan(e.fingerprint)
        assert e - 2.0 * e is not ZERO


def test_infinite_and_undefined_literals_never_vanish() -> None:
    infinity, nothing = num(np.inf), num(np.nan)
    for e in (
        infinity - infinity,
        (infinity + X) - (infinity + X * 1.0 + Y),
        nothing - nothing,
        infinity * 0.0,
    ):
        assert e is not ZERO
        assert np.isnan(evaluate(e, {"x": 1.0, "y": 2.0}))


def test_fingerprints_of_literals_are_exact() -> None:
    assert of_literal(0.0) == 0
    assert of_literal(3.0) == 3
    assert of_literal(-1.0) == PRIME - 1
    assert of_literal(0.75) * 4 % PRIME == 3
    assert of_literal(1e300) != of_literal(np.nextafter(1e300, 2e300))


@settings(max_examples=300)
@given(expressions())
def test_simplifying_keeps_fingerprints_that_tell(unsimplified: Expr) -> None:
    e = simplified(unsimplified)
    if e.fingerprint == 0:
        assert e is ZERO


@settings(max_examples=300)
@given(expressions(), expressions())
def test_equal_fingerprints_mean_equal_values(first: Expr, second: Expr) -> None:
    e, f = simplified(first), simplified(second)
    if e.fingerprint == f.fingerprint and e is not f:
        a, b = (np.broadcast_to(v, (16,)) for v in evaluate_all([e, f], points()))
        both = np.isfinite(a) & np.isfinite(b) & (np.abs(a) < 1e6)
        np.testing.assert_allclose(a[both], b[both], rtol=1e-6, atol=1e-6)


def test_sums_that_cancel_beyond_the_rules_vanish() -> None:
    sine, cosine = function("sin"), function("cos")
    assert (Y * sine) * cosine - sine * (cosine * Y) is ZERO
    a = (Z + X) * (Y + 1.0)
    assert a - (Z * Y + Z) - (X * Y + X) is ZERO
