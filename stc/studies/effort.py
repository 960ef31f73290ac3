"""The totals of several solves, and their common time limit."""

from __future__ import annotations

import math
import time
from typing import Any

from stc import deadline
from stc.arguments import number
from stc.records import dataclass
from stc.solution import Solution


@dataclass(slots=True)
class Effort:
    """Totals over solves.

    Attributes:
        solves: number of solves.
        iterations, factorizations: their sums.
        seconds: total wall time.
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


class Clock:
    """A time limit for several solves together.

    Args:
        limit: in seconds of wall time; None for none.
    """

    def __init__(self, limit: float | None) -> None:
        self.limit = None if limit is None else number(limit, "the time limit")
        self._begin = time.monotonic()
        if limit is None and math.isfinite(deadline.left()):
            self.limit = max(0.0, deadline.left())

    @property
    def left(self) -> float | None:
        """The remaining time for the next solve, in seconds; None without a limit."""
        own = math.inf if self.limit is None else self.limit - (time.monotonic() - self._begin)
        least = min(own, deadline.left())
        return max(0.0, least) if math.isfinite(least) else None

    @property
    def is_over(self) -> bool:
        """Whether the time is up."""
        return self.left == 0.0

    def option(self) -> dict[str, Any]:
        """The time limit of the next solve as an argument of :meth:`stc.pipeline.Model.solve`."""
        left = self.left
        return {} if left is None else {"time_limit": max(left, 1e-3)}
