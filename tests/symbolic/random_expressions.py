"""Random expressions for property tests, unsimplified or simplified, and points to evaluate them at."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from stc.symbolic.expr import ARITY, Expr, num, raw, reachable, rebuild, sym

NAMES = ("a", "b", "c", "d")
LITERALS = (-2.5, -1.0, 0.0, 0.5, 1.0, 2.0, 3.0)
EXPONENTS = (-2.0, -1.0, 0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0)
SMOOTH = ("add", "sub", "mul", "neg", "sin", "cos", "atan", "tanh", "exp")


def expressions(operators: tuple[str, ...] = tuple(ARITY), leaves: int = 12) -> st.SearchStrategy[Expr]:
    """Unsimplified expressions of the symbols NAMES with at most so many leaves."""
    leaf = st.sampled_from(NAMES).map(sym) | st.sampled_from(LITERALS).map(num)

    def larger(operand: st.SearchStrategy[Expr]) -> st.SearchStrategy[Expr]:
        choices = []
        for op in operators:
            if op == "pow":
                exponent = st.sampled_from(EXPONENTS).map(num) | st.sampled_from(NAMES).map(sym)
                choices.append(st.builds(raw, st.just(op), operand, exponent))
            else:
                choices.append(st.builds(raw, st.just(op), *[operand] * ARITY[op]))
        return st.one_of(choices)

    return st.recursive(leaf, larger, max_leaves=leaves)


def simplified(e: Expr) -> Expr:
    """``e`` built again through the simplifying constructors."""
    done: dict[Expr, Expr] = {}
    for node in reachable([e]):
        done[node] = rebuild(node.op, tuple(done[arg] for arg in node.args)) if node.args else node
    return done[e]


def points(seed: int = 3, count: int = 16) -> dict[str, NDArray[np.float64]]:
    """Values for the symbols: arrays of shape (count,) between -2 and 2, away from zero."""
    random = np.random.default_rng(seed)
    return {name: random.uniform(0.2, 2.0, count) * random.choice([-1.0, 1.0], count) for name in NAMES}
