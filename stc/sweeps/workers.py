"""Apply one function to many tasks, in one process or in several.

joblib (https://joblib.readthedocs.io) manages the processes: by default its own pool on one machine (loky), or the
backend that ``joblib.parallel_config`` selects, such as a Dask or Ray cluster.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from functools import cache
from importlib.util import find_spec
from multiprocessing import current_process
from types import TracebackType
from typing import Any, TypeVar

from stc.arguments import whole
from stc.errors import StcError, UsageError

__all__ = ["WorkerError", "Workers", "can_share"]

T = TypeVar("T")
R = TypeVar("R")

#: Seconds between two looks at whether the parent is still there.
_LOOK = 1.0


class WorkerError(StcError):
    """A worker process ended before its task did."""


def can_share() -> bool:
    """Whether more than one worker is possible, that is, joblib is installed."""
    return find_spec("joblib") is not None


class Workers:
    """A context in which tasks are carried out side by side.

    Args:
        count: the number of processes; 1 means this process.  None means as many as there are processors, or as the
            backend of ``joblib.parallel_config`` has; without joblib, this process.

    Raises:
        UsageError: fewer than one, or more than one without joblib.
    """

    def __init__(self, count: int | None = None) -> None:
        if count is not None:
            count = whole(count, "the number of workers")
            if count < 1:
                raise UsageError(f"at least one worker is needed, not {count}")
        if not can_share():
            if count not in (None, 1):
                raise UsageError(
                    f"{count} workers need joblib, which is not installed", "`pip install joblib` installs it"
                )
            count = 1
        self._count = count
        self._parallel: Any = None

    def __enter__(self) -> Workers:
        if self._count != 1:
            from joblib import Parallel

            # One task at a time and results as they come: each is worth keeping at once.
            self._parallel = Parallel(
                n_jobs=-1 if self._count is None else self._count,
                batch_size=1,
                return_as="generator_unordered",
            ).__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._parallel is not None:
            self._parallel.__exit__(kind, error, trace)

    def results(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """The results of a function for each task, in the order in which they are done.

        Args:
            function: a function at the top level of a module, so that other processes can import it.
            tasks: arguments of the function; they must be picklable for other processes.

        Raises:
            WorkerError: a worker of joblib's own pool was killed. (A cluster starts such tasks again.)
        """
        if self._parallel is None:
            yield from map(function, tasks)
            return
        from joblib import delayed

        try:
            yield from self._parallel(delayed(_elsewhere)(os.getpid(), function, task) for task in tasks)
        except BrokenProcessPool:
            raise WorkerError(
                "a worker process was ended from outside, perhaps because the machine ran out of memory"
            ) from None


def _elsewhere(asker: int, function: Callable[[T], R], task: T) -> R:
    """Carry out one task in a worker, on one thread, since other workers use the other processors."""
    if os.getpid() != asker:
        from stc.codegen.threads import limit

        limit(1)
        # A worker of joblib's own pool is a child of the asker, which may be gone already.
        if current_process().name.startswith("LokyProcess"):
            _end_with(asker)
    return function(task)


@cache
def _end_with(parent: int) -> None:
    """End this process soon after its parent, which may be killed; otherwise joblib's workers wait minutes for new
    work.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK)
        os._exit(1)

    threading.Thread(target=watch, name="end with the parent", daemon=True).start()
