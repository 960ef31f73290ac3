"""The result of a solve, and the records of its iterations."""

from __future__ import annotations

from collections.abc import Callable

from stc.records import dataclass, field
from stc.solver.nlp import Floats
from stc.solver.status import Status

__all__ = ["Callback", "IterationRecord", "Result", "Start"]


@dataclass(frozen=True, slots=True)
class Start:
    """A primal-dual starting point.

    Attributes:
        x: variables, (n,).
        row_multipliers: (m,) or None; sign convention of :mod:`stc.solver.nlp`.
        bound_multipliers: (n,) or None.
    """

    x: Floats
    row_multipliers: Floats | None = None
    bound_multipliers: Floats | None = None


@dataclass(slots=True)
class IterationRecord:
    """One line of the solver's log.

    Attributes:
        iteration: number of steps taken so far.
        objective: objective in the user's units.
        violation: largest violation of a row or bound, each relative to ``max(1, |bound|)``.
        optimality: KKT error of the scaled problem.
        step: largest change of a (scaled) variable in the last step, relative to ``1 + |variable|``.
        step_length: accepted fraction of the last step; above 1 where it was lengthened.
        mu: barrier parameter (0 in a Newton step on the active set).
        regularization: what was added to the Hessian's diagonal.
        phase: ``"barrier"``, ``"active-set"``, ``"warm"`` (from a neighbour's solution) or ``"restoration"``.
        x: the point itself, (n,), for the callback only: a history keeps none.  It is the solver's own array,
            to be copied by whoever keeps it.  None while the same motion is solved on fewer frames.
    """

    iteration: int
    objective: float
    violation: float
    optimality: float
    step: float
    step_length: float
    mu: float
    regularization: float
    phase: str
    x: Floats | None = field(default=None, repr=False, compare=False)


Callback = Callable[[IterationRecord], bool | None]
"""Called after every iteration; returning True stops the solve with status ``interrupted``."""


@dataclass(frozen=True, slots=True)
class Result:
    """Outcome of a solve.

    Attributes:
        status: how it ended.
        x: the solution, or the best point seen, (n,).
        row_multipliers: (m,), sign convention of :mod:`stc.solver.nlp`.
        bound_multipliers: (n,).
        objective: objective at ``x``.
        violation: largest violation at ``x`` of a row or bound, each relative to ``max(1, |bound|)``.
        optimality: KKT error of the problem as stated, relative to the size of its terms.
        iterations: steps of all phases together.
        factorizations: every factorisation of a KKT system.
        message: one or two sentences for the user.
        history: one record per iteration.
        strategy: what was tried last, and found the answer if there is one.
    """

    status: Status
    x: Floats
    row_multipliers: Floats
    bound_multipliers: Floats
    objective: float
    violation: float
    optimality: float
    iterations: int
    factorizations: int
    message: str
    history: list[IterationRecord] = field(default_factory=list, repr=False)
    strategy: str = ""

    @property
    def success(self) -> bool:
        """True when the status is optimal."""
        return self.status is Status.OPTIMAL
