"""How one attempt at a problem is made, and how it ends."""

from __future__ import annotations

from enum import Enum

from stc.records import dataclass
from stc.solver.formulation import Formulation
from stc.solver.iterate import Iterate
from stc.solver.nlp import Floats

__all__ = ["ACCEPTABLE", "BUDGET", "PROGRESS", "SHORT_BUDGET", "End", "Outcome", "Tactics"]

LONG_BUDGET, BUDGET, SHORT_BUDGET = 500, 300, 100
"""Steps of an attempt, of one of several, and of one that has a solution nearby."""
BRIEF = 3
LARGEST_THETA = 30.0
PROGRESS = 0.9
"""Of an error: what is less counts as progress (Waechter and Biegler 2006, of a restoration)."""
ACCEPTABLE = 1e-6
"""A KKT error that may count as solved where rounding errors allow no better."""


class End(Enum):
    """Why the iteration ended."""

    CONVERGED = "converged"
    STOPPED = "stopped"  # by the caller's condition
    STATIONARY_VIOLATION = "stationary violation"
    UNBOUNDED = "unbounded"
    STUCK = "stuck"
    SADDLE = "saddle"  # a stationary point that is no minimum, and that no way was found to leave


@dataclass(frozen=True, slots=True)
class Tactics:
    """The settings that differ between attempts.

    Attributes:
        adaptive: choose the barrier parameter freely while that makes progress.
        largest_theta: admissible violation, relative to that of the start or to 1.
        budget: steps after which the attempt ends, unless it converges by then.
        brief_restorations: those that end where the filter accepts. Where steps fail again after so many, the next ones
            go on to the least violation: on a way between nowhere and nearly there, that tells whether there is a
            feasible point.
    """

    adaptive: bool = True
    largest_theta: float = LARGEST_THETA
    budget: int = LONG_BUDGET
    brief_restorations: int = BRIEF


@dataclass(slots=True)
class Outcome:
    """The end of the iteration: the last iterate and the reason.

    Attributes:
        end: why.
        form: the formulation that was solved.
        x, y: the point, (n,) and (m,), in the formulation's scale.
        error: KKT error there.
        iterate: the last iterate of the barrier, where there was one.
        early: whether it could have gone on: its steps were used up.
        minimum: whether the second-order condition is known to hold there.
    """

    end: End
    form: Formulation
    x: Floats
    y: Floats
    error: float
    iterate: Iterate | None = None
    early: bool = False
    minimum: bool = False

    @property
    def is_answer(self) -> bool:
        """Whether it says all there is to say of the problem, whatever other attempts would lead to."""
        return self.end in (End.CONVERGED, End.UNBOUNDED)
