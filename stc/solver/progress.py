"""Watches a sequence of iterates: which was best, whether it stalls, whether it drifts away."""

from __future__ import annotations

import numpy as np

from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate, evaluate
from stc.solver.outcome import ACCEPTABLE, End, Outcome
from stc.solver.workspace import Workspace

__all__ = ["Drift", "Nearest", "Stall"]

NOTICEABLE = 0.9
PATIENCE = 15
TINY_STEPS = 3
SMALL_STEP = 1e-9
SLOW = 0.1
SHORT = 1e-2
SHORT_STEPS = 5
HALF = 0.5
NEARLY_FEASIBLE = 1e-4
MUCH = 1e-6


class Nearest:
    """The iterate with the smallest error so far.

    Attributes:
        error: its error.
        waited: True when that error is acceptable and ``patience`` steps have not improved it.
    """

    def __init__(self, form: Formulation, it: Iterate) -> None:
        self._form = form
        self.error = np.inf
        self._waiting = 0
        self._kept = it.w.copy(), it.y.copy(), it.z.copy()
        self.patience = PATIENCE

    def note(self, it: Iterate, error: float) -> None:
        """The next iterate and its error."""
        if error < NOTICEABLE * self.error:
            self._waiting = 0
        elif self.error <= ACCEPTABLE:
            self._waiting += 1
        if error < self.error:
            self.error = error
            for kept, now in zip(self._kept, (it.w, it.y, it.z)):
                kept[:] = now

    @property
    def waited(self) -> bool:
        """See the class."""
        return self._waiting >= self.patience

    def return_to(self, work: Workspace) -> None:
        """Make the iterate that one again where its error is acceptable."""
        if self.error <= ACCEPTABLE:
            work.load(evaluate(self._form, *self._kept))

    def outcome(self, it: Iterate) -> Outcome:
        """The end of an iteration that got stuck, at that iterate; ``it`` is the last one."""
        n = self._form.n
        w, y, _ = self._kept
        return Outcome(End.STUCK, self._form, w[:n].copy(), y.copy(), self.error, it.snapshot())


class Stall:
    """Counts steps that move nothing any more."""

    def __init__(self) -> None:
        self._tiny = self._small = self._short = 0
        self._theta = np.inf

    def note(self, size: float, tiny: bool) -> None:
        """The relative size of a step; ``tiny``: below rounding error, and no change of the barrier explains it."""
        self._tiny = self._tiny + 1 if tiny else 0
        self._small = self._small + 1 if size <= SMALL_STEP else 0

    def blocked(self, length: float, theta: float) -> bool:
        """True after several very short steps in a row that did not even halve the violation ``theta``."""
        if length >= SHORT or theta < HALF * self._theta:
            self._short, self._theta = 0, theta
        self._short += 1
        return self._short > SHORT_STEPS and theta > NEARLY_FEASIBLE

    @property
    def stalled(self) -> bool:
        """True after several such steps in a row."""
        return self._tiny >= TINY_STEPS or self._small >= PATIENCE


class Drift:
    """Tells slow descent along a valley that goes on for ever from convergence.

    Where the gradient fades as the variables grow, the error falls below any tolerance while every step still
    lowers the objective as much as the one before.
    """

    def __init__(self) -> None:
        self._f, self._dual = [np.nan, np.nan], [np.inf, np.inf]

    def note(self, f: float, dual: float) -> None:
        """The objective and the dual error of the next iterate."""
        self._f, self._dual = [self._f[1], f], [self._dual[1], dual]

    @property
    def falling(self) -> bool:
        """True when the last step reduced the dual error little and the objective much."""
        slow = self._dual[1] > SLOW * self._dual[0]
        return slow and self._f[0] - self._f[1] > MUCH * max(1.0, abs(self._f[1]))
