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

from stc.solver.kkt.contract import NotFinite
from stc.solver.nlp import Floats
from stc.solver.products import inner
from stc.solver.workspace import Step, Workspace

__all__ = ["NewtonSystem", "SingularSystem"]

FIRST_SHIFT = 1e-4
ORDINARY = (1e-6, 1e2)
SMALLEST_SHIFT = 1e-20
LARGEST_SHIFT = 1e40
GROWTH_AT_FIRST = 100.0
GROWTH = 8.0
GROWTH_IN_VAIN = 64.0
"""After a shift that has left as many eigenvalues negative as the one before."""
DECAY = 1.0 / 3.0
DUAL_SHIFT = 1e-8
ALWAYS = 3
"""Iterations in a row that met dependent rows, after which they are expected."""
MOST_UNTRIED = 3
"""Iterations in a row at most in which a matrix without a shift is not tried, after it has failed again and again."""
MOST_DAMPED = 8
"""The same where there is the rows' part to be damped; no more than it had negative eigenvalues too many."""
COARSE = 1e-10
"""Relative residual that is enough for a step while steps are smooth and no rows depend on one another.

Elsewhere errors are multiplied.
"""
SMOOTH = 3
"""Steps in a row that were accepted nearly whole."""
WHOLE = 0.5
SOFTER = 0.01
SMALLEST_STIFFNESS = 1e-8
BENT = 0.05
"""Share of the variables that an objective has to bend at least."""


class SingularSystem(ArithmeticError):
    """No regularisation gave the matrix the inertia that a descent direction needs."""


