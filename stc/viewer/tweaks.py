"""Changing a spec's constants while its motion is shown: each change is solved from the displayed motion.

Only the newest request counts.  A solve for an older one continues for a moment, since its solution is closer to the
new request than the displayed motion, and is then stopped.  A solve that fails only changes the message.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Any

from stc.errors import StcError
from stc.origin import model_of
from stc.records import dataclass, field
from stc.solution import Solution
from stc.viewer.constants import Constant, constants_of

#: A solve for a wish that is no longer the newest may take so long, in seconds, before it is stopped.
GRACE = 0.3

#: No change of a constant is worked on for longer than this, in seconds.
TIME_LIMIT = 30.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of one request.

    Attributes:
        wish: the values that were asked for, of all constants given from outside.
        status: of the solve, ``superseded`` where a newer wish came, or ``error`` where it could not start.
        message: why the motion did not change; empty where it did.
        iterations: of the solve.
        waited: seconds from the wish until its solve began.
        took: seconds of the solve.
    """

    wish: Mapping[str, float]
    status: str
    message: str
    iterations: int
    waited: float
    took: float


def session_for(solution: Solution) -> TweakSession:
    """A session that starts from a solution, with all constants of its spec.

    Raises:
        SpecError: the text that the solution carries is not a spec.
    """
    return TweakSession(solution, constants_of(model_of(solution), solution))


@dataclass(slots=True)
class _Wish:
    values: dict[str, float]
    made: float = field(default_factory=time.perf_counter)


class TweakSession:
    """Adjustable constants, and the motion for their values.

    All attributes may be read from any thread.

    Attributes:
        solution: the newest motion that was found.
        generation: grows by one with each of them.
        constants: what may be turned, with the values at the start.
        outcome: of the last wish that was worked on; None before the first.
        busy: whether a solve runs.
        iteration: of the solve that runs.
    """

    def __init__(self, solution: Solution, constants: list[Constant]) -> None:
        """Start from a solution, whose spec must be known to it.

        Args:
            solution: where to start from.
            constants: what may be turned.
        """
        self.solution = solution
        self.generation = 0
        self.constants = constants
        self.outcome: Outcome | None = None
        self.busy = False
        self.iteration = 0
        self._wanted = dict(solution.overrides)
        self._pending: _Wish | None = None
        self._change = threading.Condition()
        self._closed = False
        self._thread = threading.Thread(target=self._work, name="tweaks", daemon=True)
        self._thread.start()

    def wanted(self, name: str) -> float:
        """The requested value of a constant, whether or not there is a motion for it."""
        return self._wanted.get(name, self.solution.constants[name])

    @property
    def unsettled(self) -> bool:
        """Whether a request is being processed or waits."""
        with self._change:
            return self.busy or self._pending is not None

    @property
    def refused(self) -> bool:
        """Whether the displayed motion is not the requested one, and no request is being processed."""
        with self._change:
            return not (self.busy or self._pending) and self._wanted != self.solution.overrides

    def turn(self, **values: float) -> None:
        """Request other values of some constants; returns at once."""
        with self._change:
            self._wanted.update(values)
            self._pending = _Wish(dict(self._wanted))
            self._change.notify_all()

    def give_up(self) -> None:
        """Return to the values of the displayed motion."""
        with self._change:
            self._wanted = dict(self.solution.overrides)
            self._pending = None

    def wait(self, seconds: float = 60.0) -> bool:
        """Wait until all requests are processed; returns whether they were in time."""
        with self._change:
            return self._change.wait_for(lambda: not self.busy and self._pending is None, seconds)

    def close(self) -> None:
        """End the session; a running solve is stopped."""
        with self._change:
            self._closed = True
            self._change.notify_all()
        self._thread.join(2.0)

    def _work(self) -> None:
        while True:
            with self._change:
                self._change.wait_for(lambda: self._closed or self._pending is not None)
                if self._closed:
                    return
                wish, self._pending = self._pending, None
                assert wish is not None
                self.busy, self.iteration = True, 0
            outcome, found = self._attempt(wish)
            with self._change:
                self.outcome = outcome
                if found is not None:
                    self.solution = found
                    self.generation += 1
                self.busy = False
                self._change.notify_all()

    def _attempt(self, wish: _Wish) -> tuple[Outcome, Solution | None]:
        begin = time.perf_counter()
        superseded = False

        def look(record: Any) -> bool:
            nonlocal superseded
            self.iteration = record.iteration
            superseded = self._pending is not None and time.perf_counter() - begin > GRACE
            return superseded or self._closed

        found: Solution | None = None
        iterations = 0
        try:
            found = self.solution.resolve(constants=wish.values, callback=look, time_limit=TIME_LIMIT)
            status, iterations = found.status, found.iterations
            message = "" if status == "optimal" else found.message
            if superseded and status == "interrupted":
                status, message = "superseded", ""
            if status != "optimal":
                found = None
        except StcError as error:
            status, message = "error", str(error)
        except Exception as error:  # a thread has nobody else to tell: it goes to the watcher's screen
            status, message = "error", f"{type(error).__name__}: {error}"
        took = time.perf_counter() - begin
        return Outcome(wish.values, status, message, iterations, begin - wish.made, took), found
