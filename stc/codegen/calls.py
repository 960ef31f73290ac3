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
    cells = [len(parts)]
    for part in parts:
        cells += [packed_address(part), part.args[0]]
    return Bound.of_native(_chain_entry(), cells, parts)


def packed_address(call: Bound) -> int:
    """Where the machine code of a native call is; it takes the address of the cells, ``call.args[0]``."""
    entry = ctypes.cast(call.func, ctypes.c_void_p).value  # type: ignore[arg-type]
    assert entry is not None
    return entry


def _call_all(parts: tuple[Bound, ...]) -> None:
    for part in parts:
        part()


#: cells: count, then (entry, cells) of each part
_CHAIN_IR = """\
define void @chain(ptr %cells) nounwind {
entry:
  %count = load i64, ptr %cells, align 8
  %any = icmp sgt i64 %count, 0
  br i1 %any, label %each, label %done
each:
  %k = phi i64 [ 0, %entry ], [ %next, %each ]
  %twice = shl i64 %k, 1
  %first = add i64 %twice, 1
  %second = add i64 %twice, 2
  %entry.place = getelementptr inbounds i64, ptr %cells, i64 %first
  %cells.place = getelementptr inbounds i64, ptr %cells, i64 %second
  %function = load ptr, ptr %entry.place, align 8
  %arguments = load ptr, ptr %cells.place, align 8
  call void %function(ptr %arguments)
  %next = add i64 %k, 1
  %more = icmp slt i64 %next, %count
  br i1 %more, label %each, label %done
done:
  ret void
}
"""

_chain: list[tuple[Callable[..., Any], engine.LoadedObject]] = []


def _chain_entry() -> Callable[..., Any]:
    with _lock:
        if not _chain:
            loaded = engine.cached_object(
                cache.key_of("chain", engine.host().fingerprint(), _CHAIN_IR),
                ["chain"],
                lambda: engine.compile_ir(_CHAIN_IR, level=1, optimise=False),
            )[0]
            _chain.append((ctypes.CFUNCTYPE(None, ctypes.c_void_p)(loaded.address("chain")), loaded))
        return _chain[0][0]