class NewtonSystem:
    """Factorises and solves the system above for the iterates of a workspace.

    Attributes:
        shift: the delta_w in use.
        dual_shift: the delta_c in use.
        deficient: True when the last factorisation met dependent rows.
    """

    def __init__(self, work: Workspace) -> None:
        self.work = work
        self.form = form = work.form
        self.shift = 0.0
        self.dual_shift = 0.0
        self.deficient = False
        self._last_shift = 0.0
        self._stiffness = 0.0
        self._before = (0.0, 0.0)
        self._any_equality = bool(form.equality.any())
        self._deficiencies = 0
        self._failures = self._untried = 0
        self._smooth = 0
        self._whole = True
        self._excess = 0  # negative eigenvalues of the last matrix tried beyond those that there should be
        self._bends: bool | None = False if form.linear else None
        place = work.shifted_call.position
        self._places = place("shift"), place("dual_shift")

    def factorize(self, mu: float, *, exact: bool = False) -> None:
        """Factorise at the iterate, shifting until the inertia is right.

        Args:
            mu: the barrier parameter, which says how much dependent rows may give way.
            exact: use the whole Hessian, whatever its inertia.

        Raises:
            SingularSystem: when no shift helps.
        """
        self.work.diagonals_call()
        self._whole = True
        self.shift = self._stiffness
        untried = self._untried > 0 and self.shift == 0.0
        if untried:  # without a shift: it has failed again and again
            self._untried -= 1
            self.shift = max(SMALLEST_SHIFT, DECAY * self._last_shift)
            if not exact:
                self._damp()
        dual_shift = DUAL_SHIFT * max(mu, 1e-12) ** 0.25
        # Rows that have been dependent all the time are so by their structure.
        self.deficient = self._deficiencies >= ALWAYS
        self.dual_shift = dual_shift if self.deficient else 0.0
        before = 0
        while True:
            verdict = self._try()
            if verdict == "good":
                break
            growth = GROWTH_IN_VAIN if self._excess == before and not self._whole else GROWTH
            before = self._excess
            if verdict == "singular" and self.dual_shift == 0.0 and self._any_equality:
                self.dual_shift = dual_shift
                self.deficient = True
                if self.shift == 0.0:
                    continue
            if self.shift == 0.0:
                self._failures += 1
                self._untried = min(self._failures - 1, MOST_UNTRIED)
            if verdict == "indefinite" and not exact and self._damp():
                if self._untried > 0:
                    self._untried = max(self._untried, min(self._excess, MOST_DAMPED))
                if self.shift > 0.0:
                    continue
            self.shift = self._larger_shift(growth)
        if self._smooth >= SMOOTH and not self.deficient:
            self.work.kkt.accuracy[0] = COARSE
        if self.shift == 0.0:
            self._failures = 0
        self._deficiencies = self._deficiencies + 1 if self.deficient else 0
        if self.shift > 0.0:
            self._last_shift = self.shift

    def _damp(self) -> bool:
        """Use a share of the rows' part of the Hessian only; False when that is so already, or of no use."""
        if not self._whole or self._bends is False:
            return False
        work, form = self.work, self.form
        if self._bends is None or not form.quadratic_objective:
            work.bend_call()
        if self._bends is None:
            diagonal = work.bend[form.hess_rows == form.hess_cols]
            bent = np.count_nonzero(diagonal > 0.0) >= BENT * form.n
            self._bends = bool(bent and diagonal.min() >= 0.0)
            if not self._bends:
                return False
        work.damped_call()
        self._whole = False
        return True

    def stiffen(self, dw: Floats, shorter: float) -> None:
        """Factorise with a shift that makes a step like ``dw`` (n + m,) ``shorter`` times shorter.

        Raises:
            SingularSystem: the matrix cannot be factorised.
        """
        form, work = self.form, self.work
        dx = dw[: form.n]
        curved = form.hessian_times(work.it.hess, dx) + work.sigma[: form.n] * dx
        curvature = inner(dx, curved) / max(inner(dx, dx), 1e-300) + self.shift
        self._before = self._stiffness, self.shift
        self.shift = max(GROWTH * self.shift, shorter * abs(curvature), SMALLEST_SHIFT)
        self._stiffness = self.shift
        while self._try() != "good":
            self.shift = self._larger_shift()

    def soften(self) -> None:
        """Forget the last stiffening; the factorisation stays."""
        self._stiffness, self.shift = self._before

    def relax(self, length: float) -> None:
        """Let the stiffness go as steps are accepted nearly whole, and at once where none is (``length`` 0).

        A shift that did not even lead to a step is none to start from next time.
        """
        if length == 0.0:
            self._stiffness = 0.0
        elif self.shift > 0.0:
            self._last_shift = self.shift
        self._smooth = self._smooth + 1 if length >= WHOLE else 0
        if length >= WHOLE:
            self._stiffness *= SOFTER
            if self._stiffness < SMALLEST_STIFFNESS:
                self._stiffness = 0.0

    def tighten(self) -> None:
        """Halve the shift as often as the inertia stays right, and factorise with the last one."""
        if self.shift == 0.0:
            return
        while self.shift > SMALLEST_SHIFT:
            self.shift *= 0.5
            if self._try() != "good":
                self.shift *= 2.0
                break
        self._try()

    def _ordinary_curvature(self) -> float:
        """What shifts are measured in: the Hessian's entries shrink with the steps of a finer motion."""
        form = self.form
        diagonal = np.abs(self.work.it.hess[form.hess_rows == form.hess_cols])
        diagonal = diagonal[diagonal > 0.0]
        if not diagonal.size:
            return 1.0
        middle = (
            diagonal.size // 2
        )  # np.median imports masked arrays first, which takes longer than a small solve
        return float(np.clip(np.partition(diagonal, middle)[middle], *ORDINARY))

    def _larger_shift(self, growth: float = GROWTH) -> float:
        if self.shift == 0.0:
            if self._last_shift == 0.0:
                return FIRST_SHIFT * self._ordinary_curvature()
            return max(SMALLEST_SHIFT, DECAY * self._last_shift)
        grown = self.shift * (GROWTH_AT_FIRST if self._last_shift == 0.0 else growth)
        if grown > LARGEST_SHIFT:
            raise SingularSystem
        return grown

    def _try(self) -> str:
        work = self.work
        shifted = work.shifted_call
        shifted.floats[self._places[0]], shifted.floats[self._places[1]] = self.shift, self.dual_shift
        shifted()
        try:
            inertia = work.kkt.refactor()
        except NotFinite as error:  # a derivative or the ratio of a multiplier to its gap has overflowed
            raise SingularSystem from error
        self._excess = inertia.negative - self.form.m
        if inertia.zero > 0 or self._excess < 0:
            return "singular"
        return "good" if self._excess == 0 else "indefinite"

    def solve(self, rhs_w: Floats, c: Floats) -> tuple[Floats, Floats]:
        """Steps ``(dw, dy)`` for a right-hand side ``rhs_w`` (n + m,) of the dual part and residual ``c`` (m,)."""
        form = self.form
        n = form.n
        scaled = np.where(form.inequality, self.work.d * rhs_w[n:], 0.0)
        dx, dy = form.kkt.solve(rhs_w[:n], scaled - c)
        if form.any_held:
            dx[form.held] = 0.0
        dw = np.empty(form.size)
        dw[:n] = dx
        dw[n:] = np.where(form.inequality, form.jacobian_times(self.work.it.jac, dx) + c, 0.0)
        return dw, dy

    def find_step(self, step: Step, c: Floats | None = None, name: str = "newton") -> None:
        """Fill ``step`` with that towards ``gap * z = centre * gap`` and zero residual, ``centre`` as in the workspace.

        Args:
            c: residual of the rows, (m,), always the same array for a name; the iterate's own when None.
        """
        self.work.solve(name, step, self.work.it.c if c is None else c)
