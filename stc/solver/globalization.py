"""Which steps are good enough: a filter line search on (constraint violation, barrier function).

A. Waechter and L. T. Biegler, Line search filter methods for nonlinear programming: motivation and global
convergence, SIAM J. Optim. 16 (2005), with the second-order correction and the constants of their 2006 paper.
"""

from __future__ import annotations

import numpy as np

from stc.solver.filter import Filter
from stc.solver.filter_line_search import CALL_MISSING, SMALL_VIOLATION, TAKEN
from stc.solver.iteration_calls import stages_of
from stc.solver.nlp import Floats
from stc.solver.state import SHORTEST, SMALL_THETA, TINY
from stc.solver.workspace import Workspace

__all__ = ["Filter", "LineSearch", "barrier_value", "largest_step"]


def barrier_value(f: float, gap: Floats, mu: float) -> float:
    """``f - mu * sum(log(gap))``."""
    return f - mu * float(np.log(gap).sum()) if gap.size else f


def largest_step(value: Floats, change: Floats, fraction: float) -> float:
    """Largest alpha <= 1 with ``value + alpha * change >= (1 - fraction) * value``, for positive ``value``."""
    if not value.size:
        return 1.0
    worst = float((change / value).min())
    return 1.0 if worst >= -fraction else fraction / -worst


class LineSearch:
    """Backtracks along a step until the filter accepts (:func:`stc.solver.filter_line_search.search`).

    Attributes:
        filter: the filter, which survives from step to step until the barrier parameter changes.
    """

    def __init__(self, work: Workspace, largest_theta: float) -> None:
        self.work = work
        self._stages = stages_of(work)
        s = work.s
        scale = max(1.0, work.it.theta)
        s[SMALL_THETA] = SMALL_VIOLATION * scale
        s[TINY] = s[SHORTEST] = 0.0
        self.filter = work.filter
        self.filter.restart(largest_theta * scale)

    def go_on(self, ended: int) -> bool:
        """Do what a compiled search that has ended so cannot do; whether a step was taken in the end."""
        while ended == CALL_MISSING:
            self.work.provide_solves()
            ended = self._stages.backtrack()
        return ended == TAKEN
