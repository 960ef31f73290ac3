"""Until when work may go on, and whether somebody has asked for its end: one answer for all that takes long.

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

__all__ = ["begin", "left", "look", "process_began", "spent", "unlimited", "until", "within"]

#: Whether all work of this process is asked to stop; the command line says so.
asked_to_stop = False

_until: ContextVar[float] = ContextVar("until", default=math.inf)


#: Seconds that work may be late that has not led to a motion yet, but soon may.
LATE = 0.1


_unlimited: ContextVar[bool] = ContextVar("unlimited", default=False)


def until() -> float:
    """When the time of this thread is up, on the clock of ``time.perf_counter``; infinite where it never is."""
    return _until.get()


def left() -> float:
    """Seconds until then; negative where it is past."""
    return _until.get() - time.perf_counter()


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Inside, work may go on for so many seconds, or less where less is left already."""
    token = _until.set(min(_until.get(), time.perf_counter() + seconds))
    try:
        yield
    finally:
        _until.reset(token)


def spent(seconds: float) -> Callable[[object], bool]:
    """A callback that stops a solve once this thread has taken so many seconds of processor time from here.

    Unlike a time limit it ends at the same iterate, nearly, however much else the machine has to do.
    """
    end = time.thread_time() + seconds
    return lambda _: time.thread_time() > end


@contextmanager
def unlimited() -> Iterator[None]:
    """Inside, :func:`look` lets everything go on: what there is when the time is up is still to be saved."""
    token = _unlimited.set(True)
    try:
        yield
    finally:
        _unlimited.reset(token)


def begin(at: float) -> None:
    """Let the time of this thread be up at a moment of ``time.perf_counter``, whatever held before."""
    _until.set(at)


def look() -> None:
    """Go on only if that is still wanted.

    Raises:
        EndedError: the time is up, or this process was asked to stop.
    """
    if _unlimited.get():
        return
    if asked_to_stop:
        raise EndedError("interrupted", "interrupted")
    if time.perf_counter() > _until.get() + LATE:
        raise EndedError("the time limit was reached before there was a motion to save", "time_limit")


def process_began() -> float:
    """When this process was started, on the clock of ``time.perf_counter``; now where the system does not tell."""
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
