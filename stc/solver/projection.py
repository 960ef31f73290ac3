"""Points with their optimality conditions as a projection equation, and Newton steps from one to the next.

See :mod:`stc.solver.active_set` for the equation and what is done with it.

In Newton's system on an active set, active variables are held, and rows that are not active are left out:
both nearly, by large diagonals, as those of a barrier method are near its end; and active inequalities give way a
little.  So the matrix is like others before it, and whatever has eliminated those eliminates it as well, which it would
not if entries were missing.  The diagonals are so large that what is left out adds next to nothing even to curvature
that is next to nothing itself; rows that give way leave a millionth of a step or so: the next one, or a correction with
the same factorisation, has it from the true conditions.  (As penalties and shifts that refinements take out: J. Nocedal
and S. J. Wright, Numerical Optimization, 2006, sections 17.1 and 16.3.)
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stc.core.calls import CallTable
from stc.core.functions import function
from stc.core.structures import structure
from stc.solver.constants import CALLS, DERIVATIVES, SOLVE, VALUES
from stc.solver.kkt.contract import COARSE, FINE, KKTSystem, NotFinite
from stc.solver.nlp import Floats
from stc.solver.products import NOTHING
from stc.solver.scaled_problem import ScaledProblem

__all__ = [
    "AGAINST_DEPENDENT_ROWS", "CHANGES", "REFINEMENTS", "Projection", "ProjectionPair", "factorize_restricted",
]  # fmt: skip

CHANGES = 12
"""How many active sets are tried, one after the other."""
REFINEMENTS = 10
"""Solutions are refined so many times at most."""
AGAINST_DEPENDENT_ROWS = 1
"""A value of ``regularity``: the diagonal is shifted against dependent rows, and not for the curvature."""


class Projection:
    """A primal-dual point with its optimality error in projected form, and the Newton step from it.

    Attributes:
        x, y: the point, scaled.
        r: rows, (m,).
        gradient, jac, hess: derivatives at the point.
        lagrangian: ``grad f + J^T y``, (n,); the multipliers of the bounds are its negative.
        active_x: 1 for variables at a bound, else 0, (n,), and ``x_target`` that bound.
        active_rows: 1 for rows at a bound, else 0, (m,), and ``row_target`` that bound.
        s: all that for functions of the core (``primal_dual`` in ``active_set.h``).
        calls: those that they make.
    """

    def __init__(self, form: ScaledProblem) -> None:
        n, m = form.n, form.m
        self._evaluator = ev = form.evaluator()
        self.x, self.y, self.r = ev.x, ev.y, ev.r
        self.gradient, self.jac, self.hess = ev.gradient, ev.jac, ev.hess
        self.lagrangian, self.active_x, self.x_target = (np.zeros(n) for _ in range(3))
        self.active_rows, self.row_target = np.zeros(m), np.zeros(m)
        self.calls = CallTable(CALLS)
        self.calls.put(VALUES, ev.values_call)
        self.calls.put(DERIVATIVES, ev.derivatives_call)
        self.s = structure("primal_dual")(
            nlp=form.program, calls=self.calls.cells, kkt=form.linear_system, x=ev.x, y=ev.y, r=ev.r,
            gradient=ev.gradient, jac=ev.jac, hess=ev.hess, values_status=ev.values_status,
            derivatives_status=ev.derivatives_status, lagrangian=self.lagrangian, active_x=self.active_x,
            active_rows=self.active_rows, x_target=self.x_target, row_target=self.row_target, dx=np.zeros(n),
            dy=np.zeros(m), error=np.inf,
        )  # fmt: skip
        self._kkt = form.attached_kkt
        self._evaluate = function("active_set_evaluate").bind(self.s)
        self._restrict = function("conditions_restrict").bind(self.s)
        self._diagonals = function("conditions_restricted_diagonals").bind(self.s, 0.0, 0.0, 0.0)
        self._find_violation = form.violation_call(self.x, self.r, self.s.array_of("violation"))

    @property
    def f(self) -> float:
        """Objective."""
        return float(self._evaluator.f[0])

    @property
    def violation(self) -> float:
        """The largest violation of a row or a bound in the user's terms."""
        self._find_violation()
        return float(self.s.violation)

    @property
    def error(self) -> float:
        """The largest violated condition, dual ones over the size of the multipliers."""
        return float(self.s.error)

    def evaluate(self) -> bool:
        """Renew everything for what is in ``x`` and ``y``; False where a function is undefined."""
        undefined = self._evaluate()
        self.calls.check()
        return not undefined

    def factorize(self, regularity: int = 0) -> tuple[int, bool]:
        """Factorise for the Newton step on the active set; see ``factorize_restricted``."""
        self._restrict()
        return factorize_restricted(
            self._write_diagonals, float(self.s.largest_curvature), self._kkt, regularity
        )

    def _write_diagonals(self, *values: float) -> None:
        self._diagonals.floats[1:4] = list(values)
        self._diagonals()


