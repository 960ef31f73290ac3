"""A solve that did not end well does not cost what an earlier one has found."""

from __future__ import annotations

from pathlib import Path

from stc.cli import console
from stc.errors import StcError

__all__ = ["keep_optimal"]


def keep_optimal(file: Path, status: str) -> Path | None:
    """Move an optimal solution out of the way of one that is not: ``hop.npz`` becomes ``hop.optimal.npz``, and says so.

    Args:
        file: where a solution is about to be saved.
        status: that one's.

    Returns:
        Where the optimal one is now; None where there was none, or the new one is optimal as well.
    """
    if status == "optimal" or not file.is_file():
        return None
    from stc.solution import read

    try:
        before = read(file).status
    except (StcError, OSError):  # whatever it is, nobody can solve on from it
        return None
    if before != "optimal":
        return None
    kept = file.with_name(f"{file.stem}.optimal{file.suffix}")
    file.replace(kept)
    console.note(f"{file} held an optimal solution, which this one is not: it is kept as {kept}")
    return kept
