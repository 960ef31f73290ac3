"""The elastic form of a problem: rows may be violated, at a price.

    minimise    weight * f(x) + price * sum(p + q) + 1/2 * |proximity * (x - reference)|^2
    subject to  r(x) - p + q - s = 0,    p, q >= 0,    bounds on (x, s) as before

Its constraints always have independent gradients.  p and q are eliminated before the factorisation, where they
add ``1 / P_p + 1 / P_q`` to the dual diagonal of their row, P being their entries of the primal diagonal:

    [ H + P_x   0    J^T ] [dx]                      [ H + P_x   J^T                   ] [dx]
    [   0      P_pq  E^T ] [d(p, q)]       ==>       [   J      -(D + E P_pq^-1 E^T)   ] [dy]
    [   J       E   -D   ] [dy]

so the sparsity, and the linear algebra, are those of the problem itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate, evaluate
from stc.solver.nlp import Floats
from stc.solver.products import inner
from stc.solver.scaled_problem import ScaledProblem

if TYPE_CHECKING:
    from stc.solver.kkt.contract import Inertia, KKTSystem

__all__ = ["ElasticKKT", "ElasticProblem"]

HELD = 1e-7
"""Slopes of the sum of violations, of which a row's scaled gradients are parts, down to this count."""


class ElasticKKT:
    """A KKT system in (x, p, q) on top of one in x."""

    def __init__(self, base: KKTSystem, n: int, m: int, jac_entries: int) -> None:
        self._base = base
        self._n, self._m, self._jac_entries = n, m, jac_entries
        self._p_inverse = self._q_inverse = self._column_p = self._column_q = np.zeros(m)

    @property
    def factorizations(self) -> int:
        """Factorisations of the underlying system."""
        return self._base.factorizations

    @property
    def nnz_factor(self) -> int:
        """Entries of the underlying factorisation."""
        return self._base.nnz_factor

    @property
    def last_residual(self) -> float:
        """Residual of the underlying system's last solve."""
        return self._base.last_residual

    def factorize(
        self, hess_values: Floats, jac_values: Floats, primal_diagonal: Floats, dual_diagonal: Floats
    ) -> Inertia:
        """As the underlying system, (p, q) eliminated; their entries of the primal diagonal must be positive."""
        jac, primal = jac_values, primal_diagonal
        n, m, k = self._n, self._m, self._jac_entries
        self._column_p, self._column_q = jac[k : k + m], jac[k + m :]
        self._p_inverse, self._q_inverse = 1.0 / primal[n : n + m], 1.0 / primal[n + m :]
        dual = dual_diagonal + self._column_p**2 * self._p_inverse + self._column_q**2 * self._q_inverse
        inertia = self._base.factorize(hess_values, jac[:k], primal[:n], dual)
        return type(inertia)(inertia.positive + 2 * m, inertia.negative, inertia.zero)

    def solve(self, rhs_x: Floats, rhs_y: Floats) -> tuple[Floats, Floats]:
        """Steps of (x, p, q) and y."""
        n, m = self._n, self._m
        rhs_p, rhs_q = rhs_x[n : n + m], rhs_x[n + m :]
        rhs = rhs_y - self._column_p * self._p_inverse * rhs_p - self._column_q * self._q_inverse * rhs_q
        dx, dy = self._base.solve(rhs_x[:n], rhs)
        dp = self._p_inverse * (rhs_p - self._column_p * dy)
        dq = self._q_inverse * (rhs_q - self._column_q * dy)
        return np.concatenate([dx, dp, dq]), dy


