"""Watches a sequence of iterates: which was best, whether it stalls, whether it drifts away."""

from __future__ import annotations

import numpy as np

from stc.solver.constants import CONTRACTION
from stc.solver.outcome import ACCEPTABLE, End, Outcome
from stc.solver.workspace import Workspace

__all__ = ["Drift", "Nearest", "forget_steps"]


class Nearest:
    """The iterate with the smallest error so far."""

    def __init__(self, work: Workspace) -> None:
        self._work = work
        s = work.s
        s.nearest_error, s.waiting = np.inf, 0
        work.nearest.w[:], work.nearest.y[:], work.nearest.z[:] = work.it.w, work.it.y, work.it.z

    @property
    def error(self) -> float:
        """Its error."""
        return float(self._work.s.nearest_error)

    def return_to(self) -> None:
        """Make the iterate that one again where its error is acceptable."""
        work = self._work
        if self.error <= ACCEPTABLE:
            kept = work.nearest
            work.evaluate(kept.w, kept.y, kept.z)

    def outcome(self) -> Outcome:
        """The end of an iteration that got stuck, at that iterate."""
        work = self._work
        n = work.form.n
        kept = work.nearest
        return Outcome(End.STUCK, work.form, kept.w[:n].copy(), kept.y.copy(), self.error, work.it.snapshot())


def forget_steps(work: Workspace) -> None:
    """Begin to count steps that move nothing any more."""
    s = work.s
    s.tiny_steps = s.small_steps = s.short_steps = s.stalled = 0
    s.theta_before = np.inf


class Drift:
    """Tells slow descent along a valley that goes on for ever from convergence.

    Where the gradient fades as the variables grow, the error falls below any tolerance while every step still
    lowers the objective as much as the one before.
    """

    def __init__(self, work: Workspace) -> None:
        self._s = s = work.s
        s.objective_before = s.objective_now = np.nan
        s.dual_before = s.dual_now = np.inf

    @property
    def falling(self) -> bool:
        """True when the last step reduced the dual error little and the objective much."""
        s = self._s
        slow = s.dual_now > CONTRACTION * s.dual_before
        fall = s.objective_before - s.objective_now
        return bool(slow and fall > ACCEPTABLE * max(1.0, abs(s.objective_now)))
