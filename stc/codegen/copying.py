"""Copies of blocks of memory by machine code, where the C library's ``memcpy`` does badly.

Large ones go past the caches, which they would only empty.  What is overwritten as a whole need not be read before,
which is a third of the traffic.  The library knows that as well, but from sizes on that depend on caches as a virtual
machine describes them: hundreds of megabytes.

For smaller ones it has an instruction (``rep movsb``) that some processors take ten times as long for where the target
is a few bytes behind the source within a page, as neighbouring parts of one array are (glibc before 2.39 on Zen 3 and
4: its bug 30994).
"""

from __future__ import annotations

from stc.codegen.fixed import FixedModule

__all__ = ["COPY_IR", "MODULE", "REPLACED", "SYMBOL"]

#: Blocks of so many bytes are not smaller than what a processor can count on to find again.
LARGE = 2**22
SYMBOL = "copy"
#: What machine code wants from the C library, and gets this function instead of.
REPLACED = ("memcpy", "memmove")

#: Blocks of so many bytes may be left to that instruction ...
MIDDLING = 2**11
#: ... in pages of this size, but not where the target is so much further in one than the source, or less.
PAGE = 4096
BEHIND = 63

#: As ``memmove``.  Lines of 64 bytes of the target, what is before and behind them by way of the library; the fence
#: is for other threads, which may read what has been copied.
COPY_IR = f"""\
declare ptr @memmove(ptr, ptr, i64)
declare void @llvm.x86.sse.sfence()
define ptr @{SYMBOL}(ptr %to, ptr %from, i64 %size) nounwind {{
entry:
  %small = icmp ult i64 %size, {MIDDLING}
  br i1 %small, label %library, label %look
look:
  %target = ptrtoint ptr %to to i64
  %source = ptrtoint ptr %from to i64
  %ahead = sub i64 %target, %source
  %behind = sub i64 %source, %target
  %within = and i64 %ahead, {PAGE - 1}
  %nearly = sub i64 %within, 1
  %slow = icmp ult i64 %nearly, {BEHIND}
  %large = icmp uge i64 %size, {LARGE}
  %own = or i1 %slow, %large
  %clear.ahead = icmp uge i64 %ahead, %size
  %clear.behind = icmp uge i64 %behind, %size
  %apart = and i1 %clear.ahead, %clear.behind
  %wanted = and i1 %own, %apart
  br i1 %wanted, label %lines, label %library
lines:
  %negative = sub i64 0, %target
  %head = and i64 %negative, 63
  %after = sub i64 %size, %head
  %whole = and i64 %after, -64
  %tail = and i64 %after, 63
  %end = add i64 %head, %whole
  call ptr @memmove(ptr %to, ptr %from, i64 %head)
  br i1 %large, label %past, label %each
past:
  %at.past = phi i64 [ %head, %lines ], [ %next.past, %past ]
  %read.past = getelementptr i8, ptr %from, i64 %at.past
  %written.past = getelementptr i8, ptr %to, i64 %at.past
  %line.past = load <8 x double>, ptr %read.past, align 1
  store <8 x double> %line.past, ptr %written.past, align 64, !nontemporal !0
  %next.past = add i64 %at.past, 64
  %more.past = icmp ult i64 %next.past, %end
  br i1 %more.past, label %past, label %fence
fence:
  call void @llvm.x86.sse.sfence()
  br label %last
each:
  %at = phi i64 [ %head, %lines ], [ %next, %each ]
  %read = getelementptr i8, ptr %from, i64 %at
  %written = getelementptr i8, ptr %to, i64 %at
  %line = load <8 x double>, ptr %read, align 1
  store <8 x double> %line, ptr %written, align 64
  %next = add i64 %at, 64
  %more = icmp ult i64 %next, %end
  br i1 %more, label %each, label %last
last:
  %from.tail = getelementptr i8, ptr %from, i64 %end
  %to.tail = getelementptr i8, ptr %to, i64 %end
  call ptr @memmove(ptr %to.tail, ptr %from.tail, i64 %tail)
  ret ptr %to
library:
  %same = tail call ptr @memmove(ptr %to, ptr %from, i64 %size)
  ret ptr %same
}}
!0 = !{{i32 1}}
"""
MODULE = FixedModule("copying", (SYMBOL,), lambda: COPY_IR, instead={})
