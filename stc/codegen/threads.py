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
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from stc.codegen.calls import Bound, chain, packed_address
from stc.codegen.fixed import FixedModule
from stc.errors import UsageError

__all__ = ["Record", "allowed", "limit", "parallel", "record", "spare"]

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
            helper.allow(allowed() > 1)


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


def spare() -> bool:
    """Whether a second thread may be used and a processor has nothing else to do, where the system tells.

    For what is done once and cannot be tried both ways: two threads that get one processor between them take longer
    than one does.
    """
    return allowed() > 1 and min(_running() for _ in range(3)) < (os.cpu_count() or 1)


def _running() -> int:
    """How many threads of all processes run or wait for a processor just now, the caller included; 1 if unknown."""
    try:
        with Path("/proc/loadavg").open(encoding="ascii") as file:
            return int(file.read().split()[3].split("/")[0])
    except (OSError, ValueError, IndexError):  # not on every system
        return 1


#: How often a list has been timed; the nanoseconds that it took alone and with help lately; how many runs are left
#: until it is tried the other way, and how many there are from one try to the next.
Record = ctypes.Array[ctypes.c_int64]

#: Fewest and most runs from one try of the other way to the next.  Each try that changes nothing doubles their number.
#: A run that others hold up speaks against its way; short waits forgive that soon, where it was held up a little.
_SHORTEST, _LONGEST = 8, 128


#: Nanoseconds for which the second thread looks out for more before it sleeps: to wake it takes longer than what is
#: shared next may do.
_LINGER = 20_000


def record() -> Record:
    """Nothing is known yet."""
    return (ctypes.c_int64 * 5)(0, 0, 0, _SHORTEST, _SHORTEST)


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
    cells = [ctypes.addressof(helper.mailbox), 0, 0, len(calls), ctypes.addressof(known), 0, 0, 0]
    begun = 0
    for phase in phases:
        for call in phase:
            cells += [packed_address(call), call.args[0], begun]
        begun += len(phase)
    return Bound.of_native(helper.run, cells, (calls, helper, known))


class _Helper:
    """The second thread, and the memory through which it is asked."""

    def __init__(self) -> None:
        self.code = MODULE.load()
        entry = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
        self.run: Callable[..., Any] = entry(self.code.address("run"))
        self._serve = entry(self.code.address("serve"))
        self._stop = entry(self.code.address("stop"))
        self.mailbox = (ctypes.c_int64 * 64)()
        entry(self.code.address("prepare"))(ctypes.addressof(self.mailbox))
        self._thread = threading.Thread(target=self._work, name="stc-second", daemon=True)
        self._thread.start()
        atexit.register(self.stop)

    def _work(self) -> None:
        self._serve(ctypes.addressof(self.mailbox))

    def allow(self, wanted: bool) -> None:
        """Whether calls may make use of the thread from now on."""
        self.mailbox[_ALLOWED] = int(wanted)

    def stop(self) -> None:
        """Ends the thread; calls go on without it."""
        if self.mailbox[_ALIVE]:
            self._stop(ctypes.addressof(self.mailbox))
            self._thread.join(1.0)

    def forget(self) -> None:
        """In a child process, which has no second thread."""
        self.mailbox[_ALIVE] = 0


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


