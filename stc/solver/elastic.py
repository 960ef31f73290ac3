"""The elastic form of a problem: rows may be violated, at a price, and the objective is left aside.

    minimise    price * sum(p + q) + 1/2 * |proximity * (x - reference)|^2
    subject to  r(x) - p + q - s = 0,    p, q >= 0,    bounds on (x, s) as before

Its constraints always have independent gradients.  p and q are unknowns of the linear system like others: each has one
entry besides its diagonal, and is eliminated first, with its row's stage.
"""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING

import numpy as np

from stc.core.calls import chain
from stc.core.functions import function
from stc.core.structures import structure
from stc.solver.evaluator import Evaluator
from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate
from stc.solver.kkt.reuse import new_system
from stc.solver.nlp import Floats
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.workspace import workspace_of

if TYPE_CHECKING:
    from stc.core.calls import Bound

__all__ = ["ElasticProblem"]


class ElasticProblem(Formulation):
    """The elastic form of a scaled problem.

    Attributes:
        base: the problem itself.
        price: cost of one unit of violation of a scaled row.
    """

    def __init__(self, base: ScaledProblem, *, price: float = 1.0) -> None:
        n, m = base.n, base.m
        self._base = weakref.ref(base)  # which may keep this one
        self.price = price
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
        self.own_gaps = (self.index < n) | (self.index >= self.n)  # those of the problem itself
        rows = np.arange(m)
        self._set_pattern(
            np.concatenate([base.jac_rows, rows, rows]),
            np.concatenate([base.jac_cols, n + rows, n + m + rows]),
            base.hess_rows,
            base.hess_cols,
        )
        live = np.where(base.ignored, 0.0, 1.0)
        self._columns = np.concatenate([-live, live])
        self._reference = np.zeros(n)
        self.extra_diagonal = np.zeros(n + 2 * m)
        self._curvature = self.extra_diagonal[:n]
        stages, row_stages = base.nlp.var_stage, base.nlp.row_stage
        # Not one that another problem has left: its order of elimination would change the last digits.
        self.kkt = self._factorisation = new_system(
            self.n, m, self.jac_rows, self.jac_cols, self.hess_rows, self.hess_cols,
            np.concatenate([stages, row_stages, row_stages]), row_stages, self.held,
        )  # fmt: skip
        self._own_evaluator = base.evaluator()  # of the problem itself
        self.linear = base.linear

    @property
    def base(self) -> ScaledProblem:
        """The problem itself."""
        base = self._base()
        assert base is not None
        return base

    def stay_near(self, reference: Floats, proximity: float) -> None:
        """Begin anew, and stay near a point of the problem, (n,), from now on."""
        self._factorisation.restart()
        self._reference[:] = reference
        self._curvature[:] = proximity * np.minimum(1.0, 1.0 / np.maximum(np.abs(reference), 1e-8)) ** 2

    def split(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Views of ``x`` (n + 2 m,) as the problem's variables, p and q."""
        n, m = self.base.n, self.m
        return x[:n], x[n : n + m], x[n + m :]

    def is_held(self, x: Floats, tolerance: float) -> bool:
        """Whether being away from the reference has a cost whose slope counts beside those of violated rows.

        Args:
            x: the problem's variables, (n,).
            tolerance: slopes of the sum of violations, of which a row's scaled gradients are parts, down to this count.
        """
        slope = self._curvature * (x - self._reference)
        return float(np.abs(slope).max(initial=0.0)) > tolerance * self.price

    def values(self, x: Floats) -> tuple[float, Floats]:
        ev = workspace_of(self).evaluator
        ev.x[:] = x
        ev.values_call()
        return float(ev.f[0]), ev.r.copy()

    def evaluator(self) -> Evaluator:
        base, plain, n, m = self.base, self._own_evaluator, self.base.n, self.m
        entries = base.jac_rows.size
        ev = Evaluator.allocate(self.n, m, self.jac_rows.size, 0)
        ev.hess = plain.hess
        ev.derivatives_status = plain.derivatives_status
        plain.weight[0] = 0.0
        ev.gradient[n:] = np.where(self.held, 0.0, self.price)[n:]
        ev.jac[entries:] = self._columns
        place = function("point_copy").bind(n, ev.x, plain.x)
        place_multipliers = function("point_copy").bind(m, ev.y, plain.y)
        program = structure("elastic_program")(
            n=n, m=m, jac_entries=entries, price=self.price, free=base.free_factor, curvature=self._curvature,
            reference=self._reference, own=plain.structure(), at=ev.structure(),
        )  # fmt: skip
        values, derivatives = (
            function(f"elastic_{name}").bind(program) for name in ("values", "derivatives")
        )
        ev.values_call = chain([place, plain.values_call, values])
        ev.derivatives_call = chain([place, place_multipliers, plain.derivatives_call, derivatives])
        return ev

    def watch_call(self, it: Iterate, violation: Floats, stated: Floats) -> Bound:
        base, plain = self.base, self._own_evaluator
        return chain(
            [
                function("point_copy").bind(base.n, it.w, plain.x),
                plain.values_call,
                base.violation_call(plain.x, plain.r, violation),
                function("gather_place").bind(1, plain.f, np.array([1.0 / base.objective_unit]), stated),
            ]
        )

    def user_variables(self, x: Floats) -> Floats:
        return self.base.user_variables(self.split(x)[0])

    def start(self, w: Floats, y: Floats, z_base: Floats, mu: float) -> Iterate:
        """Move the workspace's iterate to the problem's own point ``w`` (n + m,), p and q optimal for it at ``mu``.

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
        z[self.own_gaps] = np.minimum(price, z_base)
        return workspace_of(self).evaluate(full, y, z)
