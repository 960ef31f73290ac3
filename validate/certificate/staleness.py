"""Whether the spec of a solution has changed on disk since it was solved."""

from __future__ import annotations

import hashlib
from pathlib import Path

from stc.solution import Solution


def stale(solution: Solution) -> list[str]:
    """A line for a spec that has changed since it was solved; empty if it has not, or does not exist."""
    if not solution.directory:
        return []
    path = Path(solution.directory) / f"{solution.name}.stc"
    try:
        text = path.read_bytes()
    except OSError:
        return []
    now = hashlib.sha256(text.replace(b"\r\n", b"\n")).hexdigest()
    if solution.sha256 in (now, hashlib.sha256(text).hexdigest()):
        return []
    return [
        f"{path.name} has changed since this solution was made (then {solution.sha256[:12]}, now {now[:12]}): "
        "solve it again"
    ]
