"""Counts, limits, the log, and the best point seen."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from stc import deadline
from stc.core.functions import function
from stc.solver.nlp import Floats
from stc.solver.options import Options
from stc.solver.report import Callback, IterationRecord
from stc.solver.status import Status

__all__ = ["FROM_THE_GUESS", "Monitor", "Stopped"]

FROM_THE_GUESS = "from the guess"
_is_better = function("progress_is_better")


class Stopped(Exception):
    """A limit was reached or the user asked to stop."""

    def __init__(self, status: Status) -> None:
        super().__init__(status.value)
        self.status = status


class Monitor:
    """Follows one solve through all its phases.

    Attributes:
        iterations: steps taken so far.
        limit: how many may be taken.
        history: one record per step, and one for the start.
        strategy: what is being tried, see :mod:`stc.solver.sqp`.
        best: the best point in the user's terms, ``(violation, objective, x, row multipliers)``, or None.
    """

    def __init__(self, options: Options, callback: Callback | None) -> None:
        self.options = options
        self.iterations = 0
        self.limit = options.max_iterations
        self.history: list[IterationRecord] = []
        self.strategy = FROM_THE_GUESS
        self.best: tuple[float, float, Floats, Floats] | None = None
        self._callback = callback
        self._deadline = min(deadline.until(), time.perf_counter() + options.time_limit)

    def count(self) -> None:
        """One more step was taken."""
        self.iterations += 1

    def record(
        self,
        phase: str,
        as_stated: Callable[[], tuple[Floats, Floats]],
        objective: float,
        violation: float,
        optimality: float,
        step: float = 0.0,
        step_length: float = 1.0,
        mu: float = 0.0,
        regularization: float = 0.0,
    ) -> None:
        """Log a point in the user's terms; see :meth:`take`, and :class:`IterationRecord` for the numbers."""
        better = self._is_better(objective, violation)
        best = (violation, objective, *as_stated()) if better else None
        row = [objective, violation, optimality, step, step_length, mu, regularization]
        self.take([row], phase, True, best, as_stated)

    @property
    def watched(self) -> bool:
        """Whether a callback wants to see every iterate."""
        return self._callback is not None

    @property
    def is_late(self) -> bool:
        """Whether the time is up."""
        return self.time_left < 0.0

    @property
    def time_left(self) -> float:
        """Seconds until the time is up."""
        return self._deadline - time.perf_counter()

    def take(
        self,
        rows: list[list[float]],
        phase: str,
        last_is_open: bool,
        best: tuple[float, float, Floats, Floats] | None,
        as_stated: Callable[[], tuple[Floats, Floats]],
    ) -> None:
        """Take over the records of several iterates (``record`` in ``iteration.h``), of one where they are ``watched``.

        Args:
            last_is_open: no step has been taken from the last one yet.
            best: the best point, if it is among them.
            as_stated: gives variables and row multipliers of the last iterate, in the user's terms, arrays that nobody
                changes later; no multipliers where they are not those of the problem.

        Raises:
            Stopped: at a limit, or when the callback returns True.
        """
        number = self.iterations
        for place, row in enumerate(rows):
            objective, violation, optimality, step, length, mu, shift = row
            number = self.iterations + place
            self.history.append(
                IterationRecord(number, objective, violation, optimality, step, length, mu, shift, phase)
            )
        self.iterations = number if last_is_open else number + 1
        if best is not None:
            self.best = best
        if self._callback is not None and self._callback(replace(self.history[-1], x=as_stated()[0])):
            raise Stopped(Status.INTERRUPTED)
        if last_is_open:  # else the last iterate of all is still to come
            self.check()

    def check(self) -> None:
        """Compare with the limits.

        Raises:
            Stopped: when one is reached.
        """
        if self.iterations >= self.limit:
            raise Stopped(Status.ITERATION_LIMIT)
        self.check_time()

    def check_time(self) -> None:
        """Look within a long iteration whether it should not go on.

        Raises:
            Stopped: when the time is up, or the solves of this process were asked to stop.
        """
        if deadline.asked_to_stop:  # a callback is not heard within an iteration
            raise Stopped(Status.INTERRUPTED)
        if self.is_late:
            raise Stopped(Status.TIME_LIMIT)

    def _is_better(self, objective: float, violation: float) -> bool:
        if self.best is None:
            return True
        best_violation, best_objective = self.best[:2]
        tolerance = self.options.feasibility_tolerance
        return _is_better(objective, violation, best_objective, best_violation, tolerance) != 0
