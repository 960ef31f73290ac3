"""Readable infix text of an expression, in the notation of the spec language."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from stc.symbolic.node import Expr
from stc.symbolic.traverse import postorder

_SUM, _PRODUCT, _SIGN, _POWER, _ATOM = 1, 2, 3, 4, 5
_INFIX: Final[dict[str, tuple[str, int, int, int]]] = {
    # text, own binding strength, strength needed on the left, on the right
    "add": (" + ", _SUM, _SUM, _SUM),
    "sub": (" - ", _SUM, _SUM, _PRODUCT),
    "mul": ("*", _PRODUCT, _PRODUCT, _PRODUCT),
    "div": ("/", _PRODUCT, _PRODUCT, _SIGN),
    "pow": ("^", _POWER, _ATOM, _SIGN),
}


def number_text(value: float) -> str:
    """The shortest text that reads back as the value, without a trailing ``.0``."""
    text = repr(value)
    return text[:-2] if text.endswith(".0") else text


def render(e: Expr, name_of: Callable[[Any], str] = str) -> str:
    """Infix text of ``e``; ``name_of`` turns symbol keys into names.

    ``-3 + x`` is printed as ``x - 3`` and ``x*x`` as ``x^2``.  Shared subexpressions are written out wherever
    they occur, so the text of a large expression can be far longer than the expression.
    """
    done: dict[Expr, tuple[str, int]] = {}

    def part(node: Expr, needed: int) -> str:
        text, strength = done[node]
        return text if strength >= needed else f"({text})"

    for node in postorder([e]):
        op, args = node.op, node.args
        if op == "num":
            text = number_text(node.payload)
            done[node] = (text, _SIGN if text.startswith("-") else _ATOM)
        elif op == "sym":
            done[node] = (name_of(node.payload), _ATOM)
        elif op == "neg":
            done[node] = ("-" + part(args[0], _SIGN), _SIGN)
        elif op == "mul" and args[0] is args[1]:
            done[node] = (part(args[0], _ATOM) + "^2", _POWER)
        elif op == "add" and args[0].op == "num":
            sign, size = (" - ", -args[0].payload) if args[0].payload < 0 else (" + ", args[0].payload)
            done[node] = (part(args[1], _SUM) + sign + number_text(size), _SUM)
        elif op in _INFIX:
            text, strength, left, right = _INFIX[op]
            done[node] = (part(args[0], left) + text + part(args[1], right), strength)
        else:
            done[node] = (f"{op}({', '.join(done[a][0] for a in args)})", _ATOM)
    return done[e][0]
