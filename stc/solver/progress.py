"""Watches a sequence of iterates: which was best, whether it stalls, whether it drifts away."""

from __future__ import annotations

import numpy as np

from stc.solver.ablation import on
from stc.solver.iterate import evaluate
from stc.solver.outcome import ACCEPTABLE, End, Outcome
from stc.solver.places import (
    CRAWLING_STEPS,
    DUAL_BEFORE,
    DUAL_NOW,
    NEAREST_ERROR,
    OBJECTIVE_BEFORE,
    OBJECTIVE_NOW,
    PATIENCE,
    SHORT_STEPS,
    SMALL_STEPS,
    THETA_BEFORE,
    THETA_LAST,
    TINY_STEPS,
    UNMET_STEPS,
    WAITING,
    WAITING_AT,
)
from stc.solver.products import inner
from stc.solver.progress_passes import ITS_PATIENCE, MOST_TINY_STEPS
from stc.solver.workspace import Workspace

__all__ = ["Drift", "Gain", "Nearest", "Stall"]

SLOW = 0.1
MUCH = 1e-6
MUCH_NEARER = 0.1


class Nearest:
    """The iterate with the smallest error so far."""

    def __init__(self, work: Workspace) -> None:
        self._work = work
        s = work.s
        s[NEAREST_ERROR], s[WAITING], s[WAITING_AT], s[PATIENCE] = np.inf, 0.0, np.inf, ITS_PATIENCE
        for kept, now in zip(work.kept, (work.it.w, work.it.y, work.it.z)):
            kept[:] = now

    @property
    def error(self) -> float:
        """Its error."""
        return self._work.s[NEAREST_ERROR]

    @property
    def waited(self) -> bool:
        """True when that error is acceptable and so many steps as ``s[PATIENCE]`` says have not improved it."""
        return self._work.s[WAITING] >= self._work.s[PATIENCE]

    def products(self) -> float:
        """The sum of its gaps times multipliers."""
        w, _, z = self._work.kept
        return inner(self._work.form.gap(w), z)

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
        s[TINY_STEPS] = s[SMALL_STEPS] = s[SHORT_STEPS] = s[UNMET_STEPS] = s[CRAWLING_STEPS] = 0.0
        s[THETA_BEFORE] = s[THETA_LAST] = np.inf

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
        slow = s[DUAL_NOW] > SLOW * s[DUAL_BEFORE]
        return bool(slow and s[OBJECTIVE_BEFORE] - s[OBJECTIVE_NOW] > MUCH * max(1.0, abs(s[OBJECTIVE_NOW])) and on('drift'))


class Gain:
    """Tells an attempt that comes no nearer for long from one that converges.

    Attributes:
        due: the iteration at which the least error is to be a tenth of what it was.
    """

    def __init__(self, steps: int, iterations: int) -> None:
        """It is to be so again and again in so many ``steps``, or never need be where that is 0."""
        self._steps = steps
        self.expect(1.0, iterations)

    def expect(self, error: float, iterations: int) -> None:
        """From an error of that size, in the next steps."""
        self._before = error
        self.due = iterations + self._steps if self._steps else np.inf

    def is_missing(self, error: float, iterations: int) -> bool:
        """Whether the least error has not become so small in time."""
        if iterations < self.due:
            return False
        before = self._before
        self.expect(error, iterations)
        return not error <= MUCH_NEARER * before
