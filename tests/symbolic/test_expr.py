from __future__ import annotations

import copy
import gc
import math
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from symbolic.random_expressions import NAMES, expressions, points, simplified

from stc.symbolic.expr import (
    FUNCTIONS,
    ONE,
    ZERO,
    Expr,
    add,
    call,
    evaluate,
    evaluate_all,
    interned_count,
    mul,
    num,
    postorder,
    raw,
    reachable,
    render,
    substitute,
    sum_of,
    sym,
    symbols,
)

X, Y, Z = sym("x"), sym("y"), sym("z")


def test_equal_expressions_are_one_object() -> None:
    assert (X + 2.0) * call("sin", Y) is call("sin", Y) * (2.0 + X)
    assert sym(("q", 1)) is sym(("q", 1))
    assert num(3) is num(3.0)
    assert num(-0.0) is ZERO
    assert num(math.nan) is num(math.nan)
    assert raw("add", X, ZERO) is raw("add", X, ZERO)
    assert raw("add", X, ZERO) is not X
    assert X - Y is not Y - X


def test_operators_accept_numbers_on_both_sides() -> None:
    values = {"x": 0.7}
    for e, expected in [
        (2 - X, 1.3),
        (2 + X, 2.7),
        (2 * X, 1.4),
        (2 / X, 2 / 0.7),
        (2**X, 2**0.7),
        (X - 2, -1.3),
        (X / 2, 0.35),
        (X**2, 0.49),
        (-X, -0.7),
    ]:
        assert evaluate(e, values) == pytest.approx(expected, rel=1e-15)


def test_unknown_operators_and_functions_are_refused() -> None:
    with pytest.raises(ValueError, match="no operator 'mod' with 2 operands"):
        raw("mod", X, Y)
    with pytest.raises(ValueError, match="no operator 'add' with 1 operands"):
        raw("add", X)
    with pytest.raises(ValueError, match="no function 'atan2' of 1 arguments"):
        call("atan2", X)
    with pytest.raises(ValueError, match="no function 'add' of 2 arguments"):
        call("add", X, Y)


def test_unused_expressions_are_freed() -> None:
    gc.collect()
    before = interned_count()
    e: Expr | None = X
    for k in range(30_000):
        e = call("sin", e + float(k % 7))  # type: ignore[operator]
    assert interned_count() > before + 50_000
    e = None
    gc.collect()
    assert interned_count() <= before + 7


def test_copies_and_pickles_are_the_same_object() -> None:
    e = call("atan2", X, Y * 2.5)
    assert copy.copy(e) is e
    assert copy.deepcopy([e])[0] is e
    assert pickle.loads(pickle.dumps(e)) is e


def test_order_is_topological() -> None:
    e = call("sin", X * Y + 2.0) / (X * Y)
    for nodes in (reachable([e]), postorder([e])):
        assert len(nodes) == len(set(nodes)) == 7
        place = {node: k for k, node in enumerate(nodes)}
        assert all(place[arg] < place[node] for node in nodes for arg in node.args)


@given(st.floats(), st.floats())
@example(2.0, 2.5)  # Python's hashes of these differ in the highest bit alone,
@example(0.5, -0.5)  # and these in their sign
@example(0.1 + 0.2, 0.3)
def test_numbers_are_told_apart_by_their_order(first: float, second: float) -> None:
    # What has no order comes as memory addresses have it, and code that another process made is not found.
    a, b = num(first), num(second)
    assert (a.order == b.order) is (a is b)
    assert (mul(a, X).order == mul(b, X).order) is (mul(a, X) is mul(b, X))
    assert a.order < X.order


def test_symbols_come_once_each() -> None:
    assert sorted(symbols(X * Y + call("sin", X) / Y)) == ["x", "y"]
    assert symbols(num(3.0)) == ()


def test_substitute_replaces_all_at_once_and_simplifies() -> None:
    assert substitute(X - Y, {"x": Y, "y": X}) is Y - X
    assert substitute(X * Y + Z, {"y": ZERO}) is Z
    assert substitute(call("cos", X) * 2.0, {"x": ZERO}) is num(2.0)
    e = X + Y
    assert substitute(e, {"z": ONE}) is e
    memo: dict[Expr, Expr] = {}
    assert substitute(e, {"x": Z}, memo) is substitute(e, {"x": Z}, memo)
    assert memo[X] is Z


