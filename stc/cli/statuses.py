"""Exit statuses of the command ``stc``.

A command that a signal ended has 128 and the signal's number, as shells know it: 143 for SIGTERM.
"""

from __future__ import annotations

#: Optimal, or validated; not; a mistake in the input.
GOOD, BAD, MISTAKE = 0, 1, 2

#: Whether this process was started for one command.
owns_process = False

#: The signal that was taken for a request to stop, Ctrl-C apart; 0 for none.
ended_by = 0


def of_process(status: int) -> int:
    """The exit status of this process for a command with ``status``."""
    return 128 + ended_by if ended_by else status
