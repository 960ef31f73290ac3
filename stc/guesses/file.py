"""Read starting values from a file: a table of numbers or a saved solution.

``.csv``
    A heading line with names, then numbers.  A column ``t`` or ``time`` (seconds) or ``frame`` says where each row
    stands; without any the rows are spread evenly over the motion.  All other columns are variables, derivatives
    (``x'``) or parameters (the first number counts).  Empty cells and ``nan`` are gaps, which are interpolated.
    Two rows with the same ``t`` state a jump.  Before the first row and after the last one values stay the same.
``.npz``
    NumPy arrays under the same names; a single number is a parameter.
Either may also be a saved solution, whose frames then keep their share of the motion.
"""

from __future__ import annotations

import csv
import os
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from stc import npz
from stc.errors import UsageError
from stc.guesses.values import GivenValues, SolutionValues, table
from stc.solution import Solution, read
from stc.solution_file import contents

FloatArray = NDArray[np.float64]


def guess_of(given: Mapping[str, ArrayLike] | GivenValues | Solution | str | os.PathLike[str]) -> GivenValues:
    """Starting values from a file, from numbers by name (with a column ``t`` or ``frame``), or from a solution.

    Raises:
        UsageError: as :func:`read_guess`; or the argument is none of these.
    """
    if isinstance(given, str | os.PathLike):
        return read_guess(given)
    if isinstance(given, Solution):
        return SolutionValues(given)
    if isinstance(given, Mapping):
        return table(given)
    if not callable(getattr(given, "values", None)):
        raise UsageError(f"a guess is numbers by name, a solution, or the file of either, not {given!r}")
    return given


def read_guess(path: str | os.PathLike[str]) -> GivenValues:
    """Read starting values from a ``.csv`` or ``.npz`` file.

    Raises:
        UsageError: no such file, another kind of file, or a file that is not a table of numbers.
        SolutionError: a damaged solution.
    """
    source = Path(path)
    suffix = source.suffix.lower()
    if suffix not in (".csv", ".npz"):
        raise UsageError(f"a guess is read from a .csv or .npz file, not from `{source.name}`")
    if not source.is_file():
        raise UsageError(f"there is no file `{source}` to read a guess from")
    try:
        return _read_csv(source) if suffix == ".csv" else _read_npz(source)
    except UnicodeDecodeError:
        raise UsageError(f"no guess can be read from `{source}`: it is not UTF-8 text") from None
    except PermissionError:
        raise UsageError(f"no guess can be read from `{source}`: it may not be read") from None
    except csv.Error as error:
        raise UsageError(f"no guess can be read from `{source}`: it is not a table ({error})") from None
    except npz.ContentsError as error:
        raise UsageError(f"no guess can be read from `{source}`: {error}") from None
    except (OSError, ValueError, zipfile.BadZipFile, zlib.error, EOFError):
        what = "it was cut off, or is no .npz file" if source.stat().st_size else "it is empty"
        raise UsageError(f"no guess can be read from `{source}`: {what}") from None


def _read_npz(source: Path) -> GivenValues:
    if not zipfile.is_zipfile(source):  # NumPy would read a single array, or take it for pickled objects
        raise zipfile.BadZipFile
    if contents(source) == "solution":
        return SolutionValues(read(source))
    columns: dict[str, FloatArray] = {}
    for name, values in npz.load(source, compressed=True).items():
        if values.ndim > 1:
            raise UsageError(f"`{name}` in `{source}` is not a list of numbers (shape {values.shape})")
        columns[name] = np.atleast_1d(values).astype(float)
    return table(columns, f"`{source}`")


def _read_csv(source: Path) -> GivenValues:
    text = source.read_text(encoding="utf-8-sig")
    if text.startswith("# facts"):
        return SolutionValues(read(source))
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if len(lines) < 2:
        raise UsageError(f"`{source}` contains no table: it needs a line of names and lines of numbers")
    mark = next((mark for mark in (",", ";", "\t") if mark in lines[0]), ",")
    heading, *rows = csv.reader(lines, delimiter=mark)
    names = [name.strip() for name in heading]
    if all(_is_number(name) for name in names):
        raise UsageError(f"the first line of `{source}` holds numbers; it has to name the columns")
    if len(set(names)) < len(names) or not all(names):
        raise UsageError(f"the heading of `{source}` has an empty name, or one name twice")
    table_rows = []
    for number, row in enumerate(rows, start=2):
        if len(row) != len(names):
            raise UsageError(f"row {number} of `{source}` has {len(row)} entries for {len(names)} names")
        table_rows.append(
            [_number(cell, name, number, source) for cell, name in zip(row, names, strict=True)]
        )
    numbers = np.array(table_rows)
    return table({name: numbers[:, k] for k, name in enumerate(names)}, f"`{source}`")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _number(cell: str, name: str, row: int, source: Path) -> float:
    if not cell.strip():
        return float("nan")
    try:
        return float(cell)
    except ValueError:
        raise UsageError(
            f"row {row} of `{source}` has `{cell.strip()}` for {name}, which is not a number"
        ) from None
