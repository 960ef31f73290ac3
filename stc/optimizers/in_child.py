"""A method that cannot be interrupted, in a separate process, which can be ended at a time limit without losing its
best iterate.

NLopt's algorithms work long between two evaluations of a large problem, and hold Python's lock meanwhile: no other
thread could check the time, or a signal.  A copy of this process therefore runs them and reports each iterate; this
process shows them, and ends the copy at the limit or on request.
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any, NoReturn

import numpy as np

from stc import deadline
from stc.optimizers.point_result import judge, point_result
from stc.solver.monitor import Monitor, Stopped
from stc.solver.nlp import NLP
from stc.solver.options import Options
from stc.solver.report import Callback, IterationRecord, Result
from stc.solver.status import Status

__all__ = ["minimize_in_child"]

#: Seconds between two looks at requests to stop.
PERIOD = 0.05
#: Seconds after the time limit in which the other process may end by itself, with what it makes of its last point.
OWN_END = 0.05

Method = Callable[[Callback | None], Result]


def minimize_in_child(method: Method, nlp: NLP, options: Options, callback: Callback | None) -> Result:
    """The result of ``method`` in another process.

    Args:
        method: minimises ``nlp``, and calls the callback that it is given.
        nlp: the problem.
        options: those of the solve; its time limit is counted from here.
        callback: called in this process; returning True stops the solve.

    Raises:
        Exception: the exceptions of the method; MemoryError where the system ended the other process.
    """
    if not hasattr(os, "fork"):
        return method(callback)
    with deadline.within(options.time_limit):
        child = _Child(method, nlp)
        try:
            return _followed(child, nlp, options, callback)
        finally:
            child.end()


def _followed(child: _Child, nlp: NLP, options: Options, callback: Callback | None) -> Result:
    """The result, or that of the best iterate if the child has to be stopped."""
    monitor = Monitor(replace(options, max_iterations=2**62), callback)
    try:
        while True:
            if deadline.asked_to_stop:
                raise Stopped(Status.INTERRUPTED)
            if monitor.time_left < -OWN_END:
                raise Stopped(Status.TIME_LIMIT)
            told = child.told()
            if told is None:
                continue
            kind, what, counted = told
            if counted is not None:
                nlp.counts[:] = counted  # type: ignore[attr-defined]
            if kind == "raised":
                raise what
            if kind == "result":
                assert isinstance(what, Result)
                return what
            _note(monitor, what)
    except Stopped as stopped:
        status = stopped.status
    except KeyboardInterrupt:
        status = Status.INTERRUPTED
    child.end()
    x = np.clip(nlp.x0, nlp.x_lower, np.maximum(nlp.x_lower, nlp.x_upper))
    if monitor.best is not None:
        x = monitor.best[2]
    # To look for the multipliers that suit a point takes long for large problems, and the time is up.
    return point_result(nlp, judge(nlp, x, options, np.zeros(nlp.m)), status, monitor)


def _note(monitor: Monitor, told: IterationRecord) -> None:
    """Record an iterate, and keep the point if it is the best so far."""
    x = told.x
    assert x is not None
    monitor.iterations = told.iteration
    try:
        monitor.record(
            told.phase,
            lambda: (x, np.zeros(0)),
            told.objective,
            told.violation,
            told.optimality,
            told.step,
            told.step_length,
            told.mu,
            told.regularization,
        )
    except Stopped as stopped:
        if stopped.status is not Status.TIME_LIMIT:  # of which `_followed` decides
            raise


class _Child:
    """The other process, and its messages."""

    def __init__(self, method: Method, nlp: NLP) -> None:
        from multiprocessing import Pipe

        self._here, there = Pipe(duplex=False)
        with warnings.catch_warnings():
            # Of threads that hold locks: none of them is used there.
            warnings.simplefilter("ignore", DeprecationWarning)
            self._process = os.fork()
        if not self._process:
            self._here.close()
            _carry_out(method, nlp, there)
        there.close()

    def told(self) -> tuple[str, Any, Any] | None:
        """The next message; None if there is none at the moment.

        Raises:
            MemoryError: the process was ended by the system.
        """
        if not self._here.poll(PERIOD):
            return None
        try:
            message: tuple[str, Any, Any] = self._here.recv()
        except EOFError:
            raise MemoryError("the process of the optimizer was ended by the system") from None
        return message

    def end(self) -> None:
        """End the child process at once."""
        if self._process:
            with suppress(ProcessLookupError):
                os.kill(self._process, signal.SIGKILL)
            with suppress(ChildProcessError):
                os.waitpid(self._process, 0)
            self._process = 0
            self._here.close()


def _carry_out(method: Method, nlp: NLP, pipe: Any) -> NoReturn:
    """The work of the other process."""
    try:
        # This process is ended by the other one, which alone hears signals.
        if threading.current_thread() is threading.main_thread():
            signal.set_wakeup_fd(-1)
            for name in ("SIGINT", "SIGTERM", "SIGHUP"):
                signal.signal(getattr(signal, name), signal.SIG_IGN)
        _end_with_parent()

        def send(kind: str, what: object) -> None:
            # How often the program was evaluated, where it counts that: it does so in this process.
            pipe.send((kind, what, getattr(nlp, "counts", None)))

        def tell(record: IterationRecord) -> bool:
            send("iterate", record)
            return False

        try:
            found = method(tell)
        except BaseException as error:
            try:
                pickle.loads(pickle.dumps(error))
            except Exception:
                error = RuntimeError(f"{type(error).__name__}: {error}")
            send("raised", error)
        else:
            send("result", found)
    finally:
        os._exit(0)


def _end_with_parent() -> None:
    """Let the system end this process together with its parent, if it can."""
    import ctypes

    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG
        if os.getppid() == 1:
            os._exit(0)
