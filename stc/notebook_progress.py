"""The line in a notebook that shows the progress of a solve or a sweep, and disappears at its end.

It is HTML that any front end shows; where nothing takes long, nothing appears.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stc.solver.report import IterationRecord
    from stc.sweeps import Sweep

__all__ = ["solving", "sweeping"]

#: Seconds before the line appears, and between two updates.
DELAY, PERIOD = 0.5, 0.2

#: The lines that are on show: what is solved within a sweep has none of its own.
_shown: list[_Line] = []


class _Line:
    """One line that changes."""

    def __init__(self) -> None:
        self._next_update = time.monotonic() + DELAY
        self._handle: Any = None

    def show(self, text: str, share: float | None = None) -> None:
        """Replace the text and the progress bar, unless they were replaced a moment ago."""
        if time.monotonic() < self._next_update:
            return
        bar = "" if share is None else f"<progress value='{share:.4f}' max='1'></progress> "
        self._put(f"<div>{bar}{escape(text)}</div>")
        self._next_update = time.monotonic() + PERIOD

    def close(self) -> None:
        """Remove the line."""
        if self._handle is not None:
            self._put("")

    def _put(self, content: str) -> None:
        from IPython.display import HTML, display

        if self._handle is None:
            self._handle = display(HTML(content), display_id=True)
        else:
            self._handle.update(HTML(content))


@contextmanager
def _line() -> Iterator[_Line | None]:
    """A progress line for this context; None if one is shown already."""
    if _shown:
        yield None
        return
    line = _Line()
    _shown.append(line)
    try:
        yield line
    finally:
        _shown.remove(line)
        line.close()


@contextmanager
def solving(name: str) -> Iterator[Callable[[IterationRecord], None] | None]:
    """A context around a solve. It gives the callback for that solve."""
    with _line() as line:
        if line is None:
            yield None
            return

        def show(iterate: IterationRecord) -> None:
            line.show(
                f"{name}: iteration {iterate.iteration}, objective {iterate.objective:.6g}, "
                f"violation {iterate.violation:.1e}"
            )

        yield show


@contextmanager
def sweeping(name: str) -> Iterator[Callable[[Sweep], None]]:
    """A context around a sweep. It gives the function that is to be called after each point."""
    with _line() as line:

        def show(sweep: Sweep) -> None:
            if line is not None:
                done, count = len(sweep.facts), len(sweep.grid)
                line.show(f"{name}: {done} of {count} points", done / count)

        yield show
