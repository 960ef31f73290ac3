"""End this process in time, whatever its main thread is doing: at the time limit, and on signals.

Solves check the time and requests to stop (:mod:`stc.deadline`).  If the main thread does not check, in long-running
machine code or an indivisible step, a second thread ends the command in its place: it hands over the result so far, as
registered with :func:`on_end`, and ends the process.  Signals reach that thread at once, through the descriptor that
Python's own handlers write to.  A second signal ends the process without saving.
"""

from __future__ import annotations

import _thread
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from stc import atomic, deadline
from stc.cli import statuses

__all__ = ["claimed", "limit", "on_end", "settle", "start"]

#: Signals that ask for an end.
STOPPING = frozenset(
    int(number)
    for number in (getattr(signal, name, None) for name in ("SIGINT", "SIGTERM", "SIGHUP"))
    if number is not None
)

#: How late a command may end after its time limit: seconds, or this share of it if that is more.
LATEST, LATEST_SHARE = 0.5, 0.1
#: The share of that which the main thread has to end by itself.
OWN_SHARE = 0.4
#: Seconds within which the other one has to have begun to write what there is.  It takes a tenth of that for most
#: motions; a busy machine is given the rest, for an iterate that is lost is worse than one that is late.
HAND_OVER = 1.0
#: Seconds that it has for the same after a first signal.
PATIENCE = 2.0
#: Seconds to make a motion of an iterate and save it, for each of its unknowns.
SAVING = 1e-6
#: Seconds that words may take where the process is to end at once.
WORDS = 0.1

#: What ends a command: takes ``time_limit`` or ``interrupted`` and returns the exit status.
End = Callable[[str], int]


class _State:
    """The command's deadline and state; shared by the main thread and the guarding thread."""

    end = math.inf  # when this thread begins to end the command, on the clock of `time.perf_counter`
    latest = math.inf  # when it has to have begun to write what there is
    status = "time_limit"
    on_end: End | None = None
    say_ended: Callable[[str], None] = staticmethod(lambda status: None)
    descriptor: int | None = None


#: Held by the thread that shows how the command has ended, or saves what it leaves.
_ending = threading.RLock()
#: Seconds between two looks at how much there would be to save, where there is a limit.
PERIOD = 0.1


def start(on_end: End, say_ended: Callable[[str], None]) -> None:
    """Guard this process from now on; called once, by the main thread.

    Args:
        on_end: default function that ends a command.
        say_ended: function that prints why a command ended without a result: ``time_limit`` or ``interrupted``.
    """
    if not hasattr(signal, "set_wakeup_fd") or os.name != "posix":
        return
    _State.on_end, _State.say_ended = on_end, staticmethod(say_ended)
    read, _State.descriptor = os.pipe()
    os.set_blocking(_State.descriptor, False)
    signal.set_wakeup_fd(_State.descriptor, warn_on_full_buffer=False)
    _thread.start_new_thread(_watch, (read,))


def limit(seconds: float, began: float) -> None:
    """Set the time limit of the command, in seconds after ``began`` on the clock of ``time.perf_counter``."""
    allowed = max(LATEST, LATEST_SHARE * seconds)
    deadline.begin(began + seconds)
    _State.end = began + seconds + OWN_SHARE * allowed
    _State.latest = _State.end + HAND_OVER
    _wake()


@contextmanager
def on_end(end: End) -> Iterator[None]:
    """A context in which this function ends a command that does not end by itself."""
    before, _State.on_end = _State.on_end, end
    try:
        yield
    finally:
        _State.on_end = before


@contextmanager
def claimed() -> Iterator[None]:
    """A context in which the main thread saves or shows its result and is not ended.

    If the command is already being ended, this does not return.
    """
    with _ending:
        yield


def settle() -> None:
    """Leave the end of the process to the calling thread: as :func:`claimed`, permanently."""
    _ending.acquire()


def _saving() -> float:
    """The estimated time in seconds to save the result of the current solve."""
    solves = sys.modules.get("stc.solving.in_progress")
    under_way = getattr(solves, "current", None)  # it may be half imported
    return 0.0 if under_way is None else SAVING * float(under_way.transcription.program.size)


def _wake() -> None:
    if _State.descriptor is not None:
        with suppress(OSError):
            os.write(_State.descriptor, b"\0")


def _watch(read: int) -> None:
    """The guarding thread: end the command when its time is over or a second signal arrives."""
    import select

    signals = 0
    while True:
        wait = None
        if not math.isinf(_State.end):
            wait = min(PERIOD, _State.end - _saving() - time.perf_counter())
            if wait <= 0.0:
                _finish()
        if not select.select([read], [], [], wait)[0]:
            continue
        for number in os.read(read, 64):
            if number not in STOPPING:
                continue
            signals += 1
            if signals > 1:
                _leave_at_once(number)
            _State.status = "interrupted"
            _State.end = min(_State.end, time.perf_counter() + PATIENCE)
            _State.latest = min(_State.latest, _State.end + HAND_OVER)


def _finish() -> None:
    """End the command with the result so far."""
    codes: list[int] = []
    begun, done = threading.Event(), threading.Event()

    def hand_over() -> None:
        _ending.acquire()  # not while the main thread saves what it has found
        begun.set()
        try:
            assert _State.on_end is not None
            codes.append(_State.on_end(_State.status))
        except BaseException:  # whatever goes wrong, the process ends
            if os.environ.get("STC_DEBUG"):
                import traceback

                traceback.print_exc()
        done.set()

    _thread.start_new_thread(hand_over, ())
    begun.wait()
    while not done.wait(max(0.0, _State.latest - time.perf_counter())):
        # What is being written is not given up; where there is nothing to be written yet, there is no time for it.
        if not atomic.is_writing():
            break
        done.wait(PERIOD)
    if not codes:
        _State.say_ended(_State.status)
    _leave(statuses.of_process(codes[0] if codes else statuses.BAD))


def _leave_at_once(number: int) -> None:
    """End the process after a second signal, with a message if there is time."""
    said = _thread.allocate_lock()
    said.acquire()

    def say() -> None:
        with suppress(BaseException):
            if _State.on_end is not None and _ending.acquire(blocking=False):
                _State.say_ended("interrupted")
        said.release()

    _thread.start_new_thread(say, ())
    said.acquire(timeout=WORDS)
    _leave(statuses.BAD if number == signal.SIGINT else 128 + number)


def _leave(code: int) -> None:
    atomic.give_up()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)
