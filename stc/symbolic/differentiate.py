"""Symbolic differentiation: the derivative table, reverse-mode gradients, sparse Jacobians and Hessians.

Every derivative shares its subexpressions with the function and with the other derivatives, because nodes are
interned.  Gradients are accumulated in reverse (Griewank & Walther, Evaluating Derivatives, 2nd ed., section
3.2): the cost of a whole gradient is a small multiple of that of the function, whatever the number of
variables.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import Any, Final

from stc.symbolic.node import ONE, ZERO, Expr, add, call, div, mul, neg, num, pow_, sub
from stc.symbolic.rules import collect
from stc.symbolic.traverse import reachable, symbols

Key = Hashable


def _square(e: Expr) -> Expr:
    return mul(e, e)


def _pow_by_base(s: Expr, f: Expr, a: Expr, b: Expr) -> Expr:
    # b * a^(b-1), never b * a^b / a: the former is right at a = 0 for whole exponents.
    return mul(s, mul(b, pow_(a, sub(b, ONE))))


# Each entry takes the seed s (the derivative of the result by f), f itself and its operands, and gives s *
# df/d(operand).
BY_ARGUMENT: Final[dict[str, tuple[Callable[..., Expr], ...]]] = {
    "add": (lambda s, f, a, b: s, lambda s, f, a, b: s),
    "sub": (lambda s, f, a, b: s, lambda s, f, a, b: neg(s)),
    "mul": (lambda s, f, a, b: mul(s, b), lambda s, f, a, b: mul(s, a)),
    "div": (lambda s, f, a, b: div(s, b), lambda s, f, a, b: neg(div(mul(s, f), b))),
    "pow": (_pow_by_base, lambda s, f, a, b: mul(s, mul(f, call("log", a)))),
    "neg": (lambda s, f, a: neg(s),),
    "sin": (lambda s, f, a: mul(s, call("cos", a)),),
    "cos": (lambda s, f, a: neg(mul(s, call("sin", a))),),
    "tan": (lambda s, f, a: mul(s, add(ONE, _square(f))),),
    "asin": (lambda s, f, a: div(s, call("sqrt", sub(ONE, _square(a)))),),
    "acos": (lambda s, f, a: neg(div(s, call("sqrt", sub(ONE, _square(a))))),),
    "atan": (lambda s, f, a: div(s, add(ONE, _square(a))),),
    "atan2": (
        lambda s, f, y, x: div(mul(s, x), add(_square(x), _square(y))),
        lambda s, f, y, x: neg(div(mul(s, y), add(_square(x), _square(y)))),
    ),
    "sinh": (lambda s, f, a: mul(s, call("cosh", a)),),
    "cosh": (lambda s, f, a: mul(s, call("sinh", a)),),
    "tanh": (lambda s, f, a: mul(s, sub(ONE, _square(f))),),
    "exp": (lambda s, f, a: mul(s, f),),
    "log": (lambda s, f, a: div(s, a),),
    "sqrt": (lambda s, f, a: div(mul(num(0.5), s), f),),
}
"""The derivative table: per operator, one entry per operand."""


def _adjoints(e: Expr, keys: frozenset[Key]) -> dict[Expr, Expr]:
    """d e / d symbol for every symbol of ``e`` whose key is in ``keys`` (reverse mode)."""
    nodes = reachable([e])
    active: set[Expr] = set()
    for node in nodes:
        if node.op == "sym":
            if node.payload in keys:
                active.add(node)
        else:
            for arg in node.args:
                if arg in active:
                    active.add(node)
                    break
    leaves: dict[Expr, Expr] = {}
    if e not in active:
        return leaves
    parts: dict[Expr, list[Expr]] = {e: [ONE]}
    for node in reversed(nodes):
        if node not in active:
            continue
        terms = parts.pop(node, None)
        seed = ZERO if terms is None else collect(terms)
        if seed is ZERO:
            continue
        if node.op == "sym":
            leaves[node] = seed
            continue
        args = node.args
        for arg, rule in zip(args, BY_ARGUMENT[node.op], strict=True):
            if arg in active:
                part = rule(seed, node, *args)
                if part is not ZERO:
                    known = parts.get(arg)
                    if known is None:
                        parts[arg] = [part]
                    else:
                        known.append(part)
    return leaves


def gradient(e: Expr, keys: Sequence[Key]) -> list[Expr]:
    """The partial derivatives of ``e`` by each key, in the order of ``keys`` (reverse mode, one sweep)."""
    leaves = {node.payload: seed for node, seed in _adjoints(e, frozenset(keys)).items()}
    return [leaves.get(key, ZERO) for key in keys]


def derivative(e: Expr, key: Key) -> Expr:
    """The partial derivative of ``e`` by one key."""
    return gradient(e, [key])[0]


def jacobian(exprs: Sequence[Expr], keys: Sequence[Key]) -> dict[tuple[int, int], Expr]:
    """The nonzero partial derivatives ``(row, col) -> d exprs[row] / d keys[col]``, by row, then column."""
    column = {key: col for col, key in enumerate(keys)}
    wanted = frozenset(column)
    entries: dict[tuple[int, int], Expr] = {}
    for row, e in enumerate(exprs):
        found = sorted(
            (column[node.payload], seed) for node, seed in _adjoints(e, wanted).items() if seed is not ZERO
        )
        for col, seed in found:
            entries[row, col] = seed
    return entries


def hessian(e: Expr, keys: Sequence[Key]) -> dict[tuple[int, int], Expr]:
    """The nonzero second partial derivatives in the lower triangle: ``(i, j)``, i >= j, ordered by row, then
    column.

    The gradient by reverse mode, then the gradient of each of its entries.
    """
    slopes = gradient(e, keys)
    entries: dict[tuple[int, int], Expr] = {}
    for i, slope in enumerate(slopes):
        lower = keys[: i + 1]
        for j, second in enumerate(gradient(slope, lower)):
            if second is not ZERO:
                entries[i, j] = second
    return entries


def total_derivative(e: Expr, rate: Callable[[Any], Expr]) -> Expr:
    """The derivative of ``e`` along a motion: the sum over its symbols of d e / d symbol * ``rate(key)``."""
    keys = symbols(e)
    rates = {key: rate(key) for key in keys}
    moving = [key for key in keys if rates[key] is not ZERO]
    return collect([mul(slope, rates[key]) for key, slope in zip(moving, gradient(e, moving), strict=True)])


def depends_on(exprs: Iterable[Expr], keys: Iterable[Key]) -> bool:
    """Whether any of the expressions contains a symbol with one of the keys."""
    wanted = frozenset(keys)
    return any(node.op == "sym" and node.payload in wanted for node in reachable(exprs))
