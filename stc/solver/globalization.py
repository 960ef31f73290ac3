"""Which steps are good enough: a filter line search on (constraint violation, barrier function).

A. Waechter and L. T. Biegler, Line search filter methods for nonlinear programming: motivation and global
convergence, SIAM J. Optim. 16 (2005), with the second-order correction and the constants of their 2006 paper.
"""

from __future__ import annotations

import math

import numpy as np

from stc.solver.iterate import evaluate
from stc.solver.newton_system import NewtonSystem
from stc.solver.nlp import Floats
from stc.solver.passes import LOG_SLOPE, PRIMAL_STEP, RELATIVE, SLOPE, TRIAL_THETA
from stc.solver.workspace import Step, Workspace

__all__ = ["Filter", "LineSearch", "barrier_value", "largest_step"]

GAMMA_THETA = 1e-5
GAMMA_PHI = 1e-8
DELTA = 1.0
S_THETA = 1.1
S_PHI = 2.3
ETA = 1e-8
GAMMA_ALPHA = 0.05
SMALL_THETA = 1e-4
SHORTENED, TRIALS = 10, 3
"""After so many shortened steps in a row, so many whole ones are taken on trial."""
CORRECTIONS = 4
CORRECTION_PROGRESS = 0.99
SMALLEST_POWER = 1e-300
EPSILON = float(np.finfo(float).eps)
OBJECTIVE_LIMIT = 5.0
"""Largest admissible increase of the barrier function, in powers of ten."""


def barrier_value(f: float, gap: Floats, mu: float) -> float:
    """``f - mu * sum(log(gap))``."""
    return f - mu * float(np.log(gap).sum()) if gap.size else f


def largest_step(value: Floats, change: Floats, fraction: float) -> float:
    """Largest alpha <= 1 with ``value + alpha * change >= (1 - fraction) * value``, for positive ``value``."""
    if not value.size:
        return 1.0
    worst = float((change / value).min())
    return 1.0 if worst >= -fraction else fraction / -worst


class Filter:
    """Pairs (theta, phi) that later points must not be dominated by."""

    def __init__(self, largest_theta: float) -> None:
        self.largest_theta = largest_theta
        self._entries: list[tuple[float, float]] = []

    def reset(self) -> None:
        """Forget every entry, as when the barrier parameter changes."""
        self._entries.clear()

    def add(self, theta: float, phi: float) -> None:
        """Forbid points no better than (theta, phi) by a margin."""
        theta, phi = (1.0 - GAMMA_THETA) * theta, phi - GAMMA_PHI * theta
        self._entries = [e for e in self._entries if e[0] < theta or e[1] < phi]
        self._entries.append((theta, phi))

    def accepts(self, theta: float, phi: float) -> bool:
        """True when no entry dominates the point."""
        if not theta <= self.largest_theta:
            return False
        for t, p in self._entries:  # noqa: SIM110 (a generator takes longer than most filters have entries)
            if not (theta <= t or phi <= p):
                return False
        return True


class _Watch:
    """The point and the step from which whole steps are tried that the filter does not accept.

    Args:
        work: whose iterate and step they are.
        reference: theta, phi and slope there, and the fraction of the step that the bounds allow.
    """

    def __init__(self, work: Workspace, reference: tuple[float, float, float, float]) -> None:
        it = work.it
        self.theta, self.phi, self.slope, self.limit = reference
        self.trials = 0
        self._point = it.w.copy(), it.y.copy(), it.z.copy()
        self._step = Step(work.form)
        self._step.become(work.step)

    def go_back(self, work: Workspace, tau: float) -> None:
        """Make that point the iterate again, and that step the step."""
        work.load(evaluate(work.form, *self._point))
        work.errors()
        work.step.become(self._step)
        work.limit_step(tau)


