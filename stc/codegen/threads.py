"""Prepared calls shared between two threads.

    call = parallel([[a, b, c, d], [e, f]])       # a to d in any order, then e and f

A second thread sleeps until there is something to share.  Whoever is free takes the next call of the list, so one
that wakes up late, or never, costs nothing: the first thread does what is left.  Where processors have other things
to do, two threads may still take longer than one; so each list is timed both ways now and then, and goes the faster
one; lists of the same work may share what they learn.  A first run, which finds its memory cold, is not timed.
A phase begins when all calls of the phase before have ended; calls of one phase must not write what others of
it read or write.  Which thread makes a call makes no difference to its result: it is the same bits on one thread and
on two.

The second thread is not used where the process may run on one processor only, in child processes, and when
``STC_THREADS=1`` or :func:`limit` say so.
"""

from __future__ import annotations

import atexit
import ctypes
import os
import threading
from collections.abc import Sequence

from stc.core import library as core
from stc.core.calls import Bound, chain, packed_address
from stc.errors import UsageError

__all__ = ["Record", "allowed", "limit", "parallel", "record"]

_MOST = 2
_limit: int | None = None


def limit(threads: int | None) -> None:
    """Use no more than so many threads from now on; None leaves it to ``STC_THREADS``.

    Calls that were prepared before make no use of the second thread while it is not allowed.

    Raises:
        UsageError: fewer than one; or as for :func:`allowed`.
    """
    global _limit
    if threads is not None and threads < 1:
        raise UsageError(f"the number of threads is {threads}; it is 1 or more")
    _limit = threads
    with _starting:
        for helper in filter(None, _found):
            helper.pool.allowed = int(allowed() > 1)


def allowed() -> int:
    """How many threads may be used: 1 or 2.

    Raises:
        UsageError: ``STC_THREADS`` is not a whole number above 0.
    """
    wanted = _limit
    if wanted is None:
        text = os.environ.get("STC_THREADS", "").strip()
        if text and not (text.isdecimal() and int(text) > 0):
            raise UsageError(f"STC_THREADS is {text!r}; expected a number of threads, 1 or more")
        wanted = int(text) if text else _MOST
    return max(1, min(wanted, _MOST, _processors()))


def _processors() -> int:
    try:
        return len(os.sched_getaffinity(0))
    except (AttributeError, OSError):  # not on every system
        return os.cpu_count() or 1


#: How often a list has been timed, and the nanoseconds that it took alone and with help lately.
Record = ctypes.Array[ctypes.c_int64]


def record() -> Record:
    """A record in which no time has been measured yet."""
    return (ctypes.c_int64 * 3)()


def parallel(phases: Sequence[Sequence[Bound]], known: Record | None = None) -> Bound:
    """One call that makes all calls, phase by phase, those of a phase in any order on up to two threads.

    They are simply made one after the other where no second thread may be used, or some are Python.

    Args:
        phases: the calls.
        known: what lists of the same work have learned, and where this one notes what it learns.
    """
    calls = [call for phase in phases for call in phase]
    if len(calls) == 1:
        return calls[0]
    if not calls or allowed() < 2 or not all(call.native for call in calls):
        return chain(calls)
    helper = _helper()
    if helper is None:
        return chain(calls)
    known = record() if known is None else known
    # See ``job`` in ``stc/core/calls.h``.
    cells = [ctypes.addressof(helper.pool), 0, 0, len(calls), ctypes.addressof(known), 0, 0, 0]
    begun = 0
    for phase in phases:
        for call in phase:
            cells += [packed_address(call), call.args[0], begun]
        begun += len(phase)
    return Bound.of_native(core.library().job_run, cells, (calls, helper, known))


class _Helper:
    """The second thread."""

    def __init__(self) -> None:
        made = core.library().pool_new()
        if not made:
            raise RuntimeError("there are no POSIX threads")
        self.pool: core.Pool = made.contents
        self._thread = threading.Thread(target=self._work, name="stc-second", daemon=True)
        self._thread.start()
        atexit.register(self.stop)

    def _work(self) -> None:
        core.library().pool_serve(self.pool)

    def stop(self) -> None:
        """Ends the thread; calls go on without it."""
        if self.pool.alive:
            core.library().pool_stop(self.pool)
            self._thread.join(1.0)

    def forget(self) -> None:
        """In a child process, which has no second thread."""
        self.pool.alive = 0


_found: list[_Helper | None] = []
_starting = threading.Lock()


def _helper() -> _Helper | None:
    with _starting:
        if not _found:
            try:
                helper = _Helper()
            except (RuntimeError, OSError):  # no POSIX threads here, or no more threads
                _found.append(None)
            else:
                _found.append(helper)
                if hasattr(os, "register_at_fork"):
                    os.register_at_fork(after_in_child=helper.forget)
        return _found[0]
