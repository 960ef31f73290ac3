"""Prepared calls of machine code, and chains of them (``stc/core/calls.h``).

A prepared call has all its arguments in consecutive 8-byte cells of memory; calling it hands over one
address.  So every prepared call has the same form, one call can run a list of others, and compiled functions can make
those of a table by number.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable, Sequence
from typing import Any, Self

import numpy as np

from stc.core.library import library


class Bound(functools.partial[Any]):
    """A call with all its arguments converted: ``bound()`` costs about 0.1 microseconds more than the work.

    Scalar arguments can be changed between calls through ``integers`` and ``floats``, two views of the cells.
    ``native`` tells whether machine code is behind it.
    """

    integers: ctypes.Array[ctypes.c_int64]
    keep: Any
    native: bool = False
    entry: int | None = None

    @classmethod
    def of_native(cls, entry: Callable[..., Any], cells: Sequence[int], keep: Any) -> Self:
        """Call ``entry``, a ctypes function, with the address of the cells.

        ``keep`` is whatever must stay alive as long as the call can be made.
        """
        integers = (ctypes.c_int64 * max(len(cells), 1))(*cells)
        bound = cls(entry, ctypes.addressof(integers))
        bound.integers = integers
        bound.keep = keep
        bound.native = True
        return bound

    @classmethod
    def of_python(cls, function: Callable[..., Any], arguments: Sequence[Any]) -> Self:
        """The same surface over a Python function."""
        bound = cls(function, *arguments)
        bound.integers = (ctypes.c_int64 * 1)()
        return bound

    @functools.cached_property
    def floats(self) -> ctypes.Array[ctypes.c_double]:
        """The cells as numbers; a view that most calls never need."""
        return (ctypes.c_double * len(self.integers)).from_buffer(self.integers)


def chain(calls: Sequence[Bound]) -> Bound:
    """One call that makes others in order; results are dropped, arguments set on the parts count.

    Machine code throughout when all parts are, else a loop in Python.
    """
    parts = tuple(calls)
    if not _all_native(parts):
        return Bound.of_python(_call_all, (parts,))
    return _chained([(part, False) for part in parts])


def chain_until(calls: Sequence[tuple[Bound, bool]]) -> Bound:
    """The same, but a call marked True ends the chain when its result, a whole number, is not 0.

    The chain's own result is the place of the call that ended it, counted from 1, or 0.
    """
    parts = tuple(calls)
    if not _all_native([part for part, _ in parts]):
        return Bound.of_python(_call_until, (parts,))
    return _chained(parts)


def _all_native(parts: Sequence[Bound]) -> bool:
    return bool(parts) and all(part.native for part in parts)


def _chained(parts: Sequence[tuple[Bound, bool]]) -> Bound:
    cells = [len(parts)]  # see ``chain`` in ``stc/core/calls.h``
    for part, checked in parts:
        cells += [packed_address(part), part.args[0], -1 if checked else 0]
    return Bound.of_native(library().chain_run, cells, parts)


def packed_address(call: Bound) -> int:
    """Where the machine code of a native call is; it takes the address of the cells, ``call.args[0]``."""
    if call.entry is None:
        call.entry = ctypes.cast(call.func, ctypes.c_void_p).value  # type: ignore[arg-type]
        assert call.entry is not None
    return call.entry


class CallTable:
    """Prepared calls that a function of the core makes by number (``invoke`` in ``stc/core/native.h``).

    Calls of Python functions may be among them: what they raise is kept, and raised by :meth:`check`.

    Attributes:
        cells: what such a function takes for the table: two for each call, 0 where there is none, then one that is 1
            when a Python function has raised something, after which the others do nothing.
    """

    def __init__(self, size: int) -> None:
        self.cells = np.zeros(2 * size + 1, dtype=np.int64)
        self._parts: list[Bound | None] = [None] * size
        self._entries: list[Any] = [None] * size
        self._raised: BaseException | None = None

    def put(self, place: int, call: Bound | None) -> None:
        """Set one call, or none."""
        if self._parts[place] is call:
            return
        self._parts[place] = call
        entry = address = 0
        if call is None:
            pass
        elif call.native:
            entry, address = packed_address(call), call.args[0]
        else:
            address = ctypes.addressof(call.integers)
            self._entries[place] = made = _CALLBACK(functools.partial(self._guarded, call))
            entry = ctypes.cast(made, ctypes.c_void_p).value or 0
        self.cells[2 * place], self.cells[2 * place + 1] = entry, address

    def check(self) -> None:
        """Raise what a Python function has raised since the last time."""
        if self._raised is not None:
            raised = self._raised
            self.forget()
            raise raised

    def forget(self) -> None:
        """Do not raise it."""
        self._raised, self.cells[-1] = None, 0

    def _guarded(self, call: Bound, _: Any) -> int:
        if self._raised is not None:  # nothing counts any more
            return 0
        try:
            return int(call() or 0)
        except BaseException as raised:  # it cannot pass through machine code
            self._raised, self.cells[-1] = raised, 1
            return 0


_CALLBACK = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p)


def _call_all(parts: tuple[Bound, ...]) -> None:
    for part in parts:
        part()


def _call_until(parts: tuple[tuple[Bound, bool], ...]) -> int:
    for place, (part, checked) in enumerate(parts):
        if part() and checked:
            return place + 1
    return 0