#: mailbox: job, active, alive, number of jobs so far, allowed, then a mutex at byte 64 and a condition at byte 256.
#: job: mailbox, next call, calls ended, calls in all, record, whether it has run before, two unused, then for each call
#: its entry, its cells and how many calls must have ended before.
_ALIVE, _ALLOWED = 2, 4
_IR = """\
declare i32 @pthread_mutex_init(ptr, ptr)
declare i32 @pthread_mutex_lock(ptr)
declare i32 @pthread_mutex_unlock(ptr)
declare i32 @pthread_cond_init(ptr, ptr)
declare i32 @pthread_cond_wait(ptr, ptr)
declare i32 @pthread_cond_signal(ptr)
declare i32 @sched_yield()
declare i32 @clock_gettime(i32, ptr)

define void @prepare(ptr %mailbox) nounwind {
  %mutex = getelementptr inbounds i8, ptr %mailbox, i64 64
  %condition = getelementptr inbounds i8, ptr %mailbox, i64 256
  %a = call i32 @pthread_mutex_init(ptr %mutex, ptr null)
  %b = call i32 @pthread_cond_init(ptr %condition, ptr null)
  %alive = getelementptr inbounds i64, ptr %mailbox, i64 2
  store i64 1, ptr %alive, align 8
  %allowed = getelementptr inbounds i64, ptr %mailbox, i64 4
  store i64 1, ptr %allowed, align 8
  ret void
}

define internal void @await(ptr %ended.place, i64 %needed) nounwind {
entry:
  br label %look
look:
  %patience = phi i64 [ 1000, %entry ], [ %less, %waiting ], [ 0, %yield ]
  %ended = load atomic i64, ptr %ended.place acquire, align 8
  %ready = icmp sge i64 %ended, %needed
  br i1 %ready, label %done, label %wait
wait:
  %patient = icmp sgt i64 %patience, 0
  br i1 %patient, label %waiting, label %yield
waiting:
  %less = sub i64 %patience, 1
  br label %look
yield:
  %yielded = call i32 @sched_yield()
  br label %look
done:
  ret void
}

define internal void @work(ptr %job) nounwind {
entry:
  %ticket.place = getelementptr inbounds i64, ptr %job, i64 1
  %ended.place = getelementptr inbounds i64, ptr %job, i64 2
  %total.place = getelementptr inbounds i64, ptr %job, i64 3
  %total = load i64, ptr %total.place, align 8
  br label %next
next:
  %ticket = atomicrmw add ptr %ticket.place, i64 1 acq_rel
  %over = icmp sge i64 %ticket, %total
  br i1 %over, label %done, label %look
look:
  %triple = mul i64 %ticket, 3
  %first = add i64 %triple, 8
  %second = add i64 %triple, 9
  %third = add i64 %triple, 10
  %entry.place = getelementptr inbounds i64, ptr %job, i64 %first
  %cells.place = getelementptr inbounds i64, ptr %job, i64 %second
  %needed.place = getelementptr inbounds i64, ptr %job, i64 %third
  %function = load ptr, ptr %entry.place, align 8
  %arguments = load ptr, ptr %cells.place, align 8
  %needed = load i64, ptr %needed.place, align 8
  call void @await(ptr %ended.place, i64 %needed)
  call void %function(ptr %arguments)
  %before = atomicrmw add ptr %ended.place, i64 1 acq_rel
  br label %next
done:
  ret void
}

define internal i64 @now() nounwind {
  %time = alloca [2 x i64], align 8
  %a = call i32 @clock_gettime(i32 CLOCK, ptr %time)
  %seconds = load i64, ptr %time, align 8
  %second = getelementptr inbounds i64, ptr %time, i64 1
  %rest = load i64, ptr %second, align 8
  %whole = mul i64 %seconds, 1000000000
  %result = add i64 %whole, %rest
  ret i64 %result
}

define void @run(ptr %job) nounwind {
entry:
  %mailbox = load ptr, ptr %job, align 8
  %allowed.place = getelementptr inbounds i64, ptr %mailbox, i64 4
  %allowed = load atomic i64, ptr %allowed.place acquire, align 8
  %both = icmp ne i64 %allowed, 0
  br i1 %both, label %choose, label %simply
simply:
  call void @reset(ptr %job)
  call void @work(ptr %job)
  ret void
choose:
  %record.place = getelementptr inbounds i64, ptr %job, i64 4
  %old.place = getelementptr inbounds i64, ptr %job, i64 5
  %record = load ptr, ptr %record.place, align 8
  %old.number = load i64, ptr %old.place, align 8
  store i64 1, ptr %old.place, align 8
  %old = icmp ne i64 %old.number, 0
  %alone.place = getelementptr inbounds i64, ptr %record, i64 1
  %helped.place = getelementptr inbounds i64, ptr %record, i64 2
  %alone.time = load i64, ptr %alone.place, align 8
  %helped.time = load i64, ptr %helped.place, align 8
  %pays = icmp sle i64 %helped.time, %alone.time
  br i1 %old, label %known, label %new
new:
  br i1 %pays, label %new.with, label %simply
new.with:
  call void @share(ptr %job)
  ret void
known:
  %left.place = getelementptr inbounds i64, ptr %record, i64 3
  %runs = load i64, ptr %record, align 8
  %left = load i64, ptr %left.place, align 8
  %more = add i64 %runs, 1
  store i64 %more, ptr %record, align 8
  %early = icmp slt i64 %runs, 4
  %low = and i64 %runs, 1
  %odd = icmp eq i64 %low, 1
  %again = icmp sle i64 %left, 0
  %turned = xor i1 %pays, %again
  %helped = select i1 %early, i1 %odd, i1 %turned
  %begin = call i64 @now()
  br i1 %helped, label %with, label %without
with:
  call void @share(ptr %job)
  br label %note
without:
  call void @reset(ptr %job)
  call void @work(ptr %job)
  br label %note
note:
  %end = call i64 @now()
  %took = sub i64 %end, %begin
  %place = select i1 %helped, ptr %helped.place, ptr %alone.place
  %before = load i64, ptr %place, align 8
  %difference = sub i64 %took, %before
  %weight = select i1 %again, i64 1, i64 2
  %part = ashr i64 %difference, %weight
  %mixed = add i64 %before, %part
  %shorter = icmp slt i64 %took, %before
  %least = select i1 %shorter, i64 %took, i64 %before
  %learned = select i1 %early, i64 %least, i64 %mixed
  %unknown = icmp eq i64 %before, 0
  %kept = select i1 %unknown, i64 %took, i64 %learned
  store i64 %kept, ptr %place, align 8
  br i1 %early, label %done, label %plan
plan:
  %wait.place = getelementptr inbounds i64, ptr %record, i64 4
  %wait = load i64, ptr %wait.place, align 8
  %alone.now = load i64, ptr %alone.place, align 8
  %helped.now = load i64, ptr %helped.place, align 8
  %pays.now = icmp sle i64 %helped.now, %alone.now
  %changed = xor i1 %pays, %pays.now
  %settled = icmp sge i64 %wait, LONGEST
  %double = shl i64 %wait, 1
  %longer = select i1 %settled, i64 LONGEST, i64 %double
  %sooner = select i1 %settled, i64 SHORTEST, i64 %wait
  %next = select i1 %changed, i64 %sooner, i64 %longer
  %one.less = sub i64 %left, 1
  %planned = or i1 %changed, %again
  %wait.kept = select i1 %planned, i64 %next, i64 %wait
  %left.kept = select i1 %planned, i64 %next, i64 %one.less
  store i64 %wait.kept, ptr %wait.place, align 8
  store i64 %left.kept, ptr %left.place, align 8
  br label %done
done:
  ret void
}

define internal void @reset(ptr %job) nounwind {
  %ticket.place = getelementptr inbounds i64, ptr %job, i64 1
  %ended.place = getelementptr inbounds i64, ptr %job, i64 2
  store atomic i64 0, ptr %ended.place release, align 8
  store atomic i64 0, ptr %ticket.place release, align 8
  ret void
}

define internal void @share(ptr %job) nounwind {
entry:
  %ended.place = getelementptr inbounds i64, ptr %job, i64 2
  %total.place = getelementptr inbounds i64, ptr %job, i64 3
  %total = load i64, ptr %total.place, align 8
  call void @reset(ptr %job)
  %mailbox = load ptr, ptr %job, align 8
  %active.place = getelementptr inbounds i64, ptr %mailbox, i64 1
  %alive.place = getelementptr inbounds i64, ptr %mailbox, i64 2
  %number.place = getelementptr inbounds i64, ptr %mailbox, i64 3
  %mutex = getelementptr inbounds i8, ptr %mailbox, i64 64
  %condition = getelementptr inbounds i8, ptr %mailbox, i64 256
  %alive = load atomic i64, ptr %alive.place acquire, align 8
  %helped = icmp ne i64 %alive, 0
  br i1 %helped, label %offer, label %alone
offer:
  %a = call i32 @pthread_mutex_lock(ptr %mutex)
  %other = load ptr, ptr %mailbox, align 8
  %idle = icmp eq ptr %other, null
  br i1 %idle, label %publish, label %busy
busy:
  %b = call i32 @pthread_mutex_unlock(ptr %mutex)
  br label %alone
alone:
  call void @work(ptr %job)
  ret void
publish:
  store ptr %job, ptr %mailbox, align 8
  %number = load i64, ptr %number.place, align 8
  %following = add i64 %number, 1
  store atomic i64 %following, ptr %number.place release, align 8
  %c = call i32 @pthread_mutex_unlock(ptr %mutex)
  %d = call i32 @pthread_cond_signal(ptr %condition)
  call void @work(ptr %job)
  call void @await(ptr %ended.place, i64 %total)
  %e = call i32 @pthread_mutex_lock(ptr %mutex)
  store ptr null, ptr %mailbox, align 8
  br label %leave
leave:
  %active = load i64, ptr %active.place, align 8
  %still = icmp ne i64 %active, 0
  br i1 %still, label %stay, label %left
stay:
  %f = call i32 @pthread_mutex_unlock(ptr %mutex)
  %g = call i32 @sched_yield()
  %h = call i32 @pthread_mutex_lock(ptr %mutex)
  br label %leave
left:
  %i = call i32 @pthread_mutex_unlock(ptr %mutex)
  ret void
}

define internal void @linger(ptr %number.place, i64 %seen) nounwind {
entry:
  %begin = call i64 @now()
  br label %round
round:
  br label %look
look:
  %looks = phi i64 [ 0, %round ], [ %more, %wait ]
  %number = load atomic i64, ptr %number.place acquire, align 8
  %changed = icmp ne i64 %number, %seen
  br i1 %changed, label %done, label %wait
wait:
  %more = add i64 %looks, 1
  %long = icmp sge i64 %more, 100
  br i1 %long, label %clock, label %look
clock:
  %time = call i64 @now()
  %spent = sub i64 %time, %begin
  %late = icmp sgt i64 %spent, LINGER
  br i1 %late, label %done, label %round
done:
  ret void
}

define void @serve(ptr %mailbox) nounwind {
entry:
  %active.place = getelementptr inbounds i64, ptr %mailbox, i64 1
  %alive.place = getelementptr inbounds i64, ptr %mailbox, i64 2
  %number.place = getelementptr inbounds i64, ptr %mailbox, i64 3
  %mutex = getelementptr inbounds i8, ptr %mailbox, i64 64
  %condition = getelementptr inbounds i8, ptr %mailbox, i64 256
  %a = call i32 @pthread_mutex_lock(ptr %mutex)
  br label %look
look:
  %seen = phi i64 [ 0, %entry ], [ %seen, %watch ], [ %seen, %sleep ], [ %number, %serve ]
  %tired = phi i64 [ 0, %entry ], [ %seen, %watch ], [ %seen, %sleep ], [ %seen, %serve ]
  %alive = load i64, ptr %alive.place, align 8
  %ended = icmp eq i64 %alive, 0
  br i1 %ended, label %done, label %ask
ask:
  %job = load ptr, ptr %mailbox, align 8
  %number = load i64, ptr %number.place, align 8
  %none = icmp eq ptr %job, null
  %known = icmp eq i64 %number, %seen
  %nothing = or i1 %none, %known
  br i1 %nothing, label %rest, label %serve
rest:
  %ready = icmp eq i64 %seen, %tired
  br i1 %ready, label %sleep, label %watch
watch:
  %f = call i32 @pthread_mutex_unlock(ptr %mutex)
  call void @linger(ptr %number.place, i64 %seen)
  %g = call i32 @pthread_mutex_lock(ptr %mutex)
  br label %look
sleep:
  %b = call i32 @pthread_cond_wait(ptr %condition, ptr %mutex)
  br label %look
serve:
  store i64 1, ptr %active.place, align 8
  %c = call i32 @pthread_mutex_unlock(ptr %mutex)
  call void @work(ptr %job)
  %d = call i32 @pthread_mutex_lock(ptr %mutex)
  store i64 0, ptr %active.place, align 8
  br label %look
done:
  %e = call i32 @pthread_mutex_unlock(ptr %mutex)
  ret void
}

define void @stop(ptr %mailbox) nounwind {
  %alive.place = getelementptr inbounds i64, ptr %mailbox, i64 2
  %mutex = getelementptr inbounds i8, ptr %mailbox, i64 64
  %condition = getelementptr inbounds i8, ptr %mailbox, i64 256
  %a = call i32 @pthread_mutex_lock(ptr %mutex)
  store i64 0, ptr %alive.place, align 8
  %b = call i32 @pthread_mutex_unlock(ptr %mutex)
  %c = call i32 @pthread_cond_signal(ptr %condition)
  ret void
}
"""
for _name, _value in (
    ("CLOCK", 6 if sys.platform == "darwin" else 1),
    ("SHORTEST", _SHORTEST),
    ("LONGEST", _LONGEST),
    ("LINGER", _LINGER),
):
    _IR = _IR.replace(_name, str(_value))

MODULE = FixedModule("threads", ("prepare", "serve", "run", "stop"), lambda: _IR)
