"""Numbers that a spec reads: columns with names, from a file or from the spec itself.

``.csv``
    The first line names the columns; every other one is a row with a number for each.  Empty cells and ``nan`` are
    gaps.  Cells are separated by ``,``, ``;`` or tabulators; lines that begin with ``#`` say nothing.
``.npz``
    NumPy arrays by their names, numbers alone, of one or two dimensions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray

from stc import npz
from stc.errors import StcError
from stc.recorded_files import DATA_ROLE, RecordedFile
from stc.records import dataclass, field

__all__ = ["MOST_BYTES", "SUFFIXES", "TIME", "DataError", "DataSet", "files_of", "read_file", "sizes"]

FloatArray = NDArray[np.float64]

#: What the names of files of numbers end in.
SUFFIXES = (".csv", ".tsv", ".npz")
#: A file of numbers may be so large: solutions carry it whole.
MOST_BYTES = 2**25
#: The column that tells when each row was measured, in seconds.
TIME = "time"


class DataError(StcError):
    """An invalid file or table of numbers; ``hint`` says how to correct it."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message, self.hint = message, hint

    def __str__(self) -> str:
        return self.message


@dataclass(frozen=True, slots=True, eq=False)
class DataSet:
    """Columns of numbers with names.

    Attributes:
        name: its name in the spec.
        columns: each (k,), in the order of the file, NaN where a cell is empty; arrays of an ``.npz`` may have other
            lengths than each other, or two dimensions.
        where: its name in messages: its file, or "" for numbers in the spec.
        lines: (k,) the line number of each row in the file; empty if there is no file.
        file: the file with its content; None for numbers in the spec.
        structural: the constants from which numbers in the spec were computed.
    """

    name: str
    columns: Mapping[str, FloatArray]
    where: str = ""
    lines: Sequence[int] = ()
    file: RecordedFile | None = None
    structural: frozenset[str] = field(default_factory=frozenset)

    @property
    def rows(self) -> int:
        """The number of entries in the longest column."""
        return max((len(column) for column in self.columns.values()), default=0)

    @property
    def time(self) -> FloatArray | None:
        """The time of each row, in seconds; None without a time column."""
        return self.columns.get(TIME)

    def place(self, row: int) -> str:
        """The name of a row, counted from 0, in messages: its line in the file, if there is one."""
        if self.lines:
            return f"line {self.lines[row]} of `{self.where}`"
        return f"row {row + 1} of `{self.where or self.name}`"


def read_file(name: str, path: str, content: bytes) -> DataSet:
    """The columns of a file.

    Args:
        name: their name in the spec.
        path: path of the file in the spec, with one of :data:`SUFFIXES`.
        content: the content of the file.

    Raises:
        DataError: it is not a table of numbers, or too large.
    """
    if len(content) > MOST_BYTES:
        raise DataError(
            f"`{path}` has {len(content)} bytes, and a data file may have {MOST_BYTES} at most",
            "leave out rows or columns that the spec does not need",
        )
    record = RecordedFile(DATA_ROLE, path, str(sha256(content).hexdigest()), len(content), content)
    if path.lower().endswith(".npz"):
        return DataSet(name, _of_npz(path, content), path, (), record)
    columns, lines = _of_csv(path, content)
    return DataSet(name, columns, path, lines, record)


def _of_csv(path: str, content: bytes) -> tuple[dict[str, FloatArray], list[int]]:
    import csv

    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise DataError(
            f"`{path}` is not UTF-8 text: line {line} has the byte {content[error.start]:#x}",
            "save it in the encoding UTF-8, which editors offer where they save files",
        ) from None
    kept = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.startswith("#")
    ]
    if len(kept) < 2:
        raise DataError(
            f"`{path}` contains no table: it needs a line of names and lines of numbers",
            "the first line names the columns, as in `time,height`, and each other one has a number for each",
        )
    heading = kept[0][1]
    mark = next((mark for mark in (",", ";", "\t") if mark in heading), ",")
    numbers = [number for number, _ in kept]
    try:
        names, *rows = csv.reader(
            (line for _, line in kept), delimiter=mark, skipinitialspace=True, strict=True
        )
    except csv.Error as error:
        raise DataError(f"`{path}` is not a table ({error})", _QUOTES) from None
    if len(rows) + 1 != len(kept):
        raise DataError(f"`{path}` has quotes that do not close on their line", _QUOTES)
    names = [name.strip() for name in names]
    _check_heading(path, names, numbers[0], text)
    table = np.empty((len(rows), len(names)))
    for k, row in enumerate(rows):
        if len(row) != len(names):
            cells = f"{len(row)} cell{'s' if len(row) != 1 else ''}"
            raise DataError(
                f"line {numbers[k + 1]} of `{path}` has {cells} for {len(names)} columns",
                _advice_on_cells(row, len(names), mark),
            )
        try:
            table[k] = row
        except ValueError:  # an empty cell, or a mistake
            table[k] = [_number(cell) for cell in row]
    wrong = np.argwhere(np.isinf(table) | np.isnan(table))
    for k, column in wrong:
        cell = rows[k][column].strip()
        if cell and cell.lower() != "nan":
            raise DataError(
                f"line {numbers[k + 1]} of `{path}` has `{cell}` for {names[column]}, which is not a number",
                _advice_on_words(cell, [each.strip() for each in rows[k]], first=k == 0),
            )
    return {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(names)}, numbers[1:]


