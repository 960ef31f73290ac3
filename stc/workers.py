"""Calls one function for many tasks, in one process or in several.

Several processes are joblib's business (https://joblib.readthedocs.io): on one machine its own pool of processes
(loky), and whatever else ``joblib.parallel_config`` names, such as a Dask or Ray cluster.
"""

from __future__ import annotations

import os
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from importlib.util import find_spec
from itertools import chain, islice
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
#: So many times in a row that workers are lost, and no task is done in between, end the whole.
_MOST_LOSSES = 3
#: What joblib's backends raise when a worker process has gone, by the names of the classes: its own pool, Ray, and Dask
#: after it has given a task to several workers in vain.
_LOSSES = frozenset(("TerminatedWorkerError", "RayActorError", "KilledWorker"))
#: Where a backend hands over results only when all its tasks are done, it is given so many for each worker at a time.
_AT_A_TIME = 4


class WorkerError(StcError):
    """Worker processes ended before their tasks did, several times in a row."""


def can_share() -> bool:
    """Whether there can be more than one worker: joblib is installed."""
    return find_spec("joblib") is not None


class Workers:
    """A context in which tasks are carried out side by side.

    Args:
        count: how many processes; 1 means this process.  None means as many as there are processors, or as the backend
            of ``joblib.parallel_config`` has; without joblib, this process.

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
        self._together: int | None = None  # so many tasks at a time; None for all

    def __enter__(self) -> Workers:
        if self._count != 1:
            self._begin()
        return self

    def _begin(self) -> None:
        from joblib import Parallel, effective_n_jobs
        from joblib.parallel import get_active_backend

        # One task at a time and, but for Ray's pool, results as they come: each is worth keeping at once.
        count = -1 if self._count is None else self._count
        one_by_one = getattr(get_active_backend()[0], "supports_return_generator", False)
        self._together = None if one_by_one else _AT_A_TIME * effective_n_jobs(count)
        how = "generator_unordered" if one_by_one else "list"
        self._parallel = Parallel(n_jobs=count, batch_size=1, return_as=how).__enter__()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._parallel is not None:
            self._parallel.__exit__(kind, error, trace)

    def results(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """The results of the tasks, in the order in which they finish.

        The tasks of a worker that is lost are given to others.

        Args:
            function: of a module, so that other processes find it by its name.
            tasks: to be pickled, where they go to other processes.

        Raises:
            WorkerError: workers were lost several times in a row, and no task was done in between.
        """
        for _, result in self._numbered(function, tasks):
            yield result

    def in_order(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """As :meth:`results`, in the order of the tasks."""
        early: dict[int, R] = {}
        following = 0
        for number, result in self._numbered(function, tasks):
            early[number] = result
            while following in early:
                yield early.pop(following)
                following += 1

    def _numbered(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[tuple[int, R]]:
        if self._parallel is None:
            yield from enumerate(map(function, tasks))
            return
        from joblib import delayed

        left = enumerate(tasks)
        begun: dict[int, T] = {}

        def given(again: list[tuple[int, T]]) -> Iterator[Any]:
            for number, task in chain(again, left):
                begun[number] = task
                yield delayed(_elsewhere)(os.getpid(), function, number, task)

        losses = 0
        while losses < _MOST_LOSSES:
            try:
                for number, result in self._shared(given(list(begun.items()))):
                    losses = 0
                    del begun[number]
                    yield number, result
                return
            except Exception as error:
                if not _LOSSES & {one.__name__ for one in type(error).__mro__}:
                    raise
                losses += 1
                self.__exit__(None, None, None)
                self._begin()
        raise WorkerError(
            "worker processes were ended from outside, perhaps because the machine ran out of memory"
        )

    def _shared(self, calls: Iterator[Any]) -> Iterator[Any]:
        """The values that the calls return."""
        if self._together is None:
            outputs = self._parallel(calls)
            try:
                # `yield from` would close it, with a warning, where nobody asks for more.
                for output in outputs:  # noqa: UP028
                    yield output
            finally:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")  # joblib's advice to ask for less
                    outputs.close()
            return
        while part := list(islice(calls, self._together)):
            yield from self._parallel(part)


def _elsewhere(asker: int, function: Callable[[T], R], number: int, task: T) -> tuple[int, R]:
    """Carry out one task in a worker: on one thread, since the others have the other processors."""
    if os.getpid() != asker:
        from stc.codegen.threads import limit

        limit(1)
        # A worker of joblib's own pool is a child of the asker, which may be gone already.
        if current_process().name.startswith("LokyProcess"):
            _end_with(asker)
    return number, function(task)


@cache
def _end_with(parent: int) -> None:
    """Let this process end soon after its parent, which may be killed; joblib's workers wait minutes for new work."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK)
        os._exit(1)

    threading.Thread(target=watch, name="end with the parent", daemon=True).start()
