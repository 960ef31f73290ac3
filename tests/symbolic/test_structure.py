from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from symbolic.random_expressions import NAMES, expressions, simplified

from stc.symbolic.differentiate import hessian, jacobian
from stc.symbolic.expr import Expr, call, num, raw, render, sym, symbols
from stc.symbolic.structure import (
    degree,
    degrees,
    is_linear,
    mentioning,
    mentions,
)

X, Y, C = sym("x"), sym("y"), sym("c")
KEYS = ["x", "y"]


@pytest.mark.parametrize(
    ("e", "expected"),
    [
        (num(3.0), 0),
        (C * C, 0),
        (call("sin", C), 0),
        (X, 1),
        (C * X + 3 - Y / C, 1),
        (-(X - Y), 1),
        (X * Y, 2),
        (X * X + Y, 2),
        ((C * X + Y) ** 2, 2),
        (raw("pow", X, num(2.0)), 2),
        (raw("pow", X, num(1.0)), 1),
        (X**3, 3),
        (X * Y * X, 3),
        (X / Y, 3),
        (1 / X, 3),
        (call("sin", X), 3),
        (X**0.5, 3),
        (X**C, 3),
        (C**X, 3),
        (raw("pow", X, num(1e300)), 3),
        (raw("pow", X, num(-1.0)), 3),
    ],
    ids=lambda value: render(value) if isinstance(value, Expr) else None,
)
def test_degree(e: Expr, expected: int) -> None:
    assert degree(e, KEYS) == expected
    assert is_linear(e, KEYS) == (expected <= 1)


def test_degree_is_in_the_named_symbols_only() -> None:
    assert degrees([X * Y, Y, X], ["x"]) == [1, 0, 1]


@settings(max_examples=200)
@given(expressions())
def test_degree_is_never_too_low(unsimplified: Expr) -> None:
    e = simplified(unsimplified)
    bound = degree(e, NAMES)
    second = hessian(e, NAMES)
    if bound <= 1:
        assert second == {}
    if bound <= 2:
        assert not any(symbols(entry) for entry in second.values())
    if bound == 0:
        assert jacobian([e], NAMES) == {}


@given(expressions())
def test_mentioned_symbols_are_those_that_occur(e: Expr) -> None:
    occurring = set(symbols(e))
    assert {name for name in NAMES if mentions(e, lambda key, name=name: key == name)} == occurring & set(
        NAMES
    )
    assert mentions(e, lambda _: True) == bool(occurring)


@given(st.lists(expressions(), min_size=1, max_size=4))
def test_mentions_of_many_expressions_are_those_of_each(exprs: list[Expr]) -> None:
    for name in NAMES:
        wanted = name.__eq__
        assert mentioning(exprs, wanted) == [mentions(e, wanted) for e in exprs]
