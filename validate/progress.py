"""The progress of a long validation: loops report it, and a command line can show it.

Without a listener in the same context, reporting costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

#: Called with what is being done, how many steps of it are done, and of how many.
Listener = Callable[[str, int, int], None]

_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """A context in which every step of a validation is reported to the listener."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


def steps(what: str, count: int) -> Iterator[int]:
    """The numbers 0 to ``count - 1``, each reported when it is reached."""
    listener = _listener.get()
    if listener is None:
        yield from range(count)
        return
    for step in range(count):
        listener(what, step, count)
        yield step
