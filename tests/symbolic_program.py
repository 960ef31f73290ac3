"""Small nonlinear programs stated as Python expressions, with exact derivatives."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from stc.symbolic.differentiate import gradient, hessian, jacobian
from stc.symbolic.expr import Expr, evaluate, num, sum_of, sym
from stc.symbolic.structure import is_linear

Rows = Sequence[tuple[Expr | float, float, float]]
INF = float("inf")


class SymbolicProgram:
    """``minimise objective(x)`` over rows ``(expression, lower, upper)``, evaluated slowly and exactly."""

    def __init__(
        self,
        x0: Sequence[float],
        objective: Callable[[list[Expr]], Expr | float] | None = None,
        rows: Callable[[list[Expr]], Rows] | None = None,
        lower: Sequence[float] | float = -INF,
        upper: Sequence[float] | float = INF,
    ) -> None:
        self.n = len(x0)
        self.x0 = np.array(x0, dtype=float)
        self._keys = [f"x{k}" for k in range(self.n)]
        x = [sym(key) for key in self._keys]
        self._f = _expression(objective(x) if objective else 0.0)
        listed = list(rows(x)) if rows else []
        self._r = [_expression(e) for e, _, _ in listed]
        self.m = len(listed)
        self.row_lower = np.array([low for _, low, _ in listed], dtype=float)
        self.row_upper = np.array([high for _, _, high in listed], dtype=float)
        self.x_lower = np.broadcast_to(np.array(lower, dtype=float), (self.n,)).copy()
        self.x_upper = np.broadcast_to(np.array(upper, dtype=float), (self.n,)).copy()
        index = {key: k for k, key in enumerate(self._keys)}
        y = [sym(f"y{k}") for k in range(self.m)]
        lagrangian = sum_of([sym("weight") * self._f, *[yk * rk for yk, rk in zip(y, self._r)]])
        self._gradient = gradient(self._f, self._keys)
        entries = jacobian(self._r, self._keys)
        at = [(row, index.get(col, col)) for row, col in entries]
        self.jac_rows = np.array([row for row, _ in at], dtype=np.int32)
        self.jac_cols = np.array([col for _, col in at], dtype=np.int32)
        self._jac = list(entries.values())
        curved = hessian(lagrangian, self._keys)
        at = [(index.get(row, row), index.get(col, col)) for row, col in curved]
        self.hess_rows = np.array([row for row, _ in at], dtype=np.int32)
        self.hess_cols = np.array([col for _, col in at], dtype=np.int32)
        self._hess = list(curved.values())
        self.var_stage = np.zeros(self.n, dtype=np.int32)
        self.row_stage = np.zeros(self.m, dtype=np.int32)
        self.row_linear = np.array([is_linear(r, self._keys) for r in self._r], dtype=bool)
        self.objective_degree = 3
        self.fixed_curvature = np.zeros(self.n, bool)

    def _at(self, x: np.ndarray) -> dict[str, float]:
        return dict(zip(self._keys, map(float, x)))

    def values(self, x: np.ndarray) -> tuple[float, np.ndarray]:
        env = self._at(x)
        return float(evaluate(self._f, env)), np.array([float(evaluate(r, env)) for r in self._r])

    def derivatives(
        self, x: np.ndarray, multipliers: np.ndarray, objective_factor: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        env = self._at(x)
        first = np.array([float(evaluate(e, env)) for e in self._gradient])
        jac = np.array([float(evaluate(e, env)) for e in self._jac])
        env["weight"] = float(objective_factor)
        env.update({f"y{k}": float(v) for k, v in enumerate(multipliers)})
        return first, jac, np.array([float(evaluate(e, env)) for e in self._hess])


def _expression(e: Expr | float) -> Expr:
    return e if isinstance(e, Expr) else num(float(e))
