"""How far the barrier parameter mu goes down at each iteration.

While the iterates make progress, mu is chosen anew at each one from a model of the optimality error after the
step (J. Nocedal, A. Waechter and R. A. Waltz, Adaptive barrier update strategies for nonlinear interior
methods, SIAM J. Optim. 19, 2009: the quality function).  When they don't, it is held until the barrier problem
is solved and then reduced superlinearly (Fiacco and McCormick), which is what the convergence theory covers.
"""

from __future__ import annotations

import math

import numpy as np

from stc.solver.globalization import Filter, largest_step
from stc.solver.newton_system import NewtonSystem
from stc.solver.passes import DUAL_STEP, PRIMAL_STEP, PRODUCTS, SIGMA
from stc.solver.workspace import Workspace

__all__ = ["BarrierParameter"]

SMALLEST_TAU = 0.99
SOLVED = 10.0  # a barrier problem counts as solved when its error is below this multiple of mu
LINEAR_DECREASE = 0.2
SUPERLINEAR_DECREASE = 1.5
MARGIN = 1e-5
HELD_FRACTION = 0.8
LARGEST_GROWTH = 1e3
ERROR_FRACTION = 1e-4
SHORT = 0.1
MANY = 3
RECENTRE = 0.1
LONG = 0.1
REACH = 0.3
GAIN = 0.1
NEAR_MU = (0.1, 10.0)


class BarrierParameter:
    """The parameter, the fraction to the boundary, and the step that goes with them.

    Attributes:
        mu: the barrier parameter in use.
        tau: fraction of the way to the boundary that a step may go.
        free: True while mu is chosen anew at every iterate.
        changed: True when mu changed, which invalidates the filter.
    """

    def __init__(self, work: Workspace, mu: float, smallest: float, adaptive: bool = True) -> None:
        self.work = work
        self.form = form = work.form
        self.mu = mu
        self.smallest = smallest
        self.adaptive = adaptive
        self.free = adaptive and form.gaps > 0
        self.tau = SMALLEST_TAU
        self.changed = False
        self._largest = math.inf
        self._short = 0
        self._error = 1.0
        self._accepted = Filter(math.inf)
        if form.gaps == 0:
            self.mu = 0.0

    def blocked(self, length: float) -> None:
        """Note the length of the last step: several very short ones in a row call for more centring."""
        self._short = self._short + 1 if length < SHORT else 0

    def update(self, error: float, stuck: bool) -> None:
        """Decide the mode for the iterate, just measured, and, in the held mode, the parameter.

        Args:
            error: the KKT error of the iterate.
            stuck: the last step was below rounding error or was refused.
        """
        self.changed = False
        self._error = min(1.0, error)
        if self.form.gaps == 0:
            return
        it = self.work.it
        average = self.work.s[PRODUCTS] / self.form.gaps
        if not math.isfinite(self._largest):
            self._largest = LARGEST_GROWTH * max(average, self.smallest)
        if self.free:
            if self._short >= MANY:
                self._short = 0
                self.free = False
                mu = max(average, RECENTRE * self._error)
                self._set(min(mu, max(self._largest, average)))
                return
            if not stuck and self._progress():
                self._accepted.add(it.theta, it.f)
                return
            self.free = False
            self._set(min(max(HELD_FRACTION * average, self.smallest), self._largest))
            return
        if self.adaptive and not stuck and self._progress():
            self.free = True
            self._accepted.add(it.theta, it.f)
            return
        while self.work.errors(self.mu).total <= SOLVED * self.mu or stuck:
            lower = max(self.smallest, min(LINEAR_DECREASE * self.mu, self.mu**SUPERLINEAR_DECREASE))
            if lower >= self.mu:
                break
            self._set(lower)
            stuck = False

    def _progress(self) -> bool:
        it = self.work.it
        margin = MARGIN * self._error
        return self._accepted.accepts(it.theta + margin, it.f + margin)

    def _set(self, mu: float) -> None:
        self.changed = self.changed or mu != self.mu
        self.mu = mu
        self.tau = max(SMALLEST_TAU, 1.0 - mu)

    def step(self, system: NewtonSystem) -> None:
        """Find the workspace's step with the factorised system; chooses mu first in the free mode."""
        work = self.work
        if not self.free:
            work.aim_at(self.mu)
            system.find_step(work.step)
            work.limit_step(self.tau)
            return
        work.predict()
        average = work.s[PRODUCTS] / self.form.gaps
        floor = max(self.smallest, ERROR_FRACTION * self._error)
        self._set(min(max(work.s[SIGMA] * average, floor), max(floor, self._largest)))
        self.changed = True
        work.combine(self.mu / average, self.tau)
        self._correct()

    def _correct(self) -> None:
        """Where the bounds allow only a short step: the same with its worst complementarity products
        brought back near mu, if that lets it go further (J. Gondzio, Multiple centrality corrections in a
        primal-dual method for linear programming, Comput. Optim. Appl. 6, 1996).
        """
        form, work = self.form, self.work
        it, step = work.it, work.step
        primal, dual = work.s[PRIMAL_STEP], work.s[DUAL_STEP]
        if min(primal, dual) >= LONG:
            return
        gap_step = form.sign * step.dw[form.index]
        further_primal, further_dual = min(1.0, primal + REACH), min(1.0, dual + REACH)
        products = (it.gap + further_primal * gap_step) * (it.z + further_dual * step.dz)
        wanted = np.clip(products, NEAR_MU[0] * self.mu, NEAR_MU[1] * self.mu) - products
        wanted = np.maximum(wanted, -NEAR_MU[1] * self.mu)
        work.centre[:] = wanted / it.gap
        extra = work.centring
        work.solve_centring(extra)
        new_primal = largest_step(it.gap, gap_step + form.sign * extra.dw[form.index], self.tau)
        new_dual = largest_step(it.z, step.dz + extra.dz, self.tau)
        further = new_primal + new_dual >= primal + dual + GAIN * REACH
        if further and min(new_primal, new_dual) >= min(primal, dual):
            step.add(extra)
            work.limit_step(self.tau)
