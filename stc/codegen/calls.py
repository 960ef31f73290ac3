"""Prepared calls of machine code, and chains of them.

A prepared call has all its arguments in consecutive 8-byte cells of memory; calling it hands over one
address.  So every prepared call has the same form, and one call can run a list of others.
"""

from __future__ import annotations

import ctypes
import functools
import threading
from collections.abc import Callable, Sequence
from typing import Any, Self

from stc.codegen import cache, engine

_lock = threading.Lock()


class Bound(functools.partial[Any]):
    """A call with all its arguments converted: ``bound()`` costs about 0.1 microseconds more than the work.

    Scalar arguments can be changed between calls through ``integers`` and ``floats``, two views of the cells.
    ``native`` tells whether machine code is behind it.
    """

    integers: ctypes.Array[ctypes.c_int64]
    floats: ctypes.Array[ctypes.c_double]
    keep: Any
    native: bool = False

    @classmethod
    def of_native(cls, entry: Callable[..., Any], cells: Sequence[int], keep: Any) -> Self:
        """Call ``entry``, a ctypes function, with the address of the cells.

        ``keep`` is whatever must stay alive as long as the call can be made.
        """
        integers = (ctypes.c_int64 * max(len(cells), 1))(*cells)
        bound = cls(entry, ctypes.addressof(integers))
        bound._adopt(integers)
        bound.keep = keep
        bound.native = True
        return bound

    @classmethod
    def of_python(cls, function: Callable[..., Any], arguments: Sequence[Any]) -> Self:
        """The same surface over a Python function."""
        bound = cls(function, *arguments)
        bound.allocate([0])
        return bound

    def allocate(self, cells: Sequence[int]) -> None:
        """Cells for a call that keeps its scalars there without being machine code."""
        self._adopt((ctypes.c_int64 * max(len(cells), 1))(*cells))

    def _adopt(self, integers: ctypes.Array[ctypes.c_int64]) -> None:
        self.integers = integers
        self.floats = (ctypes.c_double * len(integers)).from_buffer(integers)


def chain(calls: Sequence[Bound]) -> Bound:
    """One call that makes others in order; results are dropped, arguments set on the parts count.

    Machine code throughout when all parts are, else a loop in Python.
    """
    parts = tuple(calls)
    if not parts or not all(part.native for part in parts):
        return Bound.of_python(_call_all, (parts,))
    return _chained(None, [(part, False) for part in parts])


def chain_until(calls: Sequence[tuple[Bound, bool]]) -> Bound:
    """The same, but a call marked True ends the chain when its result, a whole number, is not 0.

    The chain's own result is the place of the call that ended it, counted from 1, or 0.
    """
    parts = tuple(calls)
    if not parts or not all(part.native for part, _ in parts):
        return Bound.of_python(_call_until, (parts,))
    return _chained(ctypes.c_int64, parts)


def _chained(result: Any, parts: Sequence[tuple[Bound, bool]]) -> Bound:
    """The machine code of both, ``result`` being the type of what is handed over."""
    cells = [len(parts)]
    for part, checked in parts:
        cells += [packed_address(part), part.args[0], -1 if checked else 0]
    return Bound.of_native(_chain_entry(result), cells, parts)


def packed_address(call: Bound) -> int:
    """Where the machine code of a native call is; it takes the address of the cells, ``call.args[0]``."""
    entry = ctypes.cast(call.func, ctypes.c_void_p).value  # type: ignore[arg-type]
    assert entry is not None
    return entry


def _call_all(parts: tuple[Bound, ...]) -> None:
    for part in parts:
        part()


def _call_until(parts: tuple[tuple[Bound, bool], ...]) -> int:
    for place, (part, checked) in enumerate(parts):
        if part() and checked:
            return place + 1
    return 0


#: cells: count, then (entry, cells, mask of the result) of each part
_CHAIN_IR = """\
define i64 @chain(ptr %cells) nounwind {
entry:
  %count = load i64, ptr %cells, align 8
  %any = icmp sgt i64 %count, 0
  br i1 %any, label %each, label %done
each:
  %k = phi i64 [ 0, %entry ], [ %next, %passed ]
  %first = mul i64 %k, 3
  %second = add i64 %first, 1
  %third = add i64 %first, 2
  %fourth = add i64 %first, 3
  %entry.place = getelementptr inbounds i64, ptr %cells, i64 %second
  %cells.place = getelementptr inbounds i64, ptr %cells, i64 %third
  %mask.place = getelementptr inbounds i64, ptr %cells, i64 %fourth
  %function = load ptr, ptr %entry.place, align 8
  %arguments = load ptr, ptr %cells.place, align 8
  %mask = load i64, ptr %mask.place, align 8
  %result = call i64 %function(ptr %arguments)
  %checked = and i64 %result, %mask
  %next = add i64 %k, 1
  %ended = icmp ne i64 %checked, 0
  br i1 %ended, label %stopped, label %passed
passed:
  %more = icmp slt i64 %next, %count
  br i1 %more, label %each, label %done
stopped:
  ret i64 %next
done:
  ret i64 0
}
"""

_chain: list[engine.LoadedObject] = []


@functools.cache
def _chain_entry(result: Any) -> Callable[..., Any]:
    with _lock:
        if not _chain:
            loaded = engine.cached_object(
                cache.key_of("chain", engine.host().fingerprint(), _CHAIN_IR),
                ["chain"],
                lambda: engine.compile_ir(_CHAIN_IR, level=1, optimise=False),
            )[0]
            _chain.append(loaded)
        return ctypes.CFUNCTYPE(result, ctypes.c_void_p)(_chain[0].address("chain"))
