"""Whether the spec of a solution has changed on disk since it was solved."""

from __future__ import annotations

import hashlib
import re
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
    # A search for the number of frames states plain frame numbers as shares of n: `[25*n/60]` for `[25]`.
    plain = re.sub(r"\b(\d+)\*n/\d+\b", r"\1", solution.source)
    if hashlib.sha256(plain.encode()).hexdigest() == now:
        return []
    return [
        f"{path.name} has changed since this solution was made (then {solution.sha256[:12]}, now {now[:12]}): "
        "solve it again"
    ]
