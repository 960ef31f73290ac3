"""Walks over expressions: orders, symbols, substitution, evaluation.  None of them recurses."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from operator import attrgetter
from typing import Any, Final
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from stc.symbolic.node import Expr, rebuild
from stc.symbolic.tables import At, TableRef, look

_by_order = attrgetter("order")


def reachable(roots: Iterable[Expr], leaves: Collection[Expr] = ()) -> list[Expr]:
    """Every node below the roots, including the roots, each once; sorted by ``order``, operands first.

    What is below the ``leaves`` alone is left out.
    """
    seen = set(roots)
    stack = [root for root in seen if root not in leaves] if leaves else list(seen)
    while stack:
        for arg in stack.pop().args:
            if arg not in seen:
                seen.add(arg)
                if arg not in leaves:
                    stack.append(arg)
    return sorted(seen, key=_by_order)


def postorder(roots: Sequence[Expr]) -> list[Expr]:
    """Every node below the roots, each once, operands first; depth first from left to right."""
    seen: set[Expr] = set()
    result: list[Expr] = []
    stack = list(reversed(roots))
    while stack:
        node = stack[-1]
        if node in seen:
            stack.pop()
            continue
        waiting = [arg for arg in node.args if arg not in seen]
        if waiting:
            waiting.reverse()
            stack.extend(waiting)
        else:
            seen.add(node)
            result.append(node)
            stack.pop()
    return result


_symbols_of: WeakKeyDictionary[Expr, tuple[Any, ...]] = WeakKeyDictionary()


def symbols(e: Expr) -> tuple[Any, ...]:
    """The keys of the symbols in ``e``, each once, in the same order in every process (memoised)."""
    found = _symbols_of.get(e)
    if found is None:
        found = tuple(node.payload for node in reachable([e]) if node.op == "sym")
        _symbols_of[e] = found
    return found


def tables(roots: Iterable[Expr]) -> list[TableRef]:
    """The tables in expressions, each once, as functions and not as derivatives of them; by their names."""
    found = {node.payload.base for node in reachable(roots) if node.op == "table"}
    return sorted(found, key=lambda ref: (ref.name, ref.table.digest))


def substitute(e: Expr, replacement: Mapping[Any, Expr], memo: dict[Expr, Expr] | None = None) -> Expr:
    """``e`` with symbols replaced by expressions, all at once, simplified again.

    ``memo`` may be passed to share the work between calls with the same ``replacement``; it maps nodes to
    results.
    """
    done: dict[Expr, Expr] = {} if memo is None else memo
    stack = [e]
    while stack:
        node = stack[-1]
        if node in done:
            stack.pop()
            continue
        args = node.args
        if not args:
            done[node] = replacement.get(node.payload, node) if node.op == "sym" else node
            stack.pop()
            continue
        waiting = [arg for arg in args if arg not in done]
        if waiting:
            stack.extend(waiting)
            continue
        new = tuple([done[arg] for arg in args])
        done[node] = node if all(map(_same, new, args)) else rebuild(node.op, new)
        stack.pop()
    return done[e]


def _same(a: Expr, b: Expr) -> bool:
    return a is b


Value = float | NDArray[np.float64]

NUMPY_MEANING: Final[dict[str, Callable[..., Any]]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "pow": np.power,
    "neg": np.negative,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "atan2": np.arctan2,
    "sinh": np.sinh,
    "cosh": np.cosh,
    "tanh": np.tanh,
    "exp": np.exp,
    "log": np.log,
    "sqrt": np.sqrt,
    "look": look,
    "at": At,
}
"""The NumPy function of each operator."""


def evaluate_all(roots: Sequence[Expr], values: Mapping[Hashable, Any]) -> list[Any]:
    """The values of several expressions; see :func:`evaluate`."""
    done: dict[Expr, Any] = {}
    with np.errstate(all="ignore"):
        for node in reachable(roots):
            op = node.op
            if op == "num":
                done[node] = np.float64(node.payload)
            elif op == "sym":
                value = values[node.payload]
                done[node] = np.float64(value) if isinstance(value, int | float) else value
            elif op == "table":
                done[node] = node.payload
            else:
                done[node] = NUMPY_MEANING[op](*[done[arg] for arg in node.args])
    return [done[root] for root in roots]


def evaluate(e: Expr, values: Mapping[Hashable, Any]) -> Any:
    """The value of ``e`` where each symbol has the given value: a float, or an array of any common shape.

    One NumPy call per node.  An invalid operation gives nan and an overflow or a division by zero inf,
    silently. Complex values are accepted (for complex-step differentiation of analytic functions).

    Raises:
        KeyError: a symbol has no value.
    """
    result = evaluate_all([e], values)[0]
    return float(result) if isinstance(result, np.floating) else result
