"""How far the barrier parameter mu goes down at each iteration.

While the iterates make progress, mu is chosen anew at each one from a model of the optimality error after the
step (J. Nocedal, A. Waechter and R. A. Waltz, Adaptive barrier update strategies for nonlinear interior
methods, SIAM J. Optim. 19, 2009: the quality function).  When they don't, it is held until the barrier problem
is solved and then reduced superlinearly (Fiacco and McCormick), which is what the convergence theory covers.
"""

from __future__ import annotations

import math

from stc.solver.barrier_update import SMALLEST_TAU
from stc.solver.state import (
    ADAPTIVE,
    CHANGED,
    FREE,
    LARGEST_MU,
    MU,
    SMALLEST_MU,
    TAU,
)
from stc.solver.workspace import Workspace

__all__ = ["BarrierParameter"]


class BarrierParameter:
    """The parameter, the fraction to the boundary, and the mode; :mod:`stc.solver.barrier_update` changes them."""

    def __init__(self, work: Workspace, mu: float, smallest: float, adaptive: bool = True) -> None:
        self._s = s = work.s
        gaps = work.form.gaps
        s[MU] = mu if gaps else 0.0
        s[SMALLEST_MU], s[LARGEST_MU] = smallest, math.inf
        s[ADAPTIVE], s[FREE] = adaptive, adaptive and gaps > 0
        s[TAU], s[CHANGED] = SMALLEST_TAU, 0.0
        work.accepted.restart(math.inf)

    @property
    def mu(self) -> float:
        """The barrier parameter in use."""
        return self._s[MU]
