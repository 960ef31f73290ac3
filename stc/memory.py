"""How memory comes and goes: Python's search for unreachable cycles, and what becomes of memory that is freed."""

from __future__ import annotations

import ctypes
import gc
from collections.abc import Iterator
from contextlib import contextmanager

#: Parameters of the GNU C library's ``mallopt``, see ``malloc.h``, and the largest values that it takes for them.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
_LARGEST_TRIM, _LARGEST_MMAP = 2**31 - 1, 32 * 2**20


def keep_freed_memory() -> None:
    """Let this process keep the memory of freed arrays for the next ones, for a process that soon ends.

    Otherwise large arrays are given back to the system one by one, and the next ones come as pages that the system
    has to clear: a tenth of a first solve with 10,000 frames.  Without the GNU C library nothing happens.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # another library; no such way to ask for it
        return
    mallopt(_MMAP_THRESHOLD, _LARGEST_MMAP)
    mallopt(_TRIM_THRESHOLD, _LARGEST_TRIM)


@contextmanager
def without_collection() -> Iterator[None]:
    """Inside, no cycles are searched for: building large expressions takes half the time.

    Expressions and instructions hold no cycles, so nothing piles up.
    """
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()
