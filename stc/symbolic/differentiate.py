"""Symbolic differentiation: the derivative table, gradients, sparse Jacobians and Hessians.

Every derivative shares its subexpressions with the function and with the other derivatives, because nodes are
interned.  There are two ways through the same table (Griewank & Walther, Evaluating Derivatives, 2nd ed.,
chapter 3), and their values agree up to rounding while their operations differ:

- in reverse, adjoints are accumulated from a result to the symbols: one sweep per row, a whole gradient for
  a small multiple of the cost of the function;
- forward, tangents are carried from a symbol to the results: one sweep per column, over the nodes that depend
  on it.  Rows built from one another, as in recursions along a chain of bodies, share their tangents.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence, Set
from operator import attrgetter
from typing import Any, Final

from stc.deadline import look
from stc.symbolic.node import (
    ONE,
    ZERO,
    Expr,
    add,
    call,
    div,
    mul,
    neg,
    num,
    pow_,
    slope_of_look,
    sub,
    sym,
)
from stc.symbolic.rules import collect
from stc.symbolic.traverse import reachable

Key = Hashable
Entries = dict[tuple[int, int], Expr]
"""A sparse matrix: nonzero entries by (row, column), in ascending order."""

#: Forward sweeps of so many times as many steps still end in fewer operations, as a rule.
_FAR_MORE: Final = 8
_by_order = attrgetter("order")


def _square(e: Expr) -> Expr:
    return mul(e, e)


def _pow_by_base(s: Expr, f: Expr, a: Expr, b: Expr) -> Expr:
    # b * a^(b-1), never b * a^b / a: the former is right at a = 0 for whole exponents.
    return mul(s, mul(b, pow_(a, sub(b, ONE))))


# Each entry takes the seed s, the operator's result f and its operands, and gives s * df/d(operand): in reverse
# the seed is the adjoint of f, forward it is the tangent of the operand.
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
    # The second argument of a table passes through `at` as it is: what belongs to it is the slope by that argument.
    "look": (
        lambda s, f, x, place: mul(s, slope_of_look(x, place, 0)),
        lambda s, f, x, place: mul(s, slope_of_look(x, place, 1)),
    ),
    "at": (lambda s, f, y, table: s, lambda s, f, y, table: ZERO),
}
"""The derivative table: per operator, one entry per operand."""


def adjoints(seeds: Iterable[tuple[Expr, Expr]], inputs: Set[Expr]) -> dict[Expr, Expr]:
    """The sum of ``seed * d e / d input`` over the pairs ``(e, seed)``, for every input that it depends on.

    One reverse sweep over all expressions together.  Any node may be an input: expressions below it are ignored, as if
    it were a symbol.
    """
    parts: dict[Expr, list[Expr]] = {}
    for e, seed in seeds:
        parts.setdefault(e, []).append(seed)
    nodes = reachable(parts)
    active: set[Expr] = set()
    for node in nodes:
        if node in inputs:
            active.add(node)
            continue
        for arg in node.args:
            if arg in active:
                active.add(node)
                break
    found: dict[Expr, Expr] = {}
    for node in reversed(nodes):
        if node not in active:
            continue
        terms = parts.pop(node, None)
        seed = ZERO if terms is None else collect(terms)
        if seed is ZERO:
            continue
        if node in inputs:
            found[node] = seed
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
    return found


def _by_rows(exprs: Sequence[Expr], keys: Sequence[Key]) -> Entries:
    """The Jacobian by one reverse sweep per row."""
    column = {sym(key): col for col, key in enumerate(keys)}
    entries: Entries = {}
    for row, e in enumerate(exprs):
        found = [(column[node], seed) for node, seed in adjoints([(e, ONE)], column.keys()).items()]
        for col, seed in sorted(found, key=lambda entry: entry[0]):
            entries[row, col] = seed
    return entries


def _marks(nodes: Sequence[Expr], keys: Sequence[Key]) -> dict[Expr, int]:
    """Per node (operands come first) the symbols that it depends on: a bit per position in ``keys``."""
    bit = {key: 1 << position for position, key in enumerate(keys)}
    depends: dict[Expr, int] = {}
    for node in nodes:
        mark = bit.get(node.payload, 0) if node.op == "sym" else 0
        for arg in node.args:
            mark |= depends[arg]
        depends[node] = mark
    return depends


def _by_columns(exprs: Sequence[Expr], keys: Sequence[Key], triangle: bool = False) -> Entries:
    """The Jacobian by one forward sweep per column; its lower triangle alone if so wanted."""
    nodes = reachable(exprs)
    depends = _marks(nodes, keys)
    last_row: dict[Expr, int] = {}
    if triangle:
        last_row = {e: row for row, e in enumerate(exprs)}
        for node in reversed(nodes):
            row = last_row[node]
            for arg in node.args:
                if last_row.get(arg, -1) < row:
                    last_row[arg] = row
    sweeps: list[list[tuple[Expr, tuple[Expr, ...], tuple[Callable[..., Expr], ...]]]] = [[] for _ in keys]
    for node in nodes:
        mark = depends[node]
        if triangle:
            mark &= (2 << last_row[node]) - 1
        if mark:
            step = (node, node.args, BY_ARGUMENT.get(node.op, ()))
            while mark:
                lowest = mark & -mark
                sweeps[lowest.bit_length() - 1].append(step)
                mark ^= lowest
    entries: Entries = {}
    for col, sweep in enumerate(sweeps):
        look()
        tangent: dict[Expr, Expr] = {}
        for node, args, rules in sweep:
            if not args:
                tangent[node] = ONE
                continue
            seed = tangent.get(args[0])
            slope = ZERO if seed is None else rules[0](seed, node, *args)
            if len(args) == 2:
                seed = tangent.get(args[1])
                if seed is not None:
                    part = rules[1](seed, node, *args)
                    slope = part if slope is ZERO else add(slope, part)
            if slope is not ZERO:
                tangent[node] = slope
        for row in range(col if triangle else 0, len(exprs)):
            seed = tangent.get(exprs[row])
            if seed is not None:
                entries[row, col] = seed
    return dict(sorted(entries.items(), key=lambda entry: entry[0]))


def _columns_pay(exprs: Sequence[Expr], keys: Sequence[Key]) -> bool:
    """Whether forward sweeps take not far more steps than reverse ones: they share more, along chains above all."""
    nodes = reachable(exprs)
    depends = _marks(nodes, keys)
    used_by: dict[Expr, int] = dict.fromkeys(nodes, 0)
    for row, e in enumerate(exprs):
        used_by[e] |= 1 << row
    for node in reversed(nodes):
        for arg in node.args:
            used_by[arg] |= used_by[node]
    row_steps = sum(used_by[node].bit_count() for node in nodes if depends[node])
    column_steps = sum(mark.bit_count() for mark in depends.values())
    return column_steps <= _FAR_MORE * row_steps


def gradient(e: Expr, keys: Sequence[Key]) -> list[Expr]:
    """The partial derivatives of ``e`` by each key, in the order of ``keys`` (one reverse sweep)."""
    inputs = [sym(key) for key in keys]
    found = adjoints([(e, ONE)], frozenset(inputs))
    return [found.get(node, ZERO) for node in inputs]


def derivative(e: Expr, key: Key) -> Expr:
    """The partial derivative of ``e`` by one key."""
    return gradient(e, [key])[0]


def jacobian(exprs: Sequence[Expr], keys: Sequence[Key]) -> Entries:
    """The nonzero partial derivatives ``(row, col) -> d exprs[row] / d keys[col]``, by row, then column."""
    return (_by_columns if _columns_pay(exprs, keys) else _by_rows)(exprs, keys)


def hessian(e: Expr, keys: Sequence[Key]) -> Entries:
    """The nonzero second partial derivatives in the lower triangle: ``(i, j)``, i >= j, by row, then column.

    The gradient by reverse mode, then its derivatives by columns: each takes the cost of a row, since the
    matrix is symmetric, but columns share more of their tangents.
    """
    return _by_columns(gradient(e, keys), keys, triangle=True)


def total_derivative(e: Expr, rate: Callable[[Any], Expr], memo: dict[Expr, Expr] | None = None) -> Expr:
    """The derivative of ``e`` along a motion: the sum over its symbols of d e / d symbol * ``rate(key)``.

    Rates are carried forward from the symbols, so that expressions that are built from one another have rates that
    are built from one another: those of positions along a chain of bodies take as many operations as the positions.
    ``memo`` may be passed to share the work between calls with the same ``rate``; it maps nodes to their rates.
    """
    done: dict[Expr, Expr] = {} if memo is None else memo
    if e in done:
        return done[e]
    waiting = {e}
    stack = [e]
    while stack:
        for arg in stack.pop().args:
            if arg not in done and arg not in waiting:
                waiting.add(arg)
                stack.append(arg)
    for node in sorted(waiting, key=_by_order):
        args = node.args
        if not args:
            done[node] = rate(node.payload) if node.op == "sym" else ZERO
            continue
        slope = ZERO
        for arg, rule in zip(args, BY_ARGUMENT[node.op], strict=True):
            seed = done[arg]
            if seed is not ZERO:
                part = rule(seed, node, *args)
                slope = part if slope is ZERO else add(slope, part)
        done[node] = slope
    return done[e]
