"""The number of arithmetic operations of derivatives: as naive chain-rule trees, simplified, and shared.

An *operation* is any node that is not a literal or a symbol; a function call counts as one.

*Naive trees* are those of the 2001 report's program: the chain rule applied to every node of the expression
tree for every variable, nothing shared and nothing simplified, zeros and ones included (``d(l*m) = 0*m +
l*0``).  The rules are those of :data:`CHAIN_RULE`.  The size of such a tree doesn't depend on the variable,
and follows from the sizes of its operands' derivative trees by a recurrence, so that it is counted exactly
without being built.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from stc.symbolic.node import Expr
from stc.symbolic.traverse import reachable

Sizes = tuple[int, ...]
"""Sizes of a tree and of its derivatives, by order."""

CHAIN_RULE: Final[dict[str, Any]] = {
    # Operands are "a" and "b", their derivatives "a'" and "b'", any literal "l"; "power" has a literal
    # exponent.
    "add": ("add", "a'", "b'"),
    "sub": ("sub", "a'", "b'"),
    "neg": ("neg", "a'"),
    "mul": ("add", ("mul", "a'", "b"), ("mul", "a", "b'")),
    "div": ("div", ("sub", ("mul", "b", "a'"), ("mul", "b'", "a")), ("power", "b")),
    "power": ("mul", ("mul", "l", ("power", "a")), "a'"),
    "pow": (
        "mul",
        ("pow", "a", "b"),
        ("add", ("mul", "b'", ("log", "a")), ("div", ("mul", "b", "a'"), "a")),
    ),
    "sin": ("mul", ("cos", "a"), "a'"),
    "cos": ("mul", ("neg", ("sin", "a")), "a'"),
    "tan": ("div", "a'", ("power", ("cos", "a"))),
    "asin": ("div", "a'", ("sqrt", ("sub", "l", ("power", "a")))),
    "acos": ("neg", ("div", "a'", ("sqrt", ("sub", "l", ("power", "a"))))),
    "atan": ("div", "a'", ("add", "l", ("power", "a"))),
    "atan2": (
        "div",
        ("sub", ("mul", "b", "a'"), ("mul", "a", "b'")),
        ("add", ("power", "a"), ("power", "b")),
    ),
    "sinh": ("mul", ("cosh", "a"), "a'"),
    "cosh": ("mul", ("sinh", "a"), "a'"),
    "tanh": ("mul", ("sub", "l", ("power", ("tanh", "a"))), "a'"),
    "exp": ("mul", ("exp", "a"), "a'"),
    "log": ("div", "a'", "a"),
    "sqrt": ("div", "a'", ("mul", "l", ("sqrt", "a"))),
    "look": ("add", ("mul", ("look", "a", "b"), "a'"), ("mul", ("look", "a", "b"), "b'")),
    "at": "a'",
}
"""The naive derivative of each operator, as a tree."""


def _compound(op: str, operands: tuple[Sizes, ...], orders: int) -> Sizes:
    """Sizes of ``op(operands)`` and of its derivatives below the given order."""
    sizes = [1 + sum(operand[0] for operand in operands)]
    if orders > 1:
        names = dict(zip("ab", operands, strict=False))
        sizes += _template(CHAIN_RULE[op], names, orders - 1)
    return tuple(sizes)


def _template(tree: Any, names: dict[str, Sizes], orders: int) -> Sizes:
    """Sizes of a tree of :data:`CHAIN_RULE` and of its derivatives below the given order."""
    if tree == "l":
        return (0,) * orders
    if isinstance(tree, str):
        return names[tree[0]][1:] if tree.endswith("'") else names[tree]
    return _compound(tree[0], tuple(_template(part, names, orders) for part in tree[1:]), orders)


def naive_sizes(e: Expr, orders: int = 3) -> Sizes:
    """Operations in the tree of ``e``, in its naive derivative by any one variable, in the second, ..."""
    leaf: Sizes = (0,) * orders
    sizes: dict[Expr, Sizes] = {}
    for node in reachable([e]):
        if not node.args:
            sizes[node] = leaf
        elif node.op == "pow" and node.args[1].op == "num":
            sizes[node] = _compound("power", (sizes[node.args[0]],), orders)
        else:
            sizes[node] = _compound(node.op, tuple(sizes[arg] for arg in node.args), orders)
    return sizes[e]


def naive_jacobian_ops(e: Expr, n_variables: int) -> int:
    """Operations in the naive derivative trees of ``e`` by each of ``n_variables`` variables."""
    return n_variables * naive_sizes(e, 2)[1]


def naive_hessian_ops(e: Expr, n_variables: int) -> int:
    """Operations in the naive second-derivative trees of ``e``: one triangle, n(n+1)/2 trees."""
    return n_variables * (n_variables + 1) // 2 * naive_sizes(e, 3)[2]


def tree_ops(e: Expr) -> int:
    """Operations in ``e`` written out as a tree, without sharing."""
    return naive_sizes(e, 1)[0]


def shared_ops(exprs: Iterable[Expr]) -> int:
    """Distinct operations in all the expressions together: each common subexpression counts once.

    Expressions that are equal as polynomials are one, as in a tape, however they are written.
    """
    return len({node.fingerprint for node in reachable(exprs) if node.args})
