"""The folder of a sweep: what is swept, what each point came to, and the table of all.

``sweep.json`` says what is swept, ``points/K.json`` what point K came to; its motion is in ``points/K.npz``.  All files
are written whole or not at all, that of a point's facts last: a point is done where this one is there.  ``table.csv``
(``table.parquet`` as well, where pyarrow is installed) has a row for each point and is written anew each time.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from stc.atomic import replacing
from stc.errors import UsageError
from stc.records import dataclass
from stc.solution import Solution, read
from stc.sweeps.grid import Grid
from stc.sweeps.point import Found

__all__ = ["FACTS", "Folder", "Sweep"]

FORMAT = 1

#: What is known of a point besides its constants, in the order of the table's columns.
FACTS = (
    "status",
    "objective",
    "violation",
    "optimality",
    "iterations",
    "start",
    "verdict",
    "margin",
    "message",
)


@dataclass(slots=True)
class Sweep:
    """What a sweep has found so far.

    Attributes:
        folder: where it is kept.
        grid: its points.
        facts: by the index of each point that is done, what it came to: see :class:`stc.sweeps.point.Found`.
    """

    folder: Path
    grid: Grid
    facts: dict[int, dict[str, Any]]

    @property
    def complete(self) -> bool:
        """Whether all points are done."""
        return len(self.facts) == len(self.grid)

    @property
    def good(self) -> bool:
        """Whether all points are done, each with an optimum that the replay, where there was one, did not fail."""
        return self.complete and all(is_good(facts) for facts in self.facts.values())

    def _repr_html_(self) -> str:
        # By name: nothing here is imported from the layers above.
        return str(import_module("stc.notebooks").of_sweep(self))

    def solution(self, index: int) -> Solution:
        """The motion of a point.

        Raises:
            UsageError: the point is not done, or no solution was found there.
        """
        file = motion_file(self.folder, index)
        if index not in self.facts or not file.is_file():
            raise UsageError(f"point {index} of the sweep in {self.folder} has no motion")
        return read(file)

    def columns(self) -> dict[str, list[Any]]:
        """The table, column by column: ``point``, the constants, then :data:`FACTS`; the points that are done."""
        done = sorted(self.facts)
        found: dict[str, list[Any]] = {"point": done}
        for name in self.grid.axes:
            found[name] = [self.grid.constants(index)[name] for index in done]
        for name in FACTS:
            found[name] = [self.facts[index][name] for index in done]
        return found


def is_good(facts: Mapping[str, Any]) -> bool:
    """Whether a point has an optimum that no replay failed."""
    return facts["status"] == "optimal" and facts["verdict"] != "failed"


def facts_file(folder: Path, index: int) -> Path:
    """Where a point's facts are kept."""
    return folder / "points" / f"{index}.json"


def motion_file(folder: Path, index: int) -> Path:
    """Where a point's motion is kept."""
    return folder / "points" / f"{index}.npz"


class Folder:
    """A folder that takes up a sweep, or already holds a part of it.

    Args:
        path: of the folder, which is made where it is missing.
        about: what is swept, as JSON takes it; the same for all runs of one sweep.

    Raises:
        UsageError: the folder holds another sweep, or files that no sweep has written.
    """

    def __init__(self, path: Path, about: Mapping[str, Any]) -> None:
        self.path = path
        manifest = path / "sweep.json"
        wanted = {"format": FORMAT, **about}
        if manifest.is_file():
            self._require_same(_json(manifest), wanted)
        elif path.exists() and (not path.is_dir() or any(path.iterdir())):
            raise UsageError(f"{path} is not a folder of a sweep, and not empty", "name a new folder with -o")
        (path / "points").mkdir(parents=True, exist_ok=True)
        if not manifest.is_file():
            _write_json(manifest, wanted)

    def _require_same(self, found: Mapping[str, Any], wanted: Mapping[str, Any]) -> None:
        known = json.loads(json.dumps(wanted))
        other = [key for key in known if found.get(key) != known[key]]
        if other:
            raise UsageError(
                f"{self.path} holds another sweep: it differs in {', '.join(other)}",
                "name another folder with -o, or delete this one to sweep anew",
            )

    def done(self, grid: Grid) -> dict[int, dict[str, Any]]:
        """The facts of the points that are done, by index.

        Raises:
            UsageError: a file that cannot be read.
        """
        found = {}
        for file in (self.path / "points").glob("*.json"):
            if file.stem.isdecimal() and int(file.stem) < len(grid):
                found[int(file.stem)] = _json(file)
        return found

    def keep(self, found: Found) -> None:
        """Write what a point came to."""
        if found.file is not None:
            with replacing(motion_file(self.path, found.index)) as temporary:
                temporary.write_bytes(found.file)
        _write_json(facts_file(self.path, found.index), found.facts)

    def motion(self, index: int) -> bytes:
        """The bytes of the solution file of a point that is done."""
        return motion_file(self.path, index).read_bytes()

    def write_table(self, sweep: Sweep) -> None:
        """Write the table of the points that are done."""
        columns = sweep.columns()
        with (
            replacing(self.path / "table.csv") as temporary,
            temporary.open("w", newline="", encoding="utf-8") as stream,
        ):
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows(zip(*columns.values()))
        if find_spec("pyarrow") is not None:
            import pyarrow
            import pyarrow.parquet

            with replacing(self.path / "table.parquet") as temporary:
                pyarrow.parquet.write_table(pyarrow.table(columns), temporary)


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _json(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        if isinstance(found, dict):
            return found
    except (OSError, ValueError):
        pass
    raise UsageError(
        f"{path} cannot be read as a file of a sweep", "delete it to have this part of the sweep done again"
    )
