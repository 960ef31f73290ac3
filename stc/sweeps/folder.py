"""The folder of a sweep: its definition, the results of its points, and the table.

``sweep.json`` defines the sweep, ``points/K.json`` has the facts of point K, and ``points/K.npz`` its motion.  Every
file is written completely or not at all, the facts of a point last: a point is done if its facts exist.  ``table.csv``
(and ``table.parquet``, if pyarrow is installed) has a row for each point and is rewritten each time.
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
    """The results of a sweep so far.

    Attributes
    ----------
    folder : Path
        The folder of the sweep.
    grid : Grid
        The points of the sweep.
    facts : dict[int, dict[str, Any]]
        The facts of each point that is done, by its index: see :class:`stc.sweeps.point.Found`.
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
        """Whether all points are done, each with an optimum that did not fail in a replay."""
        return self.complete and all(is_good(facts) for facts in self.facts.values())

    def _repr_html_(self) -> str:
        # By name: nothing here is imported from the layers above.
        return str(import_module("stc.notebooks").of_sweep(self))

    def solution(self, index: int) -> Solution:
        """The motion of a point, as a :class:`stc.Solution`.

        Raises
        ------
        UsageError
            The point is not done, or no solution was found there.
        """
        file = motion_file(self.folder, index)
        if index not in self.facts or not file.is_file():
            raise UsageError(f"point {index} of the sweep in {self.folder} has no motion")
        return read(file)

    def columns(self) -> dict[str, list[Any]]:
        """The columns of the table by name: ``point``, the constants, then :data:`FACTS`; a row for each point that is
        done.
        """
        done = sorted(self.facts)
        found: dict[str, list[Any]] = {"point": done}
        for name in self.grid.axes:
            found[name] = [self.grid.constants(index)[name] for index in done]
        for name in FACTS:
            found[name] = [self.facts[index][name] for index in done]
        return found


def is_good(facts: Mapping[str, Any]) -> bool:
    """Whether a point has an optimum that did not fail in a replay."""
    return facts["status"] == "optimal" and facts["verdict"] != "failed"


def facts_file(folder: Path, index: int) -> Path:
    """The file of a point's facts."""
    return folder / "points" / f"{index}.json"


def motion_file(folder: Path, index: int) -> Path:
    """The file of a point's motion."""
    return folder / "points" / f"{index}.npz"


def points_of(path: Path) -> tuple[dict[str, Any], dict[int, dict[str, Any]]]:
    """The description of a sweep in its folder, and the facts of each finished point, by index.

    Raises:
        UsageError: it is no folder of a sweep, or a file in it cannot be read.
    """
    manifest = path / "sweep.json"
    if not manifest.is_file():
        raise UsageError(
            f"{path} is no folder of a sweep", "`stc sweep SPEC --set NAME=VALUES -o FOLDER` makes one"
        )
    found = {
        int(file.stem): _json(file) for file in (path / "points").glob("*.json") if file.stem.isdecimal()
    }
    return _json(manifest), found


class Folder:
    """A folder for a new sweep, or one that holds a part of this sweep.

    Args:
        path: the folder, which is created if it is missing.
        about: the definition of the sweep for JSON; the same for all runs of one sweep.

    Raises:
        UsageError: the folder holds another sweep, or files that do not belong to a sweep.
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
        return {index: facts for index, facts in points_of(self.path)[1].items() if index < len(grid)}

    def keep(self, found: Found) -> None:
        """Write the result of a point."""
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
