"""Python's search for unreachable cycles, held off where very many objects live and none are garbage."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


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
