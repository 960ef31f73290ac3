"""Tables in expressions: derivatives, simplification, text, and that two tables are never taken for one."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stc.symbolic.differentiate import derivative, hessian, jacobian, total_derivative
from stc.symbolic.expr import (
    ZERO,
    Expr,
    add,
    call,
    evaluate,
    looked_up,
    mul,
    num,
    render,
    sub,
    substitute,
    sym,
    tables,
)
from stc.symbolic.slopes import Sweep
from stc.symbolic.structure import degree
from stc.symbolic.tables import TableRef, interpolated

X, Y = sym("x"), sym("y")
AT = np.array([-1.0, -0.2, 0.1, 0.9, 2.0])


def curve(name: str = "T", kind: str = "cubic", scale: float = 1.0) -> TableRef:
    return TableRef(name, interpolated([AT], scale * np.cos(2.0 * AT), kind, "extend"), (0,))


def surface() -> TableRef:
    values = np.sin(AT)[:, None] * np.exp(AT[:4])
    return TableRef("H", interpolated([AT, AT[:4]], values, "cubic", "extend"), (0, 0))


def mixed() -> Expr:
    """Tables of what is made of others, in products and sums."""
    inner = looked_up(curve(), mul(X, Y))
    return add(mul(inner, looked_up(surface(), call("sin", X), inner)), looked_up(surface(), Y, Y))


def difference(e: Expr, key: str, values: dict[str, float], step: float = 1e-6) -> float:
    ahead, behind = ({**values, key: values[key] + side * step} for side in (1.0, -1.0))
    return float((evaluate(e, ahead) - evaluate(e, behind)) / (2.0 * step))


@given(st.floats(-1.5, 2.5), st.floats(-1.5, 2.5))
def test_first_and_second_derivatives(x: float, y: float) -> None:
    e, values = mixed(), {"x": x, "y": y}
    slopes = jacobian([e], ["x", "y"])
    for k, key in enumerate("xy"):
        assert evaluate(slopes[0, k], values) == pytest.approx(difference(e, key, values), rel=1e-5, abs=1e-5)
    for (i, j), curvature in hessian(e, ["x", "y"]).items():
        of_slope = difference(slopes[0, i], "xy"[j], values)
        assert evaluate(curvature, values) == pytest.approx(of_slope, rel=1e-4, abs=1e-4)


def test_slopes_in_numbers_are_those_of_expressions() -> None:
    values = {"x": np.linspace(-1.0, 2.0, 9), "y": np.linspace(1.7, -0.5, 9)}
    sweep = Sweep([mixed()], values)
    np.testing.assert_allclose(sweep.values[0], evaluate(mixed(), values))
    for key, slope in sweep.slopes(0, {"x", "y"}).items():
        np.testing.assert_allclose(slope, evaluate(derivative(mixed(), str(key)), values), rtol=1e-12)


def test_rate_along_a_motion() -> None:
    rate = total_derivative(looked_up(surface(), X, Y), lambda key: {"x": num(2.0), "y": X}[key])
    values = {"x": 0.3, "y": -0.4}
    slopes = [difference(looked_up(surface(), X, Y), key, values) for key in "xy"]
    assert evaluate(rate, values) == pytest.approx(2.0 * slopes[0] + 0.3 * slopes[1], rel=1e-6)


def test_what_is_the_same_is_found_so() -> None:
    one = looked_up(curve(), X)
    assert one is looked_up(curve(), X)
    assert sub(one, looked_up(curve(), X)) is ZERO
    assert sub(mul(add(one, Y), add(one, num(-1.0) * Y)), sub(mul(one, one), mul(Y, Y))) is ZERO
    for other in (curve("U"), curve().derivative(0)):
        assert other is not None
        assert sub(one, looked_up(other, X)) is not ZERO
    assert sub(one, looked_up(curve(), Y)) is not ZERO
    assert sub(looked_up(surface(), X, Y), looked_up(surface(), Y, X)) is not ZERO
    assert substitute(one, {"x": Y}) is looked_up(curve(), Y)


def test_the_same_name_with_other_numbers_is_another_table() -> None:
    one, other = looked_up(curve(), X), looked_up(curve(scale=2.0), X)
    assert one is not other
    assert 2.0 * evaluate(one, {"x": 0.4}) == pytest.approx(evaluate(other, {"x": 0.4}))


def test_orders_end_where_polynomials_do() -> None:
    ref: TableRef | None = curve()
    for _ in range(3):
        assert ref is not None
        ref = ref.derivative(0)
    assert ref is not None
    assert ref.derivative(0) is None
    assert derivative(derivative(looked_up(curve(kind="linear"), X), "x"), "x") is ZERO


def test_structure_text_and_copies() -> None:
    e = looked_up(surface(), X, 2.0 * Y)
    assert degree(e, ["x"]) == 3
    assert degree(e, ["z"]) == 0
    assert render(e) == "H(x, 2*y)"
    assert render(derivative(e, "y")) == "2*H_y(x, 2*y)"
    assert render(derivative(looked_up(curve(), X), "x")) == "T'(x)"
    assert [ref.name for ref in tables([e, looked_up(curve(), X)])] == ["H", "T"]
    assert pickle.loads(pickle.dumps(e)) is e
    assert copy.deepcopy(e) is e
