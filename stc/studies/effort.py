"""What several solves took together."""

from __future__ import annotations

from dataclasses import dataclass

from stc.solution import Solution


@dataclass(slots=True)
class Effort:
    """Sums over solves.

    Attributes:
        solves: how many.
        iterations, factorizations: of all of them.
        seconds: wall time of all of them.
    """

    solves: int = 0
    iterations: int = 0
    factorizations: int = 0
    seconds: float = 0.0

    def add(self, solution: Solution) -> None:
        """Count one more solve."""
        self.solves += 1
        self.iterations += solution.iterations
        self.factorizations += solution.factorizations
        self.seconds += solution.seconds.get("total", 0.0)
