"""Memory: Python's search for unreachable cycles, and a limit for the process."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

#: Bytes that a process is let have in any case.
SMALLEST = 2**28


def stay_within_memory() -> None:
    """Limit the memory of the process, so that too large allocations raise MemoryError, which can be reported.

    Linux grants them otherwise and kills the process, or another one, once the memory is used.
    """
    free = _available()
    if free is None:
        return
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = max(free, SMALLEST)
    if (soft == resource.RLIM_INFINITY or most < soft) and (hard == resource.RLIM_INFINITY or most < hard):
        with suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_DATA, (most, hard))


def _available() -> int | None:
    """Bytes that this process may still take without anything being pushed out; None if the system does not provide
    it.
    """
    try:
        with Path("/proc/meminfo").open(encoding="ascii") as lines:
            free = next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    except (OSError, ValueError, IndexError, StopIteration):
        return None
    with suppress(OSError, ValueError):  # "max" where the group of processes has no limit of its own
        group = Path("/sys/fs/cgroup")
        limit = int((group / "memory.max").read_text(encoding="ascii"))
        free = min(free, limit - int((group / "memory.current").read_text(encoding="ascii")))
    return free


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