class ProjectionPair:
    """A point and the next one, which are swapped after each step.

    Attributes:
        regularity: which of the shifts the last active set needed (see ``factorize_restricted``); the next one begins
            with it, against dependent rows at most.
        change: the largest change of a variable in the last step.
    """

    def __init__(self, form: ScaledProblem) -> None:
        self.point, self.next = Projection(form), Projection(form)
        self.regularity, self.change = 0, 0.0
        self._kkt = form.attached_kkt
        improve, one, other = function("active_set_improve"), self.point.s, self.next.s
        self._improve = {id(one): improve.bind(one, other, 0.0), id(other): improve.bind(other, one, 0.0)}

    def start(self, x: Floats, y: Floats) -> bool:
        """Begin at ``(x, y)``; False where a function is undefined."""
        self.point.x[:], self.point.y[:] = x, y
        return self.point.evaluate()

    def step(self, tolerance: float) -> bool:
        """Find and evaluate the next point, corrected (``active_set_improve``); False where there is none."""
        if not self._solve(COARSE):
            return False
        point, following = self.point, self.next
        for one in (point, following):
            one.calls.put(SOLVE, self._kkt.solve_call)
        improve = self._improve[id(point.s)]
        improve.floats[2] = tolerance
        last = improve()
        point.calls.check()
        following.calls.check()
        self.change = float(point.s.change)
        if last == 1:
            self.swap()
        return last != 0

    def advance(self) -> bool:
        """Find the next point by Newton's method, not evaluated; False where there is none."""
        return self._solve(FINE) and function("conditions_advance")(self.point.s, self.next.s) != 0

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


def factorize_restricted(
    write: Callable[[float, float, float], object], largest: float, kkt: KKTSystem, regularity: int = 0
) -> tuple[int, bool]:
    """Factorise the H and J in the arrays of a KKT system, regularised as much as it takes.

    Args:
        write: writes the diagonals of an active set (``conditions_restricted_diagonals`` in ``active_set.h``).
        largest: entry of the Hessian.
        kkt: the system that its matrix is in.
        regularity: what to begin with: 0 no shift; 1 one against dependent rows; 2 one of the Hessian, too.

    Returns:
        The regularity reached, and whether the curvature on the active set is positive with it.
    """
    size = max(1.0, largest)
    shifts = ((0.0, 0.0), (0.0, NOTHING), (NOTHING * size, NOTHING))
    m = kkt.dual.size
    while True:
        write(*shifts[regularity], size / NOTHING**2)
        try:
            inertia = kkt.refactor()
        except NotFinite:
            return regularity, False
        if inertia.zero == 0 and inertia.negative == m:
            return regularity, True
        if regularity == len(shifts) - 1:
            return regularity, False
        # What is subtracted from the diagonal of the rows makes no eigenvalue positive.
        regularity = len(shifts) - 1 if inertia.negative > m else regularity + 1
