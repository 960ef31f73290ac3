"""The public interface of expressions: construct, inspect, substitute, evaluate, print."""

from __future__ import annotations

from stc.symbolic import rules as _rules
from stc.symbolic.node import (
    ARITY,
    FUNCTIONS,
    OF_TABLES,
    ONE,
    ZERO,
    Expr,
    add,
    call,
    div,
    interned_count,
    is_literal,
    looked_up,
    mul,
    neg,
    num,
    pow_,
    raw,
    rebuild,
    sub,
    sum_of,
    sym,
    table_leaf,
)
from stc.symbolic.render import render
from stc.symbolic.traverse import evaluate, evaluate_all, postorder, reachable, substitute, symbols, tables

RULES = _rules.RULES

__all__ = [
    "ARITY",
    "FUNCTIONS",
    "OF_TABLES",
    "ONE",
    "RULES",
    "ZERO",
    "Expr",
    "add",
    "call",
    "div",
    "evaluate",
    "evaluate_all",
    "interned_count",
    "is_literal",
    "looked_up",
    "mul",
    "neg",
    "num",
    "postorder",
    "pow_",
    "raw",
    "reachable",
    "rebuild",
    "render",
    "sub",
    "substitute",
    "sum_of",
    "sym",
    "symbols",
    "table_leaf",
    "tables",
]
