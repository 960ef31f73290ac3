"""Changing a spec's constants while its motion is shown: each change is solved from the displayed motion.

Only the newest request counts.  A solve for an older one continues for a moment, since its solution is closer to the
new request than the displayed motion, and is then stopped.  A solve that fails only changes the message.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from stc.errors import StcError
from stc.records import dataclass, field
from stc.solution import Solution
from stc.solution_origin import model_of
from stc.viewer.constants import Constant, constants_of

#: A solve for a wish that is no longer the newest may take so long, in seconds, before it is stopped.
GRACE = 0.3

#: An iterate that violates what is stated by no more, and is as near to optimal, looks like the solution.
NEAR, NEARLY_OPTIMAL = 1e-3, 5e-2

#: So may the first step from the motion on show, taken with the right active set: of the way to the solution it leaves
#: 0.1 to 4 % at the most (landing places of the lamp and the quadruped, moved by up to 1 cm).
NEAR_AFTER_ONE_STEP = 0.1

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
    epoch: int
    made: float = field(default_factory=time.perf_counter)


class TweakSession:
    """Adjustable constants, and the motion for their values.

    All attributes may be read from any thread.

    Attributes:
        solution: the newest motion that was found.
        generation: grows by one with each of them, and with each sketch.
        sketch: an iterate that is near to the solution that is being worked on; None where there is none.
        constants: what may be turned, with the values at the start.
        outcome: of the last wish that was worked on; None before the first.
        busy: whether a solve runs.
        iteration: of the solve that runs.
    """

    def __init__(
        self,
        solution: Solution,
        constants: list[Constant],
        told: Callable[[], None] | None = None,
        *,
        grace: float = GRACE,
        max_iterations: int | None = None,
        sketches: bool = False,
    ) -> None:
        """Start from a solution, whose spec must be known to it.

        Args:
            solution: where to start from.
            constants: what may be turned.
            told: called from the session's thread whenever a wish has been worked on.
            grace: seconds that a solve may take for a wish that is no longer the newest.
            max_iterations: of a solve; the solver's own limit where it is None.
            sketches: whether to offer an iterate that is near to a solution before that is found.
        """
        self.solution = solution
        self.generation = 0
        self.sketch: Solution | None = None
        self.constants = constants
        self.outcome: Outcome | None = None
        self.busy = False
        self.iteration = 0
        self._wanted = dict(solution.overrides)
        self._pending: _Wish | None = None
        self._grace, self._most, self._sketches = grace, max_iterations, sketches
        self._told = told or (lambda: None)
        self._epoch = 0  # grows when another motion is put in the place of what is worked on
        self._change = threading.Condition()
        self._closed = False
        self._thread = threading.Thread(target=self._work, name="tweaks", daemon=True)
        self._thread.start()

    def wanted(self, name: str) -> float:
        """The requested value of a constant, whether or not there is a motion for it."""
        return self._wanted.get(name, self.solution.constants[name])

    @property
    def wants(self) -> dict[str, float]:
        """All constants set from outside for the requested motion."""
        with self._change:
            return dict(self._wanted)

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
            self._pending = _Wish(dict(self._wanted), self._epoch)
            self._change.notify_all()

    def give_up(self) -> None:
        """Return to the values of the displayed motion."""
        with self._change:
            self._wanted = dict(self.solution.overrides)
            self._pending = None

    def restore(self, solution: Solution) -> None:
        """Go back to a motion that was found before, whatever is being worked on."""
        with self._change:
            self._epoch += 1
            self._wanted = dict(solution.overrides)
            self._pending = None
            self.solution, self.outcome, self.sketch = solution, None, None
            self.generation += 1
            self._change.notify_all()

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
                if wish.epoch == self._epoch:
                    self.outcome = outcome
                    # A sketch on the way to something newer is better than the motion before it.
                    if found is not None or (self.sketch is not None and outcome.status != "superseded"):
                        self.solution, self.sketch = found or self.solution, None
                        self.generation += 1
                self.busy = False
                self._change.notify_all()
            self._told()

    def _offer(self, record: Any, wish: _Wish) -> None:
        """Show an iterate as a sketch of what is being worked on."""
        method = self.solution.method
        sketch = model_of(self.solution).reached(record, method=method, constants=wish.values)
        with self._change:
            if wish.epoch == self._epoch:
                self.sketch = sketch
                self.generation += 1
        self._told()

    def _attempt(self, wish: _Wish) -> tuple[Outcome, Solution | None]:
        begin = time.perf_counter()
        superseded, sketched = False, not self._sketches

        def look(record: Any) -> bool:
            nonlocal superseded, sketched
            self.iteration = record.iteration
            near = record.violation <= NEAR and record.optimality <= NEARLY_OPTIMAL
            near |= record.phase == "warm" and record.violation <= NEAR_AFTER_ONE_STEP
            if not sketched and near and record.iteration and record.x is not None:
                sketched = True
                self._offer(record, wish)
            superseded = self._pending is not None and time.perf_counter() - begin > self._grace
            return superseded or self._closed or wish.epoch != self._epoch

        found: Solution | None = None
        iterations = 0
        try:
            limits = {"callback": look, "time_limit": TIME_LIMIT, "max_iterations": self._most}
            found = self.solution.resolve(constants=wish.values, **limits)
            if found.status in ("iteration_limit", "failed"):
                # Multipliers of a motion that differs in what is at its bounds lead astray: from the motion alone.
                start = {"warm_start": None, "guess": self.solution}
                found = self.solution.resolve(constants=wish.values, **start, **limits)
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
