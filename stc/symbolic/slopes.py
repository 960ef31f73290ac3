"""Values and derivatives of expressions in plain NumPy, to check results of compiled derivatives.

One sweep forward for the values, one back for the adjoints (Griewank & Walther, Evaluating Derivatives, 2nd ed.,
chapter 3), on numbers and without any symbolic derivative: it shares no code with :mod:`stc.symbolic.differentiate`.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence, Set
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from stc.symbolic.node import Expr
from stc.symbolic.tables import look
from stc.symbolic.traverse import NUMPY_MEANING, reachable

FloatArray = NDArray[np.float64]

#: Per operator and operand the slope by that operand, given the result and the operands.
_SLOPES: Final[Mapping[str, tuple[Callable[..., Any], ...]]] = {
    "add": (lambda f, a, b: 1.0, lambda f, a, b: 1.0),
    "sub": (lambda f, a, b: 1.0, lambda f, a, b: -1.0),
    "mul": (lambda f, a, b: b, lambda f, a, b: a),
    "div": (lambda f, a, b: 1.0 / b, lambda f, a, b: -f / b),
    "pow": (lambda f, a, b: b * np.power(a, b - 1.0), lambda f, a, b: f * np.log(a)),
    "neg": (lambda f, a: -1.0,),
    "sin": (lambda f, a: np.cos(a),),
    "cos": (lambda f, a: -np.sin(a),),
    "tan": (lambda f, a: 1.0 + f * f,),
    "asin": (lambda f, a: 1.0 / np.sqrt(1.0 - a * a),),
    "acos": (lambda f, a: -1.0 / np.sqrt(1.0 - a * a),),
    "atan": (lambda f, a: 1.0 / (1.0 + a * a),),
    "atan2": (lambda f, y, x: x / (x * x + y * y), lambda f, y, x: -y / (x * x + y * y)),
    "sinh": (lambda f, a: np.cosh(a),),
    "cosh": (lambda f, a: np.sinh(a),),
    "tanh": (lambda f, a: 1.0 - f * f,),
    "exp": (lambda f, a: f,),
    "log": (lambda f, a: 1.0 / a,),
    "sqrt": (lambda f, a: 0.5 / f,),
    "look": (lambda f, x, place: look(x, place, 0), lambda f, x, place: look(x, place, 1)),
    "at": (lambda f, y, table: 1.0,),
}


class Sweep:
    """Several expressions with the same symbol values, evaluated once.

    Attributes:
        values: the value of each expression: an array with one entry per evaluation point, or a single number.
    """

    def __init__(self, roots: Sequence[Expr], values: Mapping[Hashable, Any]) -> None:
        self.roots = list(roots)
        self._done: dict[Expr, Any] = {}
        done = self._done
        with np.errstate(all="ignore"):
            for node in reachable(self.roots):
                if node.op == "num":
                    done[node] = np.float64(node.payload)
                elif node.op == "table":
                    done[node] = node.payload
                elif node.op == "sym":
                    done[node] = np.asarray(values[node.payload], dtype=np.float64)
                else:
                    done[node] = NUMPY_MEANING[node.op](*[done[arg] for arg in node.args])
        self.values = [done[root] for root in self.roots]

    def slopes(self, number: int, keys: Set[Hashable]) -> dict[Hashable, Any]:
        """The derivatives of expression ``number`` with respect to those of its symbols that are in ``keys``."""
        root, done = self.roots[number], self._done
        nodes = reachable([root])
        active: set[Expr] = set()
        for node in nodes:
            if (node.op == "sym" and node.payload in keys) or any(arg in active for arg in node.args):
                active.add(node)
        adjoint: dict[Expr, Any] = {root: np.float64(1.0)}
        found: dict[Hashable, Any] = {}
        with np.errstate(all="ignore"):
            for node in reversed(nodes):
                if node not in active or node not in adjoint:
                    continue
                seed = adjoint.pop(node)
                if node.op == "sym":
                    found[node.payload] = seed
                    continue
                given = [done[arg] for arg in node.args]
                for arg, slope in zip(node.args, _SLOPES[node.op], strict=node.op != "at"):
                    if arg in active:
                        part = seed * slope(done[node], *given)
                        adjoint[arg] = adjoint[arg] + part if arg in adjoint else part
        return found
