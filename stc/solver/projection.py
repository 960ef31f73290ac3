"""The optimality conditions as a projection equation, evaluated at fixed places in one call.

See :mod:`stc.solver.active_set` for the equation and what is done with it.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from stc.codegen.calls import Bound, chain
from stc.solver import conditions
from stc.solver.nlp import Floats
from stc.solver.passes import multiplier_scale
from stc.solver.restricted import AGAINST_DEPENDENT_ROWS, RestrictedDiagonals, factorize_restricted
from stc.solver.scaled_problem import ScaledProblem

__all__ = ["Projection", "ProjectionPair"]


class Projection:
    """A primal-dual point with its optimality error in projected form, and the Newton step from it.

    Attributes:
        x, y: the point, scaled.
        f, r: objective and rows (m,).
        gradient, jac, hess: derivatives at the point.
        lagrangian: ``grad f + J^T y``, (n,); the multipliers of the bounds are its negative.
        active_x: 1 for variables at a bound, else 0, (n,), and ``x_target`` that bound.
        active_rows: 1 for rows at a bound, else 0, (m,), and ``row_target`` that bound.
        error: the largest violated condition, dual ones over the size of the multipliers.
    """

    def __init__(self, form: ScaledProblem) -> None:
        n, m = form.n, form.m
        ev = form.evaluator()
        self.x, self.y, self.r, self.gradient, self.jac, self.hess = (
            ev.x,
            ev.y,
            ev.r,
            ev.gradient,
            ev.jac,
            ev.hess,
        )
        self.lagrangian = np.zeros(n)
        self.active_x, self.x_target = np.zeros(n), np.zeros(n)
        self.active_rows, self.row_target = np.zeros(m), np.zeros(m)
        self.error = math.inf
        self._evaluator = ev
        self._of_x, self._of_rows, self._largest = np.zeros(3), np.zeros(3), np.zeros(2)
        self.dx, self.dy = np.zeros(n), np.zeros(m)
        kkt = form.attached_kkt
        self._diagonals = RestrictedDiagonals(kkt, self.active_x, self.active_rows)
        self._count = n + m
        rows, cols = form.jac_rows, form.jac_cols
        project_x = form.held_factor, self.x_target, self.active_x, self._of_x
        project_rows = form.equality_factor, self.row_target, self.active_rows, self._of_rows
        self._derive = chain(
            [
                ev.derivatives_call,
                conditions.gradient_of_lagrangian.bind(
                    n, rows.size, rows, cols, self.y, self.gradient, self.jac, self.lagrangian
                ),
                conditions.project_entries.bind(n, 1, self.x, self.lagrangian, *form.true_x, *project_x),
                conditions.project_entries.bind(m, 0, self.r, self.y, *form.true_rows, *project_rows),
            ]
        )
        self._restrict = conditions.restrict.bind(
            n, m, form.jac_rows.size, form.hess_rows.size, form.jac_rows, form.jac_cols, form.hess_rows, form.hess_cols,
            self.jac, self.hess, form.held_factor, self.active_x, self.active_rows, self.x, self.y, self.r,
            self.lagrangian, self.x_target, self.row_target, self.dx, self.dy, kkt.hess, kkt.jac, kkt.rhs,
            self._largest,
        )  # fmt: skip

        self._violation = np.zeros(1)
        self._find_violation = form.violation_call(self.x, self.r, self._violation)
        self.remaining_call: Bound = conditions.remaining.bind(
            n,
            m,
            self.active_x,
            self.active_rows,
            self.lagrangian,
            self.row_target,
            self.r,
            self.dx,
            self.dy,
            kkt.rhs,
        )

    @property
    def f(self) -> float:
        """See the class."""
        return float(self._evaluator.f[0])

    @property
    def violation(self) -> float:
        """The largest violation of a row or a bound in the user's terms."""
        self._find_violation()
        return float(self._violation[0])

    def evaluate(self) -> bool:
        """Renew everything for what is in ``x`` and ``y``; False where a function is undefined."""
        ev = self._evaluator
        ev.values_call()
        if ev.values_status[0] != 0.0:
            return False
        self._derive()
        (primal, dual, total), (primal_rows, dual_rows, total_rows) = (
            self._of_x.tolist(),
            self._of_rows.tolist(),
        )
        scale = multiplier_scale(total + total_rows, self._count)
        self.error = max(primal, primal_rows, max(dual, dual_rows) / scale)
        check = self.error + dual + dual_rows + ev.derivatives_status[0]
        return bool(check - check == 0.0)

    def factorize(self, regularity: int = 0) -> tuple[int, bool]:
        """Factorise for the Newton step on the active set; see ``factorize_restricted``."""
        self._restrict()
        largest, irregular = self._largest.tolist()
        return factorize_restricted(self._diagonals, largest, regularity, irregular=irregular != 0.0)

    def is_on_active_set_of(self, other: Projection) -> bool:
        """Whether the same bounds and rows are active at another point."""
        # The masks are 0 or 1: the same where their bytes are.
        same_x = self.active_x.tobytes() == other.active_x.tobytes()
        return same_x and self.active_rows.tobytes() == other.active_rows.tobytes()


class ProjectionPair:
    """A point and the next one, which change places after each step.

    Attributes:
        regularity: which of the shifts the last active set needed (see ``factorize_restricted``); the next one begins
            with it, against dependent rows at most.
    """

    def __init__(self, form: ScaledProblem) -> None:
        self.point, self.next = Projection(form), Projection(form)
        self.regularity = 0
        self.largest = np.zeros(2)
        self._kkt = form.attached_kkt
        bind = partial(conditions.advance.bind, form.n, form.m)
        self._advance: dict[int, Bound] = {
            id(one): bind(
                one.x, one.y, one.dx, one.dy, self._kkt.solution, *form.true_x, other.x, other.y, self.largest
            )
            for one, other in ((self.point, self.next), (self.next, self.point))
        }

    def start(self, x: Floats, y: Floats) -> bool:
        """Begin at ``(x, y)``; False where a function is undefined."""
        self.point.x[:], self.point.y[:] = x, y
        return self.point.evaluate()

    def step(self) -> bool:
        """Find and evaluate the next point; False where there is none."""
        return self.advance() and self.next.evaluate()

    def advance(self) -> bool:
        """Find the next point by Newton's method; False where there is none.

        Afterwards ``largest[0]`` is the largest change of a variable.
        """
        self.regularity, positive = self.point.factorize(min(self.regularity, AGAINST_DEPENDENT_ROWS))
        if not positive:
            return False
        self._kkt.solve_call()
        self._kkt.check_solution()
        self._advance[id(self.point)]()
        return bool(self.largest[1] == 0.0)

    def correct(self) -> bool:
        """Step once more with the same factorisation, from the next point to where the point has been.

        This makes a factorisation gain as much as one and a half Newton steps (J. F. Traub, Iterative methods for the
        solution of equations, 1964, section 8.4). False where that comes no closer; the next point is as it was.
        """
        if not self.next.is_on_active_set_of(self.point):
            return False
        self.next.remaining_call()
        self._kkt.solve_call()
        change = float(self.largest[0])
        self._advance[id(self.next)]()
        if self.largest[1] == 0.0 and self.point.evaluate() and self.point.error < self.next.error:
            self.largest[0] += change
            self.swap()
            return True
        self.largest[0] = change
        return False

    def swap(self) -> None:
        """Make the next point the point."""
        self.point, self.next = self.next, self.point
