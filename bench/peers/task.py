"""What a module of the comparison offers: ``build(case, variant) -> Task``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Case:
    """One problem at one size.

    Attributes:
        problem: ``P1`` to ``P8``, or ``P3s``.
        n: number of intervals.
        rods: of the chain, for P3, P3s and P4.
        max_iterations: where a tool is to stop; what did not converge by then is compared per iteration.
        time_limit: seconds after which a tool gives up.
    """

    problem: str
    n: int
    rods: int = 0
    max_iterations: int = 3000
    time_limit: float = 60.0

    @property
    def label(self) -> str:
        """What tables call it."""
        return f"{self.problem}, {self.rods} rods" if self.problem == "P4" else self.problem


@dataclass(frozen=True, slots=True)
class Outcome:
    """How one solve ended.

    Attributes:
        objective: of the problem as stated, without penalties.
        iterations: as the tool counts them; 0 where it does not tell.
        solved: the tool says that it has converged.
        status: in the tool's own words.
        x: the decision vector, to be saved.
    """

    objective: float
    iterations: int
    solved: bool
    status: str
    x: Any


@dataclass(frozen=True, slots=True)
class Task:
    """A problem that is set up: everything up to, and not including, the call of the solver.

    Attributes:
        solve: solves from the same guess each time.
        note: how the statement differs from the others', if it does.
        save: writes an outcome to a path in the tool's own way; None for ``numpy.savez``.
    """

    solve: Callable[[], Outcome]
    note: str = ""
    save: Callable[[Outcome, str], None] | None = None