class ElasticProblem(Formulation):
    """The elastic form of a scaled problem.

    Attributes:
        base: the problem itself.
        price: cost of one unit of violation of a scaled row.
        weight: factor of the objective; 0 looks for feasibility alone.
    """

    def __init__(
        self, base: ScaledProblem, *, price: float, weight: float, reference: Floats | None, proximity: float
    ) -> None:
        n, m = base.n, base.m
        self.base, self.price, self.weight = base, price, weight
        self.n, self.m = n + 2 * m, m
        free_lower, free_upper = base.lower, base.upper
        x_lower = np.where(base.held, base.held_value, free_lower[:n])
        x_upper = np.where(base.held, base.held_value, free_upper[:n])
        row_lower = np.where(base.equality, base.target, free_lower[n:])
        row_upper = np.where(base.equality, base.target, free_upper[n:])
        limit = np.where(base.ignored, 0.0, np.inf)
        zeros = np.zeros(m)
        self._set_bounds(
            np.concatenate([x_lower, zeros, zeros]),
            np.concatenate([x_upper, limit, limit]),
            row_lower,
            row_upper,
        )
        rows = np.arange(m)
        self._set_pattern(
            np.concatenate([base.jac_rows, rows, rows]),
            np.concatenate([base.jac_cols, n + rows, n + m + rows]),
            base.hess_rows,
            base.hess_cols,
        )
        live = np.where(base.ignored, 0.0, 1.0)
        self._columns = np.concatenate([-live, live])
        self._reference = np.zeros(n) if reference is None else reference
        self._curvature = np.zeros(n)
        if proximity > 0.0:
            self._curvature = (
                proximity * np.minimum(1.0, 1.0 / np.maximum(np.abs(self._reference), 1e-8)) ** 2
            )
        self.extra_diagonal = np.concatenate([self._curvature, zeros, zeros])
        self.kkt = ElasticKKT(base.kkt, n, m, base.jac_rows.size)
        self.linear = base.linear
        self.quadratic_program = base.quadratic_program

    def split(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Views of ``x`` (n + 2 m,) as the problem's variables, p and q."""
        n, m = self.base.n, self.m
        return x[:n], x[n : n + m], x[n + m :]

    def is_held(self, x: Floats) -> bool:
        """Whether being away from the reference has a cost whose slope counts beside those of violated rows.

        Args:
            x: the problem's variables, (n,).
        """
        slope = self._curvature * (x - self._reference)
        return float(np.abs(slope).max(initial=0.0)) > HELD * self.price

    def values(self, x: Floats) -> tuple[float, Floats]:
        own, p, q = self.split(x)
        f, r = self.base.values(own)
        away = own - self._reference
        cost = self.price * float(p.sum() + q.sum()) + 0.5 * inner(self._curvature, away * away)
        if self.weight:
            cost += self.weight * f
        return cost, r - p + q

    def derivatives(self, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        own, _, _ = self.split(x)
        gradient, jac, hess = self.base.weighted_derivatives(own, y, self.weight)
        full = np.full(self.n, self.price)
        full[: self.base.n] = self._curvature * (own - self._reference)
        if self.weight:
            full[: self.base.n] += self.weight * gradient
        if self.any_held:
            full[self.held] = 0.0
        return full, np.concatenate([jac, self._columns]), hess

    def user_variables(self, x: Floats) -> Floats:
        return self.base.user_variables(self.split(x)[0])

    def user_measures(self, x: Floats, f: float, r: Floats) -> tuple[float, float]:
        own, p, q = self.split(x)
        f_own, _ = self.base.values(own)
        return self.base.user_measures(own, f_own, r + p - q)

    def start(self, w: Floats, y: Floats, z_base: Floats, mu: float) -> Iterate:
        """An iterate at the problem's own point ``w`` (n + m,), p and q optimal for it at ``mu``.

        Args:
            y: row multipliers to begin with, (m,).
            z_base: the problem's own gap multipliers, (gaps of the base,).
        """
        base, price = self.base, self.price
        n = base.n
        _, r = base.values(w[:n])
        c = base.residual(r, w)
        half = (mu - price * c) / (2.0 * price)
        q = half + np.sqrt(half * half + mu * c / (2.0 * price))
        q = np.maximum(q, 1e-12)
        p = np.maximum(c + q, 1e-12)
        p[base.ignored] = q[base.ignored] = 0.0
        full = np.concatenate([w[:n], p, q, w[n:]])
        z = mu / self.gap(full)
        own = ~((self.index >= n) & (self.index < self.n))
        z[own] = np.minimum(price, z_base)
        return evaluate(self, full, y, z)
