"""Which steps are good enough: a filter line search on (constraint violation, barrier function).

A. Waechter and L. T. Biegler, Line search filter methods for nonlinear programming: motivation and global
convergence, SIAM J. Optim. 16 (2005), with the second-order correction and the constants of their 2006 paper.
"""

from __future__ import annotations

import numpy as np

from stc.solver.filter import Filter
from stc.solver.iterate import evaluate
from stc.solver.nlp import Floats
from stc.solver.places import (
    EQUATIONS,
    FROM_PHI,
    FROM_SLOPE,
    FROM_THETA,
    HALVED,
    LENGTH_TAKEN,
    LIMIT,
    MU,
    SHIFT,
    SHORTENED,
    SHORTEST,
    SMALL_THETA,
    TAU,
    TINY,
    TRIAL_THETA,
    WATCHING,
)
from stc.solver.search_passes import CALL_MISSING, DESCENT, ON_TRIAL, OUTSIDE, REFUSED, TAKEN, TRIALS, judge
from stc.solver.stages import stages_of
from stc.solver.workspace import Step, Workspace

__all__ = ["Filter", "LineSearch", "barrier_value", "largest_step"]

ITS_SMALL_THETA = 1e-4


def barrier_value(f: float, gap: Floats, mu: float) -> float:
    """``f - mu * sum(log(gap))``."""
    return f - mu * float(np.log(gap).sum()) if gap.size else f


def largest_step(value: Floats, change: Floats, fraction: float) -> float:
    """Largest alpha <= 1 with ``value + alpha * change >= (1 - fraction) * value``, for positive ``value``."""
    if not value.size:
        return 1.0
    worst = float((change / value).min())
    return 1.0 if worst >= -fraction else fraction / -worst


class _Watch:
    """The point and the step from which whole steps are tried that the filter does not accept."""

    def __init__(self, work: Workspace) -> None:
        it, s = work.it, work.s
        self._reference = s[FROM_THETA], s[FROM_PHI], s[FROM_SLOPE], s[LIMIT]
        self.trials = 0
        self._point = it.w.copy(), it.y.copy(), it.z.copy()
        self._step = Step(work.form)
        self._step.become(work.step)

    def compare(self, work: Workspace) -> None:
        """What is tried next is compared with that point."""
        s = work.s
        s[FROM_THETA], s[FROM_PHI], s[FROM_SLOPE], s[LIMIT] = self._reference

    def go_back(self, work: Workspace) -> None:
        """Make that point the iterate again, and that step the step."""
        work.load(evaluate(work.form, *self._point))
        work.errors()
        work.step.become(self._step)
        work.limit_step(work.s[TAU])


class LineSearch:
    """Backtracks along a step until the filter accepts (:func:`stc.solver.search_passes.search`).

    Where it had to backtrack many times in a row, a few whole steps are taken on trial: they often lead to where the
    rows can be met, through points that the filter does not accept (R. M. Chamberlain, M. J. D. Powell, C. Lemarechal
    and H. C. Pedersen, The watchdog technique for forcing convergence in algorithms for constrained optimization,
    Math. Program. Study 16, 1982). If they do not, the search goes back to where they began.

    Attributes:
        filter: the filter, which survives from step to step until the barrier parameter changes.
        went_back: True when the last search ended steps on trial, so that the factorisation at hand is not that of
            the iterate.
    """

    def __init__(self, work: Workspace, largest_theta: float) -> None:
        self.work = work
        self._stages = stages_of(work)
        s = work.s
        scale = max(1.0, work.it.theta)
        s[SMALL_THETA] = ITS_SMALL_THETA * scale
        s[TINY] = s[SHORTENED] = s[WATCHING] = s[SHORTEST] = 0.0
        self.filter = work.filter
        self.filter.restart(largest_theta * scale)
        self.went_back = False
        self._watch: _Watch | None = None

    def go_on(self, ended: int) -> bool:
        """Do what a compiled search that has ended so cannot do; whether a step was taken in the end."""
        work = self.work
        self.went_back = False
        while ended == CALL_MISSING:
            work.provide_solves()
            ended = self._stages.backtrack()
        if ended == ON_TRIAL:
            return self._on_trial()
        return ended == TAKEN

    def _on_trial(self) -> bool:
        work = self.work
        s = work.s
        if s[WATCHING] == 0.0 or self._watch is None:
            self._watch, s[WATCHING] = _Watch(work), 1.0
        watch, limit = self._watch, s[LIMIT]
        if self._take_whole(watch, limit):
            s[LENGTH_TAKEN] = limit
            return True
        watch.go_back(work)
        watch.compare(work)
        s[SHORTEST], s[HALVED], s[WATCHING] = 0.0, 1.0, 0.0
        self._watch, shift = None, s[SHIFT]
        s[SHIFT] = 0.0  # the step that is gone back to came from another matrix
        ended = self._stages.backtrack()
        s[SHIFT] = shift
        taken = self.go_on(ended)
        self.went_back = True
        return taken

    def _take_whole(self, watch: _Watch, limit: float) -> bool:
        """Take the whole step; False when there have been too many that led nowhere."""
        work, s = self.work, self.work.s
        if not work.try_step(limit):
            return False
        watch.compare(work)
        kind = judge(s[LIMIT], s[TRIAL_THETA], work.trial_phi(s[MU]), self.filter.array, work.numbers)
        if kind == REFUSED:
            watch.trials += 1
            return watch.trials <= TRIALS and self._take(DESCENT, limit)
        if not self._take(kind, limit):
            return False
        self._watch, s[WATCHING], s[SHORTENED] = None, 0.0, 0.0
        return True

    def _take(self, kind: int, alpha: float) -> bool:
        work, s = self.work, self.work.s
        shifted = s[SHIFT] != 0.0 and s[EQUATIONS] != 0.0
        if not work.move(alpha, s[MU], shifted):
            return False
        if kind == OUTSIDE:
            self.filter.add(s[FROM_THETA], s[FROM_PHI])
        return True
