"""Tasks that end the process which carries them out; other processes find them by the name of this module."""

from __future__ import annotations

import os
import signal
from pathlib import Path


def die(_: int) -> int:
    """End this process."""
    os.kill(os.getpid(), signal.SIGKILL)
    return 0


def die_once(mark: str) -> int:
    """The number that a path ends in; the process that comes to 2 first ends with its task."""
    if Path(mark).name == "2" and not Path(mark).exists():
        Path(mark).touch()
        die(0)
    return int(Path(mark).name)
