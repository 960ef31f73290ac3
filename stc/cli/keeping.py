"""Protection of existing files: of earlier solutions if a solve fails, and of the files that a command reads."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from stc.cli import console
from stc.errors import StcError

if TYPE_CHECKING:
    from stc.pipeline import Model

__all__ = ["inputs_of", "keep_inputs", "keep_optimal"]


def inputs_of(model: Model) -> list[tuple[str | Path, str]]:
    """The files that a spec is read from, each with a description: its own, and those of its data."""
    from stc.language.syntax import DataFile

    path = model.source.path
    folder = Path(path).parent if path else Path()
    found: list[tuple[str | Path, str]] = [] if path is None else [(path, "the spec itself")]
    for block in model.tree.blocks("data"):
        named = [each for each in block.statements if isinstance(each, DataFile)]
        found += [(folder / each.path, f"the data `{each.name.name}` of the spec") for each in named]
    return found


def keep_inputs(file: Path, model: Model, guess: Path | None = None) -> None:
    """Refuse to overwrite an input of a solve, before it begins.

    A saved solution may be replaced by the one that started from it, as ``--warm-start`` does.

    Args:
        file: file for the solution.
        model: the spec.
        guess: table of starting values.

    Raises:
        UsageError: that file is the spec, data that it reads, or a table of starting values.
    """
    from stc.arguments import same_file, spare

    spare(file, inputs_of(model), "-o")
    if guess is not None and same_file(file, guess) and not _is_saved(guess):
        spare(file, [(guess, "the table of --guess-from")], "-o")


def _is_saved(file: Path) -> bool:
    """Whether a file contains a readable solution."""
    from stc.solution import read

    try:
        read(file)
    except (StcError, OSError):
        return False
    return True


def keep_optimal(file: Path, status: str) -> Path | None:
    """Rename an optimal solution that would be replaced by one that is not: ``hop.npz`` becomes ``hop.optimal.npz``,
    with a note.

    Args:
        file: file for the new solution.
        status: status of the new solution.

    Returns:
        The new path of the optimal solution; None if there was none, or the new one is optimal as well.
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
    console.note(
        f"{file} held an optimal solution, and the new one is not optimal; the old file is kept as {kept}"
    )
    return kept
