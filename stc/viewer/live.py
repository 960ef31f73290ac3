"""A solve in progress: every iterate as a motion, and a way to stop it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from stc.errors import SolutionError
from stc.solution import Solution

if TYPE_CHECKING:
    from stc.pipeline import Model
    from stc.solver.report import IterationRecord

#: Iterates closer than this, in seconds of wall time, are not turned into motions: nobody sees them apart.
PERIOD = 0.04


class LiveSolve:
    """A solve on a thread of its own.

    All attributes may be read from any thread.

    Attributes:
        iterate: the newest iterate as a motion; None before the first.
        generation: grows by one with each of them, and with the solution.
        record: the solver's last line of log.
        solution: the result; None while it runs, or if it failed to start.
        error: why there is no result.
    """

    def __init__(
        self, model: Model, keep: Callable[[Solution], None] = lambda solution: None, **options: Any
    ) -> None:
        """Prepare, without starting.

        Args:
            model: the spec.
            keep: is handed the solution as soon as there is one, whatever its status.
            **options: of :meth:`stc.pipeline.Model.solve`; ``method`` and ``constants`` among them.
        """
        self.iterate: Solution | None = None
        self.generation = 0
        self.record: IterationRecord | None = None
        self.solution: Solution | None = None
        self.error: BaseException | None = None
        self._model = model
        self._keep = keep
        self._options = options
        self._shown = -PERIOD
        self._stop = threading.Event()
        self._first = threading.Event()
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._run, name="solve", daemon=True)

    def start(self) -> None:
        """Begin to solve."""
        self._thread.start()

    def stop(self) -> None:
        """Ask the solver to return its best iterate at the end of the iteration."""
        self._stop.set()

    @property
    def stopping(self) -> bool:
        """Whether the solver has been asked to stop."""
        return self._stop.is_set()

    @property
    def running(self) -> bool:
        """Whether the solve is still running."""
        return not self._done.is_set()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until it has ended; whether it has."""
        return self._done.wait(seconds)

    def wait_for_motion(self, seconds: float | None = None) -> bool:
        """Wait for something to show: the first iterate, or the end; whether it came."""
        return self._first.wait(seconds)

    def _run(self) -> None:
        try:
            solution = self._model.solve(callback=self._look, **self._options)
            self._keep(solution)
            self.solution = self.iterate = solution
            self.generation += 1
        except BaseException as error:  # carried over to the thread that waits
            self.error = error
        finally:
            self._done.set()
            self._first.set()

    def _look(self, record: IterationRecord) -> bool:
        now = time.monotonic()
        if now - self._shown >= PERIOD and record.x is not None:
            self._shown = now
            motion = self._model.reached(
                record, method=self._options.get("method"), constants=self._options.get("constants")
            )
            try:
                motion.require_increasing_times()
            except SolutionError:  # a free duration on its way: nothing that could be shown
                pass
            else:
                self.iterate = motion
                self.generation += 1
                self._first.set()
        self.record = replace(record, x=None)
        return self._stop.is_set()
