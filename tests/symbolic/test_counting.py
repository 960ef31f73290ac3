"""Counts are checked against trees that are really built, node by node, by the chain rule."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from symbolic.random_expressions import expressions

from stc.symbolic.counting import (
    CHAIN_RULE,
    naive_hessian_ops,
    naive_jacobian_ops,
    naive_sizes,
    shared_ops,
    tree_ops,
)
from stc.symbolic.expr import ARITY, OF_TABLES, Expr, call, num, raw, sym

Tree = tuple[Any, ...] | str


def tree_of(e: Expr) -> Tree:
    if not e.args:
        return "leaf"
    if e.op == "pow" and e.args[1].op == "num":
        return ("power", tree_of(e.args[0]))
    return (e.op, *map(tree_of, e.args))


def differentiated(tree: Tree) -> Tree:
    if isinstance(tree, str):
        return "leaf"
    operands = dict(zip("ab", tree[1:], strict=False))

    def filled(part: Any) -> Tree:
        if part == "l":
            return "leaf"
        if isinstance(part, str):
            operand = operands[part[0]]
            return differentiated(operand) if part.endswith("'") else operand
        return (part[0], *map(filled, part[1:]))

    return filled(CHAIN_RULE[tree[0]])


def size(tree: Tree) -> int:
    return 0 if isinstance(tree, str) else 1 + sum(map(size, tree[1:]))


def test_every_operator_has_a_chain_rule() -> None:
    assert set(CHAIN_RULE) == {*ARITY, *OF_TABLES, "power"}


@settings(max_examples=100)
@given(expressions(leaves=6))
def test_counts_are_those_of_trees_that_are_built(e: Expr) -> None:
    tree = tree_of(e)
    first = differentiated(tree)
    assert naive_sizes(e, 3) == (size(tree), size(first), size(differentiated(first)))
    assert tree_ops(e) == size(tree)
    assert naive_jacobian_ops(e, 7) == 7 * size(first)
    assert naive_hessian_ops(e, 7) == 28 * size(differentiated(first))


def test_the_report_s_example() -> None:
    # d/dt (l*m + t^2/y - cos(t + m)): product rule 3 operations, quotient 9, cosine 5, and two join them.
    length, m, t, y = (sym(key) for key in ("l", "m", "t", "y"))
    quotient = raw("div", raw("pow", t, num(2.0)), y)
    e = raw("sub", raw("add", raw("mul", length, m), quotient), raw("cos", raw("add", t, m)))
    assert naive_sizes(e, 2) == (7, 19)


def test_counts_of_shared_expressions_are_exact_however_large() -> None:
    e = sym("x")
    for _ in range(200):
        e = raw("mul", e, raw("sin", e))
    assert tree_ops(e) == 2 ** (200 + 1) - 2
    assert shared_ops([e]) == 400
    assert naive_jacobian_ops(e, 1) > 2**201


@pytest.mark.parametrize("orders", [1, 2, 3, 4])
def test_leaves_take_no_operations(orders: int) -> None:
    assert naive_sizes(sym("x"), orders) == (0,) * orders


def test_sharing_counts_once() -> None:
    s = call("sin", sym("x") * sym("y"))
    assert shared_ops([s, s * 2.0, s + sym("x")]) == 4
