"""Why an expression is undefined whatever the unknowns are, because of its constants."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from stc.problem import ConstantRef
from stc.symbolic.expr import Expr, evaluate, reachable, symbols

__all__ = ["constant_fault"]


def constant_fault(body: Expr, constants: Mapping[object, float]) -> tuple[str, dict[str, float]]:
    """Why an expression has no value whatever the unknowns are: a part made of constants alone is undefined.

    Args:
        body: the expression.
        constants: values by :class:`stc.problem.ConstantRef`.

    Returns:
        The reason in words, and the constants of that part with their values; an empty text if there is no such part.
    """
    for node in reachable([body]):  # parts before what they are parts of
        if node.op == "div" and _is_fixed(node.args[1]) and evaluate(node.args[1], constants) == 0.0:
            return "it divides by zero, so that no guess helps", _named(node.args[1], constants)
        if node.op in ("table", "at") or not _is_fixed(node):
            continue
        value = float(evaluate(node, constants))
        if np.isfinite(value):
            continue
        if node.op in ("sym", "num"):
            return "`inf` is not a number; as a bound it means that there is none", _named(node, constants)
        if np.isinf(value):
            return "its constants give more than the largest number, 1.797e308", _named(node, constants)
        return "a part that is made of constants alone is no real number", _named(node, constants)
    return "", {}


def _is_fixed(e: Expr) -> bool:
    return all(isinstance(key, ConstantRef) for key in symbols(e))


def _named(e: Expr, constants: Mapping[object, float]) -> dict[str, float]:
    return {key.name: constants[key] for key in symbols(e) if isinstance(key, ConstantRef)}
