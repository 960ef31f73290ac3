"""What two threads do that share prepared calls (:mod:`stc.codegen.threads`), in machine code.

    mailbox   job, active, alive, number of jobs so far, allowed; a mutex at byte 64, a condition at byte 256
    job       mailbox, next call, calls ended, calls in all, record, whether it has run before, two unused; then for
              each call its entry, its cells and how many calls must have ended before
    record    times timed, alone and with help, runs left until the other way is tried, runs from one try to the next

Whoever asks puts a job into the mailbox (``run``, ``share``) and takes one call after the other (``work``), as does the
second thread, which waits for jobs (``serve``).
"""

from __future__ import annotations

import sys

__all__ = ["module_text"]

#: Nanoseconds for which the second thread looks out for more before it sleeps: to wake it takes longer than what is
#: shared next may do.
LINGER = 20_000
#: The clock that only goes forward, by the system's number for it.
CLOCK = 6 if sys.platform == "darwin" else 1


def module_text(shortest: int, longest: int) -> str:
    """The module in LLVM's language.

    Args:
        shortest, longest: fewest and most runs from one try of the other way to the next.
    """
    text = _IR
    for name, value in (("CLOCK", CLOCK), ("SHORTEST", shortest), ("LONGEST", longest), ("LINGER", LINGER)):
        text = text.replace(name, str(value))
    return text


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
