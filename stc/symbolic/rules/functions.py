"""Rules for functions: literals, and the symmetries of odd and even ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from stc.symbolic.node import FUNCTIONS, Expr, Rewrite, call, finite, neg, sub
from stc.symbolic.rules.table import coefficient, rule

_FOLD: Final[dict[str, Callable[[float], float]]] = {
    name: getattr(math, name) for name in FUNCTIONS if name != "atan2"
}


def _folding(name: str) -> Rewrite:
    function = _FOLD[name]

    def fold(a: Expr) -> Expr | None:
        try:
            return finite(function(a.payload))
        except (ValueError, OverflowError):
            return None

    return fold


for _name in _FOLD:
    rule(f"{_name}(l)", "l", _name, "num")(_folding(_name))


@rule("atan2(l1, l2)", "l", "atan2", "num", "num")
def _fold_atan2(a: Expr, b: Expr) -> Expr | None:
    return finite(math.atan2(a.payload, b.payload))


def opposite(e: Expr) -> Expr | None:
    """``-e`` where ``e`` is negative in form: a negative multiple, or a difference in descending order."""
    if e.op == "sub":
        return sub(e.args[1], e.args[0]) if e.args[0].order > e.args[1].order else None
    return neg(e) if coefficient(e)[0] < 0.0 else None


def _odd(name: str) -> Rewrite:
    def flip(a: Expr) -> Expr | None:
        positive = opposite(a)
        return None if positive is None else neg(call(name, positive))

    return flip


def _even(name: str) -> Rewrite:
    def flip(a: Expr) -> Expr | None:
        positive = opposite(a)
        return None if positive is None else call(name, positive)

    return flip


for _name in ("sin", "tan", "asin", "atan", "sinh", "tanh"):
    rule(f"{_name}(-e)", f"-{_name}(e)", _name, ("neg", "mul", "sub"))(_odd(_name))
for _name in ("cos", "cosh"):
    rule(f"{_name}(-e)", f"{_name}(e)", _name, ("neg", "mul", "sub"))(_even(_name))


@rule("log(exp(e))", "e", "log", "exp")
def _log_exp(a: Expr) -> Expr:
    return a.args[0]
