"""The time limit of the current thread, and requests to stop, for all long-running work.

    with within(5.0):       # seconds from here; an earlier end that holds outside holds inside as well
        ...
        look()              # raises EndedError where the time is up

Solves stop at an iterate (:mod:`stc.solver.monitor`); what comes before there is one ends with
:class:`stc.errors.EndedError`.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

from stc.errors import EndedError

__all__ = ["begin", "left", "look", "process_began", "spent", "unlimited", "until", "using", "within"]

#: Whether all work of this process is asked to stop; the command line says so.
asked_to_stop = False

_until: ContextVar[float] = ContextVar("until", default=math.inf)


#: Seconds that work may be late that has not led to a motion yet, but soon may.
LATE = 0.1


#: The end of this thread's processor time, on the clock of ``time.thread_time``.
_spent: ContextVar[float] = ContextVar("spent", default=math.inf)


_unlimited: ContextVar[bool] = ContextVar("unlimited", default=False)


def until() -> float:
    """The end of this thread's time, on the clock of ``time.perf_counter``; infinite without a limit."""
    return _until.get()


def left() -> float:
    """Seconds until the end; negative if it is past."""
    return _until.get() - time.perf_counter()


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """A context with a time limit in seconds; an earlier outer limit still applies."""
    token = _until.set(min(_until.get(), time.perf_counter() + seconds))
    try:
        yield
    finally:
        _until.reset(token)


def spent(seconds: float) -> Callable[[object], bool]:
    """A callback that stops a solve after this thread has used a number of seconds of processor time.

    Unlike a time limit it stops at nearly the same iterate, whatever the load of the machine is.
    """
    end = time.thread_time() + seconds
    return lambda _: time.thread_time() > end


@contextmanager
def using(seconds: float) -> Iterator[None]:
    """A context with a limit of processor time in seconds for what is done before a solve; see :func:`spent` for that.

    :func:`look` raises where it is up.
    """
    token = _spent.set(min(_spent.get(), time.thread_time() + seconds))
    try:
        yield
    finally:
        _spent.reset(token)


@contextmanager
def unlimited() -> Iterator[None]:
    """A context in which :func:`look` never raises, to save the result when the time is up."""
    token = _unlimited.set(True)
    try:
        yield
    finally:
        _unlimited.reset(token)


def begin(at: float) -> None:
    """Set the end of this thread's time, on the clock of ``time.perf_counter``."""
    _until.set(at)


def look() -> None:
    """Check that the work may continue.

    Raises:
        EndedError: the time is up, or this process was asked to stop.
    """
    if _unlimited.get():
        return
    if asked_to_stop:
        raise EndedError("interrupted", "interrupted")
    if time.perf_counter() > _until.get() + LATE or time.thread_time() > _spent.get():
        raise EndedError("the time limit was reached before there was a motion to save", "time_limit")


def process_began() -> float:
    """The start of this process, on the clock of ``time.perf_counter``; now if the system does not say."""
    now = time.perf_counter()
    with suppress(OSError, ValueError, IndexError, AttributeError):
        # The name of the program is in parentheses, and may hold anything; the start is the 22nd field.
        fields = (
            Path("/proc/self/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
        )
        age = time.clock_gettime(time.CLOCK_BOOTTIME) - int(fields[19]) / os.sysconf("SC_CLK_TCK")
        if age >= 0.0:
            return now - age
    return now
