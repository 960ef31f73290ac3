"""The linear system of one iteration, with slacks and gaps eliminated and the inertia under control.

Linearising the optimality conditions of the barrier problem and eliminating the steps of the slacks and of the
gaps' multipliers leaves, with Sigma = z / gap collected per entry of (x, s),

    [ H + Sigma_x + delta_w I    J^T  ] [dx]   [ rhs_x ]
    [ J                          -D   ] [dy] = [ rhs_y ],      D = 1 / Sigma_s  (inequalities),  delta_c (equalities)

whose sparsity never changes.  The step is a descent direction when the matrix has n positive and m negative
eigenvalues; delta_w grows until it has (Waechter and Biegler 2006, algorithm IC).

Where the objective bends upwards, as efforts do, it is the rows that make H indefinite, with multipliers far from
those of the solution.  There only a share of their part of H is used,

    H_f + share * sum y_i H_i,

between Newton's method and that of Gauss and Newton (Nazareth 1980): it needs smaller shifts, and they make longer
steps.
"""

from __future__ import annotations

import numpy as np

from stc.solver.constants import ATTEMPT, DONE, GROWTH, LARGEST_SHIFT, NO_SHIFT, SMALLEST_SHIFT, UNKNOWN
from stc.solver.kkt.contract import Inertia, NotFinite
from stc.solver.nlp import Floats
from stc.solver.products import inner
from stc.solver.workspace import Workspace

__all__ = ["NewtonSystem", "SingularSystem"]

SHORTER = 10.0


class SingularSystem(ArithmeticError):
    """No regularisation gave the matrix the inertia that a descent direction needs."""


class NewtonSystem:
    """Factorises and solves the system above for the iterates of a workspace."""

    def __init__(self, work: Workspace) -> None:
        self.work = work
        self.form = form = work.form
        self._before = (0.0, 0.0)
        s = work.s
        s.shift = s.dual_shift = s.last_shift = s.stiffness = s.slow_before = 0.0
        s.failures = s.untried = s.exact = s.slow_steps = 0
        s.bends = 0 if form.linear else UNKNOWN
        s.bends_alike = form.quadratic_objective
        work.renew_calls()

    @property
    def shift(self) -> float:
        """The delta_w in use."""
        return float(self.work.s.shift)

    def factorize(self, mu: float, *, exact: bool = False) -> None:
        """Factorise at the iterate, shifting until the inertia is right.

        Args:
            mu: the barrier parameter, which says how much dependent rows may give way.
            exact: use the whole Hessian, whatever its inertia.

        Raises:
            SingularSystem: when no shift helps.
        """
        s = self.work.s
        before = s.mu
        s.mu, s.exact = mu, exact
        try:
            self.work.begin()
            self.go_on(self.work.factorize())
        finally:
            s.mu, s.exact = before, 0

    def go_on(self, ended: int) -> None:
        """Do what a factorisation of the core that has ended so cannot do, until it is done.

        Raises:
            SingularSystem: when no shift helps.
        """
        work = self.work
        work.calls.check()
        while ended != DONE:
            if ended == NO_SHIFT:
                raise SingularSystem
            self._refactor(work.s.ended)
            ended = work.factorize()
            work.calls.check()

    def _refactor(self, ended: int = 0) -> Inertia:
        """Factorise the matrix, after an attempt that ended so where there was one."""
        work = self.work
        work.calls.put(ATTEMPT, None)
        try:
            inertia = work.kkt.resume(ended) if ended else work.kkt.refactor()
        except NotFinite as error:  # a derivative or the ratio of a multiplier to its gap has overflowed
            raise SingularSystem from error
        work.renew_calls()
        work.renew_solves()
        work.kkt.inertia[:] = inertia
        return inertia

    def _is_right(self) -> bool:
        """Factorise with the present shifts. Returns whether the inertia is right."""
        self.work.run("step_shifted")
        inertia = self._refactor()
        return inertia.zero == 0 and inertia.negative == self.form.m

    def stiffen(self, dw: Floats) -> None:
        """Factorise with a shift that makes a step like ``dw`` (n + m,) shorter, :data:`SHORTER` times.

        Raises:
            SingularSystem: the matrix cannot be factorised.
        """
        form, work = self.form, self.work
        s = work.s
        dx = dw[: form.n]
        curved = form.hessian_times(work.it.hess, dx) + work.sigma[: form.n] * dx
        curvature = inner(dx, curved) / max(inner(dx, dx), 1e-300) + s.shift
        self._before = s.stiffness, s.shift
        s.shift = s.stiffness = max(GROWTH * s.shift, SHORTER * abs(curvature), SMALLEST_SHIFT)
        while not self._is_right():
            s.shift = work.run("inertia_correction_larger_shift")
            if s.shift > LARGEST_SHIFT:
                raise SingularSystem

    def soften(self) -> None:
        """Forget the last stiffening; the factorisation stays."""
        self.work.s.stiffness, self.work.s.shift = self._before

    def bears(self, shift: float) -> bool:
        """Whether a shift is large enough: it is at least the present one, or the inertia is right with it."""
        s = self.work.s
        before = s.shift
        if before <= shift:
            return True
        s.shift = shift
        if self._is_right():
            return True
        s.shift = before
        return False

    def tighten(self) -> None:
        """Halve the shift as often as the inertia stays right, and factorise with the last one."""
        s = self.work.s
        if s.shift == 0.0:
            return
        while s.shift > SMALLEST_SHIFT:
            s.shift *= 0.5
            if not self._is_right():
                s.shift *= 2.0
                break
        self._is_right()

    def solve(self, rhs_w: Floats, c: Floats) -> tuple[Floats, Floats]:
        """Steps ``(dw, dy)`` for a right-hand side ``rhs_w`` (n + m,) of the dual part and residual ``c`` (m,)."""
        form = self.form
        n = form.n
        scaled = np.where(form.inequality, self.work.dual_diagonal * rhs_w[n:], 0.0)
        dx, dy = form.kkt.solve(rhs_w[:n], scaled - c)
        if form.any_held:
            dx[form.held] = 0.0
        dw = np.empty(form.size)
        dw[:n] = dx
        dw[n:] = np.where(form.inequality, form.jacobian_times(self.work.it.jac, dx) + c, 0.0)
        return dw, dy
