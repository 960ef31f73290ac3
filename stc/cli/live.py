"""The line that shows a solve as it goes, and Ctrl-C as a request to stop with what there is.

The line appears on a terminal only, and only when a solve takes long enough to be looked at.  The first
Ctrl-C lets the solver finish its iteration and hand over its best iterate; a second one ends the program.
"""

from __future__ import annotations

import signal
import sys
import threading
import time
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from stc.solver.report import IterationRecord

#: Seconds before the line appears, and between two updates.
DELAY, PERIOD = 0.15, 0.08


class Watch:
    """A context around a solve; itself the solver's callback.

    Args:
        title: what is being solved, shown at the start of the line.
    """

    def __init__(self, title: str) -> None:
        self._title = title
        self._visible = sys.stderr.isatty()
        self._next_update = time.monotonic() + DELAY
        self._live: Any = None
        self._stop = False
        self._previous_handler: Any = None
        self._in_main_thread = threading.current_thread() is threading.main_thread()

    def __enter__(self) -> Watch:
        if self._in_main_thread:
            self._previous_handler = signal.signal(signal.SIGINT, self._on_interrupt)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._in_main_thread:
            signal.signal(signal.SIGINT, self._previous_handler)
        if self._live is not None:
            self._live.stop()

    def __call__(self, iterate: IterationRecord) -> bool:
        """Show an iterate; True asks the solver to stop."""
        if self._visible and time.monotonic() >= self._next_update:
            self._show(iterate)
            self._next_update = time.monotonic() + PERIOD
        return self._stop

    def _on_interrupt(self, number: int, frame: FrameType | None) -> None:
        self._stop = True
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if self._visible:
            sys.stderr.write("\nstopping after this iteration; Ctrl-C again to stop at once\n")

    def _show(self, iterate: IterationRecord) -> None:
        if self._live is None:
            from rich.console import Console
            from rich.live import Live

            self._live = Live(console=Console(stderr=True), auto_refresh=False, transient=True)
            self._live.start()
        self._live.update(line(self._title, iterate), refresh=True)


def line(title: str, iterate: IterationRecord) -> str:
    """One iterate in one line of text."""
    return (
        f"{title}  iteration {iterate.iteration}  objective {iterate.objective:.6g}  "
        f"violation {iterate.violation:.1e}  step {iterate.step:.1e}"
    )