_QUOTES = 'a cell may stand in quotes, `"angle, deg"`, which close on the same line'
_MARKS = "cells are separated by commas, semicolons or tabulators, the same on all lines"


def _advice_on_cells(row: Sequence[str], columns: int, mark: str) -> str:
    """Advice on a line with a different number of cells than the first one."""
    if len(row) == columns + 1 and not row[-1].strip():
        return f"take away the `{mark}` at the end of the line"
    if mark == "," and len(row) == 2 * columns and all(cell.strip().isdigit() for cell in row[1::2]):
        return "if these are decimal commas, write points, `0.5`"
    return f"{_MARKS}; a cell without a number is left empty"


def _advice_on_words(cell: str, row: Sequence[str], first: bool) -> str:
    """Advice for the message about a CSV cell that is not a number, by what the cell looks like."""
    if "," in cell and not math.isnan(_number(cell.replace(",", ".", 1).replace(",", ""))):
        return "the decimal point is a `.`, and thousands are not separated"
    parts = cell.replace("|", " ").split()
    if len(parts) > 1 and not any(math.isnan(_number(part)) for part in parts):
        return _MARKS
    if first and all(math.isnan(_number(each)) for each in row):
        return "if the line contains units, begin it with `#`, which makes it a comment"
    return "every cell is a number, in plain digits; leave a cell without a number empty"


def _check_heading(path: str, names: Sequence[str], line: int, text: str) -> None:
    if all(not math.isnan(_number(name)) for name in names):
        hint = "write a first line such as `time,height`"
        if text.startswith("#"):
            hint = (
                "lines that begin with `#` are comments: if the first one names the columns, remove the `#`"
            )
        raise DataError(f"line {line} of `{path}` holds numbers; it has to name the columns", hint)
    if not all(names):
        hint = "give it a name, or take the column away (tables of pandas: `to_csv(..., index=False)`)"
        if names[0].startswith("sep="):
            hint = f"take the line `{names[0]}` away: separators are recognised"
        raise DataError(f"column {list(names).index('') + 1} of `{path}` has no name on line {line}", hint)
    twice = next((name for k, name in enumerate(names) if name in names[:k]), None)
    if twice is not None:
        hint = "give each column a name of its own"
        raise DataError(f"`{path}` has two columns `{twice}` on line {line}", hint)


def _number(cell: str) -> float:
    """The number in a cell; NaN if it is empty."""
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _of_npz(path: str, content: bytes) -> dict[str, FloatArray]:
    import zipfile
    import zlib

    try:
        members = npz.load(content, compressed=True)
    except npz.ContentsError as error:
        raise DataError(f"`{path}` cannot be read: {error}") from None
    except (OSError, ValueError, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError):
        raise DataError(f"`{path}` is damaged: it was cut off, or is no .npz file") from None
    columns: dict[str, FloatArray] = {}
    for name, values in members.items():
        if values.ndim > 2 or not values.size:
            raise DataError(
                f"`{name}` in `{path}` has the shape {values.shape}: only lists and matrices can be read"
            )
        columns[name] = column = np.atleast_1d(values).astype(np.float64)
        if np.isinf(column).any():
            raise DataError(f"`{name}` in `{path}` is infinite somewhere")
    if not columns:
        raise DataError(f"`{path}` contains no arrays")
    return columns


def sizes(column: FloatArray) -> str:
    """The length of a column, or both sides of a matrix, in messages."""
    return " x ".join(str(length) for length in column.shape)


def files_of(data: Mapping[str, DataSet]) -> list[RecordedFile]:
    """The files that data sets were read from, each once."""
    return list({each.file.path: each.file for each in data.values() if each.file is not None}.values())
