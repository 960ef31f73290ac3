"""The optimality conditions as a projection equation, evaluated at fixed places in one call.

See :mod:`stc.solver.active_set` for the equation and what is done with it.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from stc.core.calls import Bound, CallTable, chain_until
from stc.solver import conditions, projection_kernels
from stc.solver.active_set_system import AGAINST_DEPENDENT_ROWS, RestrictedDiagonals, factorize_restricted
from stc.solver.kkt.contract import COARSE, FINE
from stc.solver.nlp import Floats
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
        error: the largest violated condition, dual ones over the size of the multipliers; where compiled functions
            find it, ``errors``.
        evaluate_call: as ``evaluate``; 0 where all is defined and finite.
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
        self.errors = np.full(1, np.inf)
        self._evaluator = ev
        of_x, of_rows, self._largest = np.zeros(3), np.zeros(3), np.zeros(1)
        self.dx, self.dy = np.zeros(n), np.zeros(m)
        kkt = form.attached_kkt
        self._diagonals = RestrictedDiagonals(form, self.active_x, self.active_rows)
        rows, cols = form.jac_rows, form.jac_cols
        project_x = form.held_factor, self.x_target, self.active_x, of_x
        project_rows = form.equality_factor, self.row_target, self.active_rows, of_rows
        of_lagrangian = conditions.gradient_of_lagrangian.bind(
            n, rows.size, rows, cols, self.y, self.gradient, self.jac, self.lagrangian
        )
        self.evaluate_call: Bound = chain_until(
            [
                (ev.values_call, False),
                (projection_kernels.undefined.bind(ev.values_status), True),
                (ev.derivatives_call, False),
                (of_lagrangian, False),
                (
                    conditions.project_entries.bind(n, 1, self.x, self.lagrangian, *form.true_x, *project_x),
                    False,
                ),
                (
                    conditions.project_entries.bind(m, 0, self.r, self.y, *form.true_rows, *project_rows),
                    False,
                ),
                (
                    projection_kernels.judge.bind(n + m, of_x, of_rows, ev.derivatives_status, self.errors),
                    True,
                ),
            ]
        )
        self._restrict = conditions.restrict.bind(
            n, m, form.jac_rows.size, form.hess_rows.size, form.jac_rows, form.jac_cols, form.hess_rows, form.hess_cols,
            self.jac, self.hess, self.active_x, self.active_rows, self.x, self.y, self.r,
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

    @property
    def error(self) -> float:
        """See the class."""
        return float(self.errors[0])

    def evaluate(self) -> bool:
        """Renew everything for what is in ``x`` and ``y``; False where a function is undefined."""
        return not self.evaluate_call()

    def factorize(self, regularity: int = 0) -> tuple[int, bool]:
        """Factorise for the Newton step on the active set; see ``factorize_restricted``."""
        self._restrict()
        return factorize_restricted(self._diagonals, float(self._largest[0]), regularity)


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
        self._table = table = CallTable(projection_kernels.CALLS)
        bind = partial(conditions.advance.bind, form.n, form.m)
        points = one, other = self.point, self.next
        self._places = {id(one): 0, id(other): 1}
        self._advance: list[Bound] = []
        places = projection_kernels.EVALUATE, projection_kernels.REMAINING, projection_kernels.ADVANCE
        for k, (here, there) in enumerate(((one, other), (other, one))):
            advance = bind(
                here.active_x,
                here.active_rows,
                here.x,
                here.y,
                here.dx,
                here.dy,
                self._kkt.solution,
                *form.true_x,
                there.x,
                there.y,
                self.largest,
            )
            self._advance.append(advance)
            for place, call in zip(places, (here.evaluate_call, here.remaining_call, advance), strict=True):
                table.put(place + k, call)
        of_both = [array for p in points for array in (p.active_x, p.active_rows)], [p.errors for p in points]
        self._improve = projection_kernels.improve.bind(
            table.cells, 0, form.n, form.m, 0.0, *of_both[0], *of_both[1], self.largest
        )

    def start(self, x: Floats, y: Floats) -> bool:
        """Begin at ``(x, y)``; False where a function is undefined."""
        self.point.x[:], self.point.y[:] = x, y
        return self.point.evaluate()

    def step(self, tolerance: float) -> bool:
        """Find and evaluate the next point, corrected (see ``improve``); False where there is none.

        Afterwards ``largest[0]`` is the largest change of a variable.
        """
        if not self._solve(COARSE):
            return False
        table, here = self._table, self._places[id(self.point)]
        table.put(projection_kernels.SOLVE, self._kkt.solve_call)
        self._improve.set("here", here)
        self._improve.set("tolerance", tolerance)
        last = self._improve()
        table.check()
        if last == here + 1:
            self.swap()
        return last != 0

    def advance(self) -> bool:
        """Find the next point by Newton's method, not evaluated; False where there is none."""
        if not self._solve(FINE):
            return False
        self._advance[self._places[id(self.point)]]()
        return bool(self.largest[1] == 0.0)

    def _solve(self, accuracy: float) -> bool:
        self.regularity, positive = self.point.factorize(min(self.regularity, AGAINST_DEPENDENT_ROWS))
        if positive:
            self._kkt.accuracy[0] = accuracy
            self._kkt.solve_call()
            self._kkt.check_solution()
        return positive

    def swap(self) -> None:
        """Make the next point the point."""
        self.point, self.next = self.next, self.point
