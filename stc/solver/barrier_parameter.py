"""How far the barrier parameter mu goes down at each iteration.

While the iterates make progress, mu is chosen anew at each one from a model of the optimality error after the
step (J. Nocedal, A. Waechter and R. A. Waltz, Adaptive barrier update strategies for nonlinear interior
methods, SIAM J. Optim. 19, 2009: the quality function).  When they don't, it is held until the barrier problem
is solved and then reduced superlinearly (Fiacco and McCormick), which is what the convergence theory covers.
"""

from __future__ import annotations

import numpy as np

from stc.solver.formulation import Formulation
from stc.solver.globalization import Filter, largest_step
from stc.solver.iterate import Iterate, errors_of
from stc.solver.newton_system import NewtonSystem
from stc.solver.nlp import Floats
from stc.solver.products import inner, least_error

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
PRODUCTS = (0.1, 10.0)
CENTRING = np.array([1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.06, 0.1, 0.2, 0.35, 0.6, 1.0, 2.0, 5.0, 20.0, 100.0])


class BarrierParameter:
    """The parameter, the fraction to the boundary, and the step that goes with them.

    Attributes:
        mu: the barrier parameter in use.
        tau: fraction of the way to the boundary that a step may go.
        free: True while mu is chosen anew at every iterate.
        changed: True when mu changed, which invalidates the filter.
    """

    def __init__(self, form: Formulation, mu: float, smallest: float, adaptive: bool = True) -> None:
        self.form = form
        self.mu = mu
        self.smallest = smallest
        self.adaptive = adaptive
        self.free = adaptive and form.gaps > 0
        self.tau = SMALLEST_TAU
        self.changed = False
        self._largest = np.inf
        self._short = 0
        self._error = 1.0
        self._accepted = Filter(np.inf)
        if form.gaps == 0:
            self.mu = 0.0

    def blocked(self, length: float) -> None:
        """Note the length of the last step: several very short ones in a row call for more centring."""
        self._short = self._short + 1 if length < SHORT else 0

    def update(self, it: Iterate, error: float, stuck: bool) -> None:
        """Decide the mode for this iterate and, in the held mode, the parameter.

        Args:
            error: the KKT error of the iterate.
            stuck: the last step was below rounding error or was refused.
        """
        self.changed = False
        self._error = min(1.0, error)
        if self.form.gaps == 0:
            return
        average = inner(it.gap, it.z) / self.form.gaps
        if not np.isfinite(self._largest):
            self._largest = LARGEST_GROWTH * max(average, self.smallest)
        if self.free:
            if self._short >= MANY:
                self._short = 0
                self.free = False
                mu = max(average, RECENTRE * self._error)
                self._set(min(mu, max(self._largest, average)))
                return
            if not stuck and self._progress(it):
                self._accepted.add(it.theta, it.f)
                return
            self.free = False
            self._set(float(np.clip(HELD_FRACTION * average, self.smallest, self._largest)))
            return
        if self.adaptive and not stuck and self._progress(it):
            self.free = True
            self._accepted.add(it.theta, it.f)
            return
        while errors_of(self.form, it, self.mu).total <= SOLVED * self.mu or stuck:
            lower = max(self.smallest, min(LINEAR_DECREASE * self.mu, self.mu**SUPERLINEAR_DECREASE))
            if lower >= self.mu:
                break
            self._set(lower)
            stuck = False

    def _progress(self, it: Iterate) -> bool:
        margin = MARGIN * self._error
        return self._accepted.accepts(it.theta + margin, it.f + margin)

    def _set(self, mu: float) -> None:
        self.changed = self.changed or mu != self.mu
        self.mu = mu
        self.tau = max(SMALLEST_TAU, 1.0 - mu)

    def step(self, it: Iterate, system: NewtonSystem) -> tuple[Floats, Floats, Floats]:
        """The step ``(dw, dy, dz)`` with the factorised system; chooses mu first in the free mode."""
        if self.form.gaps == 0:
            return system.step(it, it.z, it.c)
        if not self.free:
            return system.step(it, self.mu / it.gap, it.c)
        form = self.form
        affine = system.step(it, np.zeros(form.gaps), it.c)
        average = inner(it.gap, it.z) / form.gaps
        centring = system.centring(average / it.gap)
        sigma = self._best_centring(it, affine, centring, average)
        floor = max(self.smallest, ERROR_FRACTION * self._error)
        self._set(float(np.clip(sigma * average, floor, max(floor, self._largest))))
        self.changed = True
        sigma = self.mu / average
        step = (
            affine[0] + sigma * centring[0],
            affine[1] + sigma * centring[1],
            affine[2] + sigma * centring[2],
        )
        return self._corrected(it, system, step)

    def _corrected(
        self, it: Iterate, system: NewtonSystem, step: tuple[Floats, Floats, Floats]
    ) -> tuple[Floats, Floats, Floats]:
        """Where the bounds allow only a short step: the same with its worst complementarity products
        brought back near mu, if that lets it go further (J. Gondzio, Multiple centrality corrections in a
        primal-dual method for linear programming, Comput. Optim. Appl. 6, 1996).
        """
        form = self.form
        gap_step = form.sign * step[0][form.index]
        primal, dual = largest_step(it.gap, gap_step, self.tau), largest_step(it.z, step[2], self.tau)
        if min(primal, dual) >= LONG:
            return step
        further_primal, further_dual = min(1.0, primal + REACH), min(1.0, dual + REACH)
        products = (it.gap + further_primal * gap_step) * (it.z + further_dual * step[2])
        wanted = np.clip(products, PRODUCTS[0] * self.mu, PRODUCTS[1] * self.mu) - products
        wanted = np.maximum(wanted, -PRODUCTS[1] * self.mu)
        extra = system.centring(wanted / it.gap)
        new = (step[0] + extra[0], step[1] + extra[1], step[2] + extra[2])
        new_primal = largest_step(it.gap, form.sign * new[0][form.index], self.tau)
        new_dual = largest_step(it.z, new[2], self.tau)
        further = new_primal + new_dual >= primal + dual + GAIN * REACH
        return new if further and min(new_primal, new_dual) >= min(primal, dual) else step

    def _best_centring(
        self,
        it: Iterate,
        affine: tuple[Floats, Floats, Floats],
        centring: tuple[Floats, Floats, Floats],
        average: float,
    ) -> float:
        """Minimise the predicted error over a grid of centring parameters."""
        form = self.form
        dual_residual = it.dual - form.scatter(it.z)
        best = least_error(
            CENTRING,
            np.maximum(SMALLEST_TAU, 1.0 - CENTRING * average),
            it.gap,
            it.z,
            form.sign * affine[0][form.index],
            form.sign * centring[0][form.index],
            affine[2],
            centring[2],
            inner(dual_residual, dual_residual) / max(1, int(form.moving.sum())),
            inner(it.c, it.c) / max(1, form.m),
        )
        return float(CENTRING[best])
