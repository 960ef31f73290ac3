"""Structural properties of expressions: the symbols in them, and their polynomial degree.

Degrees are upper bounds: exact for polynomials as they are simplified, and never too low.  Cancellation that
the simplifier does not see (``(x + y)*(x + y) - x*x - y*y`` has degree 2, ``(x + 1)*y - x*y`` is called 2
although it is 1) errs on the safe side.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import Final

from stc.symbolic.node import Expr
from stc.symbolic.traverse import reachable

CONSTANT: Final = 0
LINEAR: Final = 1
QUADRATIC: Final = 2
GENERAL: Final = 3


def degrees(exprs: Sequence[Expr], keys: Iterable[Hashable]) -> list[int]:
    """The degree of each expression as a polynomial in the symbols with the given keys, jointly.

    0 constant, 1 linear, 2 quadratic, 3 anything else.
    """
    wanted = frozenset(keys)
    found: dict[Expr, int] = {}
    for node in reachable(exprs):
        op = node.op
        if op == "num" or op == "table":
            found[node] = CONSTANT
        elif op == "sym":
            found[node] = LINEAR if node.payload in wanted else CONSTANT
        else:
            found[node] = _combined(node, [found[arg] for arg in node.args])
    return [found[e] for e in exprs]


def _combined(node: Expr, of_args: list[int]) -> int:
    """The degree of a compound node from those of its operands."""
    highest = max(of_args)
    if highest == CONSTANT:
        return CONSTANT
    op = node.op
    if op in ("add", "sub", "neg"):
        return highest
    if op == "mul":
        return min(sum(of_args), GENERAL)
    if op == "div" and of_args[1] == CONSTANT:
        return of_args[0]
    if op == "pow" and node.args[1].op == "num":
        exponent = node.args[1].payload
        if exponent >= 0.0 and exponent == int(min(exponent, GENERAL)):
            return min(of_args[0] * int(exponent), GENERAL)
    return GENERAL


def degree(e: Expr, keys: Iterable[Hashable]) -> int:
    """The degree of one expression; see :func:`degrees`."""
    return degrees([e], keys)[0]


def mentions(e: Expr, wanted: Callable[[Hashable], bool]) -> bool:
    """Whether a symbol with a key that is ``wanted`` occurs in ``e``; fast if many do."""
    seen: set[Expr] = set()
    open_ = [e]
    while open_:
        node = open_.pop()
        if node.op == "sym":
            if wanted(node.payload):
                return True
        elif node not in seen:
            seen.add(node)
            open_.extend(node.args)
    return False


def mentioning(exprs: Sequence[Expr], wanted: Callable[[Hashable], bool]) -> list[bool]:
    """:func:`mentions` of each of many expressions, which share subexpressions."""
    found: dict[Expr, bool] = {}
    for node in reachable(exprs):
        if node.op == "sym":
            found[node] = wanted(node.payload)
        else:
            found[node] = any(map(found.__getitem__, node.args))
    return [found[e] for e in exprs]


def is_linear(e: Expr, keys: Iterable[Hashable]) -> bool:
    """Whether ``e`` is affine in the symbols with the given keys; others may be their factors."""
    return degree(e, keys) <= LINEAR
