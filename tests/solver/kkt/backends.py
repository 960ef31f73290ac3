"""Scripts run in processes of their own, with machine code or without."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path


def printed_by(script: str, backend: str) -> list[str]:
    """The words that a script prints; its first argument is the folder of the tests."""
    return subprocess.run(
        [sys.executable, "-c", script, str(Path(__file__).parents[2])],
        env={**os.environ, "STC_BACKEND": backend},
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