def test_deep_expressions_do_not_exhaust_the_stack() -> None:
    e = X
    for _ in range(20_000):
        e = call("sin", e) + Y
    assert len(symbols(e)) == 2
    assert math.isfinite(evaluate(e, {"x": 1.0, "y": 0.5}))
    assert symbols(substitute(e, {"x": Z})) != symbols(e)
    assert "..." in render(e, limit=100)
    assert repr(e) == "Expr(add ...)"


def test_sum_of_is_balanced() -> None:
    terms = [sym(k) for k in range(1000)]
    assert sum_of([]) is ZERO
    assert sum_of([X]) is X
    depth = (sum_of(terms).order >> 60) - (X.order >> 60)
    assert depth == 10


def test_evaluate_is_silent_about_undefined_values() -> None:
    values = {"x": np.array([-1.0, 0.0, 1.0])}
    np.testing.assert_array_equal(evaluate(call("log", X), values), [np.nan, -np.inf, 0.0])
    np.testing.assert_array_equal(evaluate(1.0 / X, values), [-1.0, np.inf, 1.0])
    assert isinstance(evaluate(X, {"x": 1}), float)
    with pytest.raises(KeyError):
        evaluate(X, {})


@settings(max_examples=300)
@given(expressions())
def test_simplifying_keeps_values(e: Expr) -> None:
    if any(node.op == "atan2" for node in reachable([e])):
        return  # atan2 tells 0 from -0; simplifying does not
    before, after = evaluate_all([e, simplified(e)], points())
    # Where a part is tiny or huge its rounding is amplified without limit; elsewhere values agree.
    parts = [np.abs(v) for v in evaluate_all(reachable([e]), points())]
    tame = np.all([(v < 1e6) & ((v > 1e-6) | (v == 0.0)) for v in np.broadcast_arrays(*parts)], axis=0)
    before, after = np.broadcast_to(before, tame.shape), np.broadcast_to(after, tame.shape)
    np.testing.assert_allclose(after[tame], before[tame], rtol=1e-7, atol=1e-7)


@settings(max_examples=300)
@given(expressions())
def test_simplifying_twice_changes_nothing(e: Expr) -> None:
    once = simplified(e)
    assert evaluate_all([once], points())[0] is not None
    assert simplified(once) is once


@settings(max_examples=300)
@given(expressions(leaves=8))
def test_text_means_the_expression(e: Expr) -> None:
    if any(node.op == "atan2" for node in reachable([e])):
        return  # atan2 tells 0 from -0, which the text of a number does not
    names = {name: 0.3 + 0.2 * k for k, name in enumerate(NAMES)}
    scope = {name: getattr(math, name) for name in FUNCTIONS}
    value = evaluate(e, names)
    if math.isfinite(value) and abs(value) < 1e9:
        try:
            read = eval(render(e).replace("^", "**"), {**scope, **names})
        except (ValueError, ZeroDivisionError, OverflowError):
            return  # a part is inf or nan on the way, which Python's own functions refuse
        if not isinstance(read, complex):
            assert read == pytest.approx(value, rel=1e-6, abs=1e-6)


def test_structure_does_not_depend_on_the_process() -> None:
    program = (
        "from stc.symbolic.expr import *\n"
        "from stc.symbolic.differentiate import gradient\n"
        "if {noise}: kept = [sym(k) * sym('x') for k in range(50)]\n"
        "x, y, z = map(sym, ['x', ('q', 2), 'z'])\n"
        "e = call('sin', x * y) * z / (x + y) + z * y * x\n"
        "print([render(g) for g in gradient(e, ['x', ('q', 2), 'z'])], symbols(e), e.order)\n"
    )
    texts = {
        subprocess.run(
            [sys.executable, "-c", program.format(noise=noise)],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for noise, seed in ((0, "1"), (1, "2"))
    }
    assert len(texts) == 1


def test_products_and_sums_share_operands_in_either_order() -> None:
    assert add(X, Y) is add(Y, X)
    assert mul(X, Y) is mul(Y, X)
