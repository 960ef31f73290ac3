"""Which steps are good enough: a filter line search on (constraint violation, barrier function).

A. Waechter and L. T. Biegler, Line search filter methods for nonlinear programming: motivation and global
convergence, SIAM J. Optim. 16 (2005), with the second-order correction and the constants of their 2006 paper.
"""

from __future__ import annotations

import numpy as np

from stc.records import dataclass
from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate, refresh
from stc.solver.newton_system import NewtonSystem
from stc.solver.nlp import Floats
from stc.solver.products import inner

__all__ = ["Filter", "LineSearch", "barrier_value", "largest_step"]

GAMMA_THETA = 1e-5
GAMMA_PHI = 1e-8
DELTA = 1.0
S_THETA = 1.1
S_PHI = 2.3
ETA = 1e-8
GAMMA_ALPHA = 0.05
SMALL_THETA = 1e-4
CORRECTIONS = 4
CORRECTION_PROGRESS = 0.99
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
        return theta <= self.largest_theta and all(theta <= t or phi <= p for t, p in self._entries)


@dataclass(frozen=True, slots=True)
class Trial:
    """A point on the search path."""

    w: Floats
    f: float
    r: Floats
    gap: Floats
    c: Floats
    theta: float
    phi: float


class LineSearch:
    """Backtracks along a step until the filter accepts.

    Attributes:
        filter: the filter, which survives from step to step until the barrier parameter changes.
        tiny: True when the last accepted step was below rounding error.
    """

    def __init__(self, form: Formulation, theta0: float, largest_theta: float) -> None:
        self.form = form
        self._shifts_count = bool(form.equality.any())
        self.small_theta = SMALL_THETA * max(1.0, theta0)
        self.filter = Filter(largest_theta * max(1.0, theta0))
        self.tiny = False
        self.corrections = 0

    def trial(self, w: Floats, mu: float) -> Trial | None:
        """Functions at ``w``; None where one is undefined."""
        form = self.form
        f, r = form.values(w[: form.n])
        c = form.residual(r, w)
        theta = float(np.abs(c).sum())
        if not np.isfinite(f + theta):
            return None
        gap = form.gap(w)
        if gap.size and gap.min() <= 0.0:
            return None
        return Trial(w, f, r, gap, c, theta, barrier_value(f, gap, mu))

    def search(
        self,
        it: Iterate,
        system: NewtonSystem,
        mu: float,
        tau: float,
        dw: Floats,
        dy: Floats,
        dz: Floats,
        shortest: float = 0.0,
    ) -> float:
        """Move ``it`` along the step; returns the accepted fraction, 0 when there is none.

        Fractions below ``shortest`` of what the bounds allow are not tried.  The derivatives of ``it`` are current
        on return when the fraction is positive.
        """
        form = self.form
        self._jac = it.jac
        self._pull = (
            system.shift * (dw[: form.n] * form.free) if self._shifts_count and system.shift else None
        )
        self._dual = it.dual - form.scatter(it.z)
        phi = barrier_value(it.f, it.gap, mu)
        slope = inner(it.gradient, dw[: form.n])
        if form.gaps:
            slope -= mu * float((form.sign * dw[form.index] / it.gap).sum())
        theta = it.theta
        limit = largest_step(it.gap, form.sign * dw[form.index], tau)
        dual_limit = largest_step(it.z, dz, tau)
        size = float((np.abs(dw) / (1.0 + np.abs(it.w))).max(initial=0.0))
        self.tiny = size < 10.0 * EPSILON and theta < 1e-4
        smallest = max(self._smallest(theta, slope), shortest * limit)
        alpha = limit
        first = True
        while alpha >= smallest or first:
            trial = self.trial(it.w + alpha * dw, mu)
            if trial is not None:
                kind = "free" if self.tiny else self._verdict(theta, phi, slope, alpha, trial)
                if kind is None and first and trial.theta >= theta > 0.0:
                    corrected = self._correct(it, system, mu, tau, alpha, trial, theta, phi, slope)
                    if corrected is not None and self._move(it, *corrected, alpha, dy, dual_limit, dz, mu):
                        return alpha
                if kind is not None and self._move(
                    it, trial, kind, theta, phi, alpha, dy, dual_limit, dz, mu
                ):
                    return alpha
            first = False
            alpha *= 0.5
        return 0.0

    def _smallest(self, theta: float, slope: float) -> float:
        smallest = GAMMA_THETA
        if slope < 0.0:
            smallest = min(smallest, GAMMA_PHI * theta / -slope)
            if theta <= self.small_theta:
                smallest = min(smallest, DELTA * _power(theta, S_THETA) / _power(-slope, S_PHI))
        return max(GAMMA_ALPHA * smallest, 1e-14)

    def _verdict(self, theta: float, phi: float, slope: float, alpha: float, trial: Trial) -> str | None:
        """``"armijo"`` or ``"filter"`` when acceptable, the latter also extending the filter; else None."""
        if not self.filter.accepts(trial.theta, trial.phi):
            return None
        noise = 10.0 * EPSILON * abs(phi)
        descent = slope < 0.0 and alpha * _power(-slope, S_PHI) > DELTA * _power(theta, S_THETA)
        if descent and theta <= self.small_theta:
            return "armijo" if trial.phi - phi - noise <= ETA * alpha * slope else None
        if trial.phi > phi and np.log10(trial.phi - phi) > OBJECTIVE_LIMIT + max(
            1.0, np.log10(abs(phi)) if abs(phi) > 10.0 else 1.0
        ):
            return None
        better = trial.theta <= (1.0 - GAMMA_THETA) * theta or trial.phi - phi - noise <= -GAMMA_PHI * theta
        return "filter" if better else None

    def _correct(
        self,
        it: Iterate,
        system: NewtonSystem,
        mu: float,
        tau: float,
        alpha: float,
        trial: Trial,
        theta: float,
        phi: float,
        slope: float,
    ) -> tuple[Trial, str, float, float] | None:
        """Second-order correction: the step that also removes the violation seen at the trial point."""
        form = self.form
        c = alpha * it.c + trial.c
        centre = mu / it.gap
        last = trial.theta
        for _ in range(CORRECTIONS):
            dw, _, _ = system.step(it, centre, c)
            length = largest_step(it.gap, form.sign * dw[form.index], tau)
            corrected = self.trial(it.w + length * dw, mu)
            if corrected is None:
                return None
            kind = self._verdict(theta, phi, slope, alpha, corrected)
            if kind is not None:
                self.corrections += 1
                return corrected, kind, theta, phi
            if corrected.theta > CORRECTION_PROGRESS * last:
                return None
            last = corrected.theta
            c = length * c + corrected.c
        return None

    def _row_fraction(self, primal: float, dual: float, dy: Floats, dz: Floats) -> float:
        """Fraction of ``dy`` that leaves the smallest gradient of the Lagrangian, to first order, when the
        primal and the dual variables take different fractions of their steps.

        A shift of the Hessian is no part of the Lagrangian, and a large one shows in ``dy``: it counts as well.
        """
        form = self.form
        n = form.n
        rows = np.empty(form.size)
        rows[:n] = form.transpose_times(self._jac, dy)
        np.negative(dy, out=rows[n:])
        if not form.all_moving:
            rows[~form.moving] = 0.0
        size = inner(rows, rows)
        if (primal == dual and self._pull is None) or size == 0.0:
            return primal
        left = (1.0 - primal) * self._dual + (primal - dual) * form.scatter(dz)
        if self._pull is not None:
            left[:n] -= primal * self._pull
        return min(max(primal - inner(left, rows) / size, 0.0), 1.0)

    def _move(
        self,
        it: Iterate,
        trial: Trial,
        kind: str,
        theta: float,
        phi: float,
        alpha: float,
        dy: Floats,
        dual_limit: float,
        dz: Floats,
        mu: float,
    ) -> bool:
        """Make the trial point the iterate, unless a derivative is undefined there."""
        old = (it.w, it.y, it.z, it.f, it.r, it.gap, it.c, it.theta, it.gradient, it.jac, it.hess, it.dual)
        it.w, it.f, it.r, it.gap, it.c, it.theta = trial.w, trial.f, trial.r, trial.gap, trial.c, trial.theta
        it.y = it.y + self._row_fraction(alpha, dual_limit, dy, dz) * dy
        it.z = it.z + dual_limit * dz
        if self.form.gaps:
            np.clip(it.z, mu / (1e10 * it.gap), 1e10 * mu / it.gap, out=it.z)
        if not refresh(self.form, it):
            (it.w, it.y, it.z, it.f, it.r, it.gap, it.c, it.theta, it.gradient, it.jac, it.hess, it.dual) = (
                old
            )
            return False
        if kind == "filter":
            self.filter.add(theta, phi)
        return True


def _power(base: float, exponent: float) -> np.float64:
    """``base ** exponent``, inf where that is too large; Python's own raises, and so does its division by 0."""
    return np.float64(base) ** exponent
