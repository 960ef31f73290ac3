"""The linear system of one iteration, with slacks and gaps eliminated and the inertia under control.

Linearising the optimality conditions of the barrier problem and eliminating the steps of the slacks and of the
gaps' multipliers leaves, with Sigma = z / gap collected per entry of (x, s),

    [ H + Sigma_x + delta_w I    J^T  ] [dx]   [ rhs_x ]
    [ J                          -D   ] [dy] = [ rhs_y ],      D = 1 / Sigma_s  (inequalities),  delta_c (equalities)

whose sparsity never changes.  The step is a descent direction when the matrix has n positive and m negative
eigenvalues; delta_w grows until it has (Waechter and Biegler 2006, algorithm IC).
"""

from __future__ import annotations

import numpy as np

from stc.solver.formulation import Formulation, summed
from stc.solver.iterate import Iterate
from stc.solver.kkt.contract import NotFinite
from stc.solver.nlp import Floats
from stc.solver.products import inner

__all__ = ["NewtonSystem", "SingularSystem"]

FIRST_SHIFT = 1e-4
ORDINARY = (1e-6, 1e2)
SMALLEST_SHIFT = 1e-20
LARGEST_SHIFT = 1e40
GROWTH_AT_FIRST = 100.0
GROWTH = 8.0
DECAY = 1.0 / 3.0
DUAL_SHIFT = 1e-8
ALWAYS = 3
"""Iterations in a row that met dependent rows, after which they are expected."""
SMALLEST_SIGMA = 1e-16
WHOLE = 0.5
SOFTER = 0.01
SMALLEST_STIFFNESS = 1e-8


class SingularSystem(ArithmeticError):
    """No regularisation gave the matrix the inertia that a descent direction needs."""


