"""Expressions: interned nodes, simplification, differentiation, structure, counting, text."""

from stc.symbolic.expr import Expr, num, sym

__all__ = ["Expr", "num", "sym"]
