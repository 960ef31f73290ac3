"""Watches a sequence of iterates: which was best, whether it stalls, whether it drifts away."""

from __future__ import annotations

import numpy as np

from stc.solver.iterate import evaluate
from stc.solver.outcome import ACCEPTABLE, End, Outcome
from stc.solver.progress_kernels import ITS_PATIENCE, MOST_TINY_STEPS
from stc.solver.projection_kernels import CONTRACTION
from stc.solver.state import (
    DUAL_BEFORE,
    DUAL_NOW,
    NEAREST_ERROR,
    OBJECTIVE_BEFORE,
    OBJECTIVE_NOW,
    SHORT_STEPS,
    SMALL_STEPS,
    THETA_BEFORE,
    TINY_STEPS,
    WAITING,
)
from stc.solver.workspace import Workspace

__all__ = ["Drift", "Nearest", "Stall"]


class Nearest:
    """The iterate with the smallest error so far."""

    def __init__(self, work: Workspace) -> None:
        self._work = work
        s = work.s
        s[NEAREST_ERROR], s[WAITING] = np.inf, 0.0
        for kept, now in zip(work.kept, (work.it.w, work.it.y, work.it.z)):
            kept[:] = now

    @property
    def error(self) -> float:
        """Its error."""
        return self._work.s[NEAREST_ERROR]

    @property
    def waited(self) -> bool:
        """True when that error is acceptable and many steps have not improved it."""
        return self._work.s[WAITING] >= ITS_PATIENCE

    def return_to(self) -> None:
        """Make the iterate that one again where its error is acceptable."""
        work = self._work
        if self.error <= ACCEPTABLE:
            w, y, z = work.kept
            work.load(evaluate(work.form, w.copy(), y.copy(), z.copy()))

    def outcome(self) -> Outcome:
        """The end of an iteration that got stuck, at that iterate."""
        work = self._work
        n = work.form.n
        w, y, _ = work.kept
        return Outcome(End.STUCK, work.form, w[:n].copy(), y.copy(), self.error, work.it.snapshot())


class Stall:
    """Counts steps that move nothing any more."""

    def __init__(self, work: Workspace) -> None:
        self._s = s = work.s
        s[TINY_STEPS] = s[SMALL_STEPS] = s[SHORT_STEPS] = 0.0
        s[THETA_BEFORE] = np.inf

    @property
    def stalled(self) -> bool:
        """True after several such steps in a row."""
        return self._s[TINY_STEPS] >= MOST_TINY_STEPS or self._s[SMALL_STEPS] >= ITS_PATIENCE


class Drift:
    """Tells slow descent along a valley that goes on for ever from convergence.

    Where the gradient fades as the variables grow, the error falls below any tolerance while every step still
    lowers the objective as much as the one before.
    """

    def __init__(self, work: Workspace) -> None:
        self._s = s = work.s
        s[OBJECTIVE_BEFORE] = s[OBJECTIVE_NOW] = np.nan
        s[DUAL_BEFORE] = s[DUAL_NOW] = np.inf

    @property
    def falling(self) -> bool:
        """True when the last step reduced the dual error little and the objective much."""
        s = self._s
        slow = s[DUAL_NOW] > CONTRACTION * s[DUAL_BEFORE]
        return slow and s[OBJECTIVE_BEFORE] - s[OBJECTIVE_NOW] > ACCEPTABLE * max(1.0, abs(s[OBJECTIVE_NOW]))