class NewtonSystem:
    """Factorises and solves the system above for a sequence of iterates.

    Attributes:
        shift: the delta_w in use.
        dual_shift: the delta_c in use.
        deficient: True when the last factorisation met dependent rows.
    """

    def __init__(self, form: Formulation) -> None:
        self.form = form
        self.shift = 0.0
        self.dual_shift = 0.0
        self.deficient = False
        self._last_shift = 0.0
        self._stiffness = 0.0
        self._before = (0.0, 0.0)
        self._any_equality = bool(form.equality.any())
        self._deficiencies = 0
        self._d = np.zeros(form.m)
        self._sigma_z = np.zeros(form.gaps)

    def factorize(self, it: Iterate, mu: float) -> None:
        """Factorise at an iterate, shifting until the inertia is right.

        Raises:
            SingularSystem: when no shift helps.
        """
        form = self.form
        self._ratio = it.z / it.gap
        sigma = summed(form.index, self._ratio, form.size)
        primal = sigma[: form.n]
        if form.extra_diagonal is not None:
            primal = primal + form.extra_diagonal
        if form.any_held:
            primal = np.where(form.held, 1.0, primal)
        self._d = 1.0 / np.maximum(sigma[form.n :], SMALLEST_SIGMA)
        if form.any_ignored:
            self._d[form.ignored] = 1.0
        self._jac, self._hess = it.jac, it.hess
        self.shift = self._stiffness
        dual_shift = DUAL_SHIFT * max(mu, 1e-12) ** 0.25
        # Rows that have been dependent all the time are so by their structure.
        self.deficient = self._deficiencies >= ALWAYS
        self.dual_shift = dual_shift if self.deficient else 0.0
        while True:
            verdict = self._try(it, primal)
            if verdict == "good":
                break
            if verdict == "singular" and self.dual_shift == 0.0 and self._any_equality:
                self.dual_shift = dual_shift
                self.deficient = True
                if self.shift == 0.0:
                    continue
            self.shift = self._larger_shift()
        self._deficiencies = self._deficiencies + 1 if self.deficient else 0
        self._primal = primal
        self._barrier = sigma[: form.n]
        if self.shift > 0.0:
            self._last_shift = self.shift

    def stiffen(self, it: Iterate, dw: Floats, shorter: float) -> None:
        """Factorise with a shift that makes a step like ``dw`` (n + m,) ``shorter`` times shorter.

        Raises:
            SingularSystem: the matrix cannot be factorised.
        """
        form = self.form
        dx = dw[: form.n]
        curved = form.hessian_times(it.hess, dx) + self._barrier * dx
        curvature = inner(dx, curved) / max(inner(dx, dx), 1e-300) + self.shift
        self._before = self._stiffness, self.shift
        self.shift = max(GROWTH * self.shift, shorter * abs(curvature), SMALLEST_SHIFT)
        self._stiffness = self.shift
        while self._try(it, self._primal) != "good":
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
        if length >= WHOLE:
            self._stiffness *= SOFTER
            if self._stiffness < SMALLEST_STIFFNESS:
                self._stiffness = 0.0

    def tighten(self, it: Iterate) -> None:
        """Halve the shift as often as the inertia stays right, and factorise with the last one."""
        if self.shift == 0.0:
            return
        while self.shift > SMALLEST_SHIFT:
            self.shift *= 0.5
            if self._try(it, self._primal) != "good":
                self.shift *= 2.0
                break
        self._try(it, self._primal)

    def _ordinary_curvature(self) -> float:
        """What shifts are measured in: the Hessian's entries shrink with the steps of a finer motion."""
        form = self.form
        diagonal = np.abs(self._hess[form.hess_rows == form.hess_cols])
        diagonal = diagonal[diagonal > 0.0]
        if not diagonal.size:
            return 1.0
        middle = (
            diagonal.size // 2
        )  # np.median imports masked arrays first, which takes longer than a small solve
        return float(np.clip(np.partition(diagonal, middle)[middle], *ORDINARY))

    def _larger_shift(self) -> float:
        if self.shift == 0.0:
            if self._last_shift == 0.0:
                return FIRST_SHIFT * self._ordinary_curvature()
            return max(SMALLEST_SHIFT, DECAY * self._last_shift)
        grown = self.shift * (GROWTH_AT_FIRST if self._last_shift == 0.0 else GROWTH)
        if grown > LARGEST_SHIFT:
            raise SingularSystem
        return grown

    def _try(self, it: Iterate, primal: Floats) -> str:
        form = self.form
        d = self._d
        if self._any_equality:
            d = np.where(form.equality, self.dual_shift, d)
        if self.shift:
            primal = primal + self.shift * form.free
        try:
            inertia = form.kkt.factorize(it.hess, it.jac, primal, d)
        except NotFinite as error:  # a derivative or the ratio of a multiplier to its gap has overflowed
            raise SingularSystem from error
        if inertia.zero > 0 or inertia.negative < form.m:
            return "singular"
        return "good" if inertia.negative == form.m else "indefinite"

    def solve(self, rhs_w: Floats, c: Floats) -> tuple[Floats, Floats]:
        """Steps ``(dw, dy)`` for a right-hand side ``rhs_w`` (n + m,) of the dual part and residual ``c`` (m,)."""
        form = self.form
        n = form.n
        scaled = np.where(form.inequality, self._d * rhs_w[n:], 0.0)
        dx, dy = form.kkt.solve(rhs_w[:n], scaled - c)
        if form.any_held:
            dx[form.held] = 0.0
        dw = np.empty(form.size)
        dw[:n] = dx
        dw[n:] = np.where(form.inequality, form.jacobian_times(self._jac, dx) + c, 0.0)
        return dw, dy

    def step(self, it: Iterate, centre: Floats, c: Floats) -> tuple[Floats, Floats, Floats]:
        """Steps ``(dw, dy, dz)`` towards ``gap * z = centre * gap`` and zero residual.

        Args:
            centre: target of each gap's multiplier, usually ``mu / gap``, (gaps,).
            c: residual of the rows, (m,).
        """
        form = self.form
        dw, dy = self.solve(form.scatter(centre) - it.dual, c)
        dz = centre - it.z - self._ratio * (form.sign * dw[form.index])
        return dw, dy, dz

    def centring(self, centre: Floats) -> tuple[Floats, Floats, Floats]:
        """The part of :meth:`step` that is linear in ``centre``."""
        form = self.form
        dw, dy = self.solve(form.scatter(centre), np.zeros(form.m))
        dz = centre - self._ratio * (form.sign * dw[form.index])
        return dw, dy, dz