class LineSearch:
    """Backtracks along a step until the filter accepts.

    Where it had to backtrack many times in a row, a few whole steps are taken on trial: they often lead to where the
    rows can be met, through points that the filter does not accept (R. M. Chamberlain, M. J. D. Powell, C. Lemarechal
    and H. C. Pedersen, The watchdog technique for forcing convergence in algorithms for constrained optimization,
    Math. Program. Study 16, 1982). If they do not, the search goes back to where they began.

    Attributes:
        filter: the filter, which survives from step to step until the barrier parameter changes.
        tiny: True when the last accepted step was below rounding error.
        went_back: True when the last search ended steps on trial, so that the factorisation at hand is not that of
            the iterate.
    """

    def __init__(self, work: Workspace, largest_theta: float) -> None:
        self.work = work
        self.form = form = work.form
        theta0 = work.it.theta
        self._shifts_count = bool(form.equality.any())
        self.small_theta = SMALL_THETA * max(1.0, theta0)
        self.filter = Filter(largest_theta * max(1.0, theta0))
        self.tiny = self.went_back = False
        self.corrections = 0
        self._shortened = 0
        self._watch: _Watch | None = None

    def reset(self) -> None:
        """Forget the points before, as when the barrier parameter changes."""
        self.filter.reset()
        self._watch = None

    def search(self, system: NewtonSystem, mu: float, tau: float, shortest: float = 0.0) -> float:
        """Move the iterate along the workspace's step; returns the accepted fraction, 0 when there is none.

        Fractions below ``shortest`` of what the bounds allow are not tried.  The derivatives of the iterate are
        current on return when the fraction is positive.
        """
        work, s = self.work, self.work.s
        phi, theta = work.phi(mu), work.it.theta
        slope = s[SLOPE] - mu * s[LOG_SLOPE]
        limit = s[PRIMAL_STEP]
        self._shifted = system.shift != 0.0 and self._shifts_count
        self.tiny = s[RELATIVE] < 10.0 * EPSILON and theta < 1e-4
        self.went_back = False
        if self._watch is None and self._shortened >= SHORTENED:
            self._watch = _Watch(work, (theta, phi, slope, limit))
        if self._watch is not None:
            watch = self._watch
            if self._on_trial(watch, limit, mu):
                return limit
            watch.go_back(work, tau)
            theta, phi, slope, limit, shortest = watch.theta, watch.phi, watch.slope, watch.limit, 0.0
            self._watch, self.went_back, self._shifted = None, True, False
        smallest = max(self._smallest(theta, slope), shortest * limit)
        alpha = limit
        first = True
        if self.went_back:
            alpha, first = 0.5 * limit, False
        while alpha >= smallest or first:
            if work.try_step(alpha):
                trial = s[TRIAL_THETA], work.trial_phi(mu)
                kind = "free" if self.tiny else self._verdict(theta, phi, slope, alpha, *trial)
                if kind is not None:
                    if self._move(kind, theta, phi, alpha, mu):
                        self._shortened = 0 if first else self._shortened + 1
                        return alpha
                elif first and trial[0] >= theta > 0.0:
                    kind = self._correct(system, mu, tau, alpha, theta, phi, slope)
                    if kind is not None and self._move(kind, theta, phi, alpha, mu):
                        self._shortened = 0
                        return alpha
            first = False
            alpha *= 0.5
        return 0.0

    def _on_trial(self, watch: _Watch, limit: float, mu: float) -> bool:
        """Take the whole step; False when there have been too many that led nowhere."""
        work = self.work
        if not work.try_step(limit):
            return False
        trial = work.s[TRIAL_THETA], work.trial_phi(mu)
        kind = self._verdict(watch.theta, watch.phi, watch.slope, watch.limit, *trial)
        if kind is not None:
            if not self._move(kind, watch.theta, watch.phi, limit, mu):
                return False
            self._watch, self._shortened = None, 0
            return True
        watch.trials += 1
        return watch.trials <= TRIALS and work.move(limit, mu, self._shifted)

    def _smallest(self, theta: float, slope: float) -> float:
        smallest = GAMMA_THETA
        if slope < 0.0:
            smallest = min(smallest, GAMMA_PHI * theta / -slope)
            if theta <= self.small_theta:
                smallest = min(
                    smallest, DELTA * _power(theta, S_THETA) / max(_power(-slope, S_PHI), SMALLEST_POWER)
                )
        return max(GAMMA_ALPHA * smallest, 1e-14)

    def _verdict(
        self, theta: float, phi: float, slope: float, alpha: float, trial_theta: float, trial_phi: float
    ) -> str | None:
        """``"armijo"`` or ``"filter"`` when acceptable, the latter also extending the filter; else None."""
        if not self.filter.accepts(trial_theta, trial_phi):
            return None
        noise = 10.0 * EPSILON * abs(phi)
        descent = slope < 0.0 and alpha * _power(-slope, S_PHI) > DELTA * _power(theta, S_THETA)
        if descent and theta <= self.small_theta:
            return "armijo" if trial_phi - phi - noise <= ETA * alpha * slope else None
        if trial_phi > phi and math.log10(trial_phi - phi) > OBJECTIVE_LIMIT + max(
            1.0, math.log10(abs(phi)) if abs(phi) > 10.0 else 1.0
        ):
            return None
        better = trial_theta <= (1.0 - GAMMA_THETA) * theta or trial_phi - phi - noise <= -GAMMA_PHI * theta
        return "filter" if better else None

    def _correct(
        self,
        system: NewtonSystem,
        mu: float,
        tau: float,
        alpha: float,
        theta: float,
        phi: float,
        slope: float,
    ) -> str | None:
        """Second-order correction: try the step that also removes the violation seen at the point tried.

        Returns the verdict when the point tried last is acceptable.
        """
        form, work = self.form, self.work
        it, correction = work.it, work.correction
        c = work.correction_c
        c[:] = alpha * it.c + work.trial_c
        last = work.s[TRIAL_THETA]
        for _ in range(CORRECTIONS):
            work.aim_at(mu)
            system.find_step(correction, c, "correction")
            length = largest_step(it.gap, form.sign * correction.dw[form.index], tau)
            if not work.try_point(it.w + length * correction.dw):
                return None
            now = work.s[TRIAL_THETA]
            kind = self._verdict(theta, phi, slope, alpha, now, work.trial_phi(mu))
            if kind is not None:
                self.corrections += 1
                return kind
            if now > CORRECTION_PROGRESS * last:
                return None
            last = now
            c[:] = length * c + work.trial_c
        return None

    def _move(self, kind: str, theta: float, phi: float, alpha: float, mu: float) -> bool:
        """Make the point tried the iterate, unless a derivative is undefined there."""
        if not self.work.move(alpha, mu, self._shifted):
            return False
        if kind == "filter":
            self.filter.add(theta, phi)
        return True


def _power(base: float, exponent: float) -> float:
    """``base ** exponent``, inf where that is too large."""
    try:
        return float(base**exponent)
    except OverflowError:
        return math.inf
