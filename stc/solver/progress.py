"""Watches a sequence of iterates: which was best, and whether it stalls."""

from __future__ import annotations

import numpy as np

from stc.solver.outcome import ACCEPTABLE, End, Outcome
from stc.solver.workspace import Workspace

__all__ = ["Nearest", "forget_steps"]


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
