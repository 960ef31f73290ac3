"""Validates the motion on show in MuJoCo, in a separate process, while nothing is dragged."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from stc.solution import Solution

if TYPE_CHECKING:
    from stc.steering.session import Session


class Judge:
    """Judges one motion at a time, and gives up where something else is to be shown."""

    def __init__(self) -> None:
        self._judged: tuple[Solution, str] | None = None
        self._process: subprocess.Popen[str] | None = None
        self._at: Solution | None = None

    def verdict(self, solution: Solution) -> str:
        """The verdict on a motion: ``passed``, the first failure, ``judging`` during the validation, or empty before
        it."""
        if self._judged is not None and self._judged[0] is solution:
            return self._judged[1]
        return "judging" if self._at is solution else ""

    def look(self, session: Session, told: Callable[[], None]) -> None:
        """Begin to judge the motion on show, unless that is known, under way, or about to change."""
        solution = session.solution
        if session.busy or self._at is solution or (self._judged is not None and self._judged[0] is solution):
            return
        self.stop()
        self._at = solution
        threading.Thread(target=self._run, args=(solution, told), name="judge", daemon=True).start()
        told()

    def stop(self) -> None:
        """Give up what is being judged."""
        process, self._process, self._at = self._process, None, None
        if process is not None and process.poll() is None:
            process.terminate()

    def _run(self, solution: Solution, told: Callable[[], None]) -> None:
        with TemporaryDirectory(prefix="stc-steer-") as folder:
            file = Path(folder) / f"{solution.name}.npz"
            solution.save(file)
            command = [sys.executable, "-m", "stc", "validate", str(file), "--json"]
            process = subprocess.Popen(
                command,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                cwd=solution.directory or None,
            )
            if self._at is not solution:
                process.terminate()
            self._process = process
            output = process.communicate()[0]
        if self._at is not solution:
            return
        self._process, self._at = None, None
        self._judged = solution, _verdict(output)
        told()


def _verdict(output: str) -> str:
    """The verdict in the JSON that ``stc validate`` writes as its last line."""
    try:
        found = json.loads(output.strip().splitlines()[-1])["validation"]
        return "passed" if found["passed"] else f"failed: {found['headline']}"
    except (ValueError, IndexError, KeyError, TypeError):
        return "could not be judged"
