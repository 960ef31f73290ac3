"""The progress line of a solve or a validation, and Ctrl-C as a request to stop with the result so far.

The line appears only on a terminal, and only if the work takes a while.  During a solve the first Ctrl-C lets the
solver finish its iteration and return its best iterate; a second one ends the program.  The same applies to the
signals by which systems end programs, if there is something to save.
"""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any

from stc import deadline
from stc.cli import statuses
from stc.terminal_text import visible

if TYPE_CHECKING:
    from stc.solver.report import IterationRecord

#: Seconds before the line appears, and between two updates.
DELAY, PERIOD = 0.15, 0.08

#: How a program is told to end (``kill``, a batch system at its time limit), and that its terminal has gone.
ENDINGS = ("SIGTERM", "SIGHUP")


class Line:
    """One line on a terminal's standard error that is updated and removed; nothing without a terminal."""

    def __init__(self) -> None:
        self.visible = sys.stderr.isatty()
        self._next_update = time.monotonic() + DELAY
        self._live: Any = None

    @property
    def due(self) -> bool:
        """Whether the display is due for an update."""
        return self.visible and time.monotonic() >= self._next_update

    def show(self, text: str) -> None:
        """Replace the text of the line."""
        if not self.visible:
            return
        if self._live is None:
            from rich.live import Live

            from stc.cli.console import rich_console

            self._live = Live(console=rich_console(stderr=True), auto_refresh=False, transient=True)
            self._live.start()
        self._live.update(visible(text), refresh=True)
        self._next_update = time.monotonic() + PERIOD

    def close(self) -> None:
        """Remove the line."""
        if self._live is not None:
            self._live.stop()
            self._live = None


@contextmanager
def validating(title: str) -> Iterator[None]:
    """A context around a validation that shows its progress."""
    from stc.validate.progress import listening

    line = Line()
    if not line.visible:
        yield
        return

    def show(what: str, done: int, count: int) -> None:
        if line.due:
            line.show(f"{title}  {what}  {100 * done // count} %")

    try:
        with listening(show):
            yield
    finally:
        line.close()


class Watch:
    """A context around a solve, and the solver's callback.

    Args:
        title: name of the solve, shown at the start of the line.
        saves: whether the result is saved; if so, a signal to end is a request to stop as well.
    """

    def __init__(self, title: str, saves: bool = False) -> None:
        self.title = title
        self.stopped = False
        self._saves = saves
        self._line = Line()
        self._previous: dict[int, Any] = {}

    def __enter__(self) -> Watch:
        from stc.solving import in_progress  # which other commands do without

        self._solves = in_progress
        if threading.current_thread() is threading.main_thread():
            self._previous[signal.SIGINT] = signal.signal(signal.SIGINT, self._on_signal)
            for name in ENDINGS if self._saves else ():
                number = getattr(signal, name, None)  # not every system has them all
                # `nohup` ignores the one for terminals, and means it.
                if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
                    self._previous[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)
        deadline.asked_to_stop = False
        self._line.close()

    def announce(self, title: str) -> None:
        """Change the title for another solve, and show it."""
        self.title = title
        self._line.show(f"{title}  ...")

    def clear(self) -> None:
        """Remove the line for other output; the next text brings it back."""
        self._line.close()

    def __call__(self, iterate: IterationRecord) -> bool:
        """Show an iterate; True asks the solver to stop."""
        if self._solves.current is not None:
            self._solves.current.note(iterate)
        if self._line.due:
            self._line.show(line(self.title, iterate))
        return self.stopped

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.stopped = True
        deadline.asked_to_stop = True
        if number != signal.SIGINT:
            statuses.ended_by = number
        for again in self._previous:
            signal.signal(again, signal.default_int_handler)
        if self._line.visible:
            with suppress(OSError):  # a terminal that has gone
                sys.stderr.write("\nstopping after this iteration; Ctrl-C again to stop at once\n")


def line(title: str, iterate: IterationRecord) -> str:
    """One iterate in one line of text."""
    return (
        f"{title}  iteration {iterate.iteration}  objective {iterate.objective:.6g}  "
        f"violation {iterate.violation:.1e}  step {iterate.step:.1e}"
    )
