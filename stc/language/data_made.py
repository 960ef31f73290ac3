"""The sources of data: files beside a spec, keyframes of a model, grids, and intervals of recorded motions."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from stc.arrays import stretches_of
from stc.data_sets import MOST_BYTES, SUFFIXES, TIME, DataError, DataSet
from stc.language.diagnostics import did_you_mean
from stc.symbolic.tables import Axis, Table, interpolated

if TYPE_CHECKING:
    from stc.language.model.scope import ModelScope

FloatArray = NDArray[np.float64]

#: Cells of a table of two arguments: sixteen numbers are kept for each.
MOST_CELLS = 1_000_000

#: The least distance of two places of a table, as a share of its length; and the greatest length, or its reciprocal.
NEAR, LENGTH = 1e-12, 1e100
NEAR_HINT = f"points must differ by more than a share of {NEAR:g} of all of the table from each other"

_PART = re.compile(r'"([^"]*)"|([^.]+)')


def split_path(path: str) -> tuple[str, str]:
    """The first word of a path, and the rest as the name of a column, without quotes."""
    parts = [quoted or plain for quoted, plain in _PART.findall(path)]
    return parts[0], ".".join(parts[1:])


def plain_path(path: str) -> str:
    """A path as the name of a column, without quotes."""
    return ".".join(part for part in split_path(path) if part)


def found_beside(path: str, spec: str | None, carried: Mapping[str, bytes] | None) -> bytes:
    """The content of a file: from the solution of the spec, else from the folder of the spec.

    Raises:
        DataError: there is no such file, or it cannot be read.
    """
    if not path.lower().endswith(SUFFIXES):
        hint = "write its columns into a .csv file, with their names in the first line"
        raise DataError(f"data is read from a .csv, .tsv or .npz file, not from `{path}`", hint)
    if carried is not None:
        if path not in carried:
            raise DataError(f"the solution file does not contain `{path}`")
        return carried[path]
    folder = Path(spec).parent if spec else Path()
    try:
        file = folder / path
        if not file.is_file():
            known = [each.name for suffix in SUFFIXES for each in sorted(folder.glob(f"*{suffix}"))]
            hint = did_you_mean(path, known) or "it is looked for beside the spec"
            raise DataError(f"there is no file `{path}`", hint)
        with file.open("rb") as stream:
            return stream.read(MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        raise DataError(f"`{path}` cannot be read: {getattr(error, 'strerror', None) or error}") from None


def too_near(places: FloatArray) -> int | None:
    """The first of two increasing points that are too close to each other; None if there are none."""
    length = float(places[-1] - places[0])
    near = int(np.argmin(np.diff(places)))
    apart = places[near + 1] - places[near] > NEAR * length
    return None if apart and 1.0 / LENGTH < length < LENGTH else near


def keyframes(name: str, model: ModelScope) -> DataSet:
    """The keyframes of a model as columns: the time, and one for each variable with a value.

    Raises:
        DataError: there are fewer than two, or their times do not rise.
    """
    known = model.mechanism.keyframes
    times = np.array([key.time for key in known])
    if len(known) < 2 or not (np.diff(times) > 0.0).all():
        shown = ", ".join(f"{time:g}" for time in times)
        raise DataError(
            f"the keyframes of the model make no motion: their times are {shown or 'none'}",
            'give each its `time` in the file of the model, rising, as in `<key name="stand" time="0" .../>`',
        )
    columns: dict[str, FloatArray] = {TIME: times}
    poses = [each for joint in model.coordinates for each in joint.pose]
    rates = [each for joint in model.coordinates for each in joint.rates]
    for k, variable in enumerate(poses):
        columns[plain_path(variable)] = np.array([key.qpos[k] for key in known])
    for k, rate in enumerate(rates):
        if not rate.order:
            columns[plain_path(rate.name)] = np.array([key.qvel[k] for key in known])
    for k, control in enumerate(model.controls):
        columns[plain_path(control)] = np.array([key.controls[k] for key in known])
    return DataSet(name, columns, model.path.name)


def grid(
    data: DataSet, names: Sequence[str], x: FloatArray, y: FloatArray, values: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The axes and the matrix of a grid in long form: a row for each point, in any order.

    Raises:
        DataError: a point is missing, or occurs twice.
    """
    rows, row = np.unique(x, return_inverse=True)
    columns, column = np.unique(y, return_inverse=True)
    hint = "each value of the first argument stands once with each of the second"
    if len(rows) < 2 or len(columns) < 2:
        what = names[0] if len(rows) < 2 else names[1]
        raise DataError(
            f"`{what}` has one value alone", "a table of two arguments has two values of each at least"
        )
    for what, places in zip(names, (rows, columns), strict=False):
        if too_near(places) is not None:
            raise DataError(f"`{what}` has values that differ too little", NEAR_HINT)
    if len(rows) * len(columns) > 4 * MOST_CELLS:
        raise DataError(f"`{names[0]}` and `{names[1]}` make no grid of {len(x)} places", hint)
    cell = row * len(columns) + column
    order = np.argsort(cell, kind="stable")
    twice = np.flatnonzero(np.diff(cell[order]) == 0)
    if len(twice):
        one, other = sorted(int(order[twice[0] + k]) for k in (0, 1))
        place = f"{data.place(other)} has the same place as {data.place(one)}"
        raise DataError(f"{place}: {names[0]} = {x[one]:.9g}, {names[1]} = {y[one]:.9g}", hint)
    if len(cell) < len(rows) * len(columns):
        there = np.zeros(len(rows) * len(columns), bool)
        there[cell] = True
        i, j = divmod(int(np.argmin(there)), len(columns))
        missing = f"{names[0]} = {rows[i]:.9g}, {names[1]} = {columns[j]:.9g}"
        raise DataError(f"there is no value of `{names[2]}` for {missing}", hint)
    return rows, columns, values[order].reshape(len(rows), len(columns))


def checked(table: Table) -> Table:
    """The same table, after a check of its numbers.

    Raises:
        DataError: its points are too close to each other, or its values too large.
    """
    inner = table.coefficients[tuple(slice(1, -1) for _ in table.axes)]
    if not np.isfinite(inner).all():
        raise DataError("the numbers of this table are too large, or too near to each other")
    return table


def stretches(there: NDArray[np.bool_], least: int = 2) -> list[tuple[int, int]]:
    """The first and the last index of every run of ``least`` or more numbers."""
    return [(first, past - 1) for first, past in stretches_of(there) if past - first >= least]


def bridged(time: FloatArray, values: FloatArray, runs: Sequence[tuple[int, int]]) -> Table:
    """A spline on each run of numbers (or a single number), straight lines between, and the last value outside."""
    places = np.concatenate([time[a : b + 1] for a, b in runs])
    rows: list[FloatArray] = [np.array([[values[runs[0][0]], 0.0, 0.0, 0.0]])]
    for k, (a, b) in enumerate(runs):
        if a < b:
            spline = interpolated([time[a : b + 1]], values[a : b + 1], "cubic", "hold")
            rows.append(spline.coefficients[1:-1])
        if k + 1 < len(runs):
            after = runs[k + 1][0]
            slope = (values[after] - values[b]) / (time[after] - time[b])
            rows.append(np.array([[values[b], slope, 0.0, 0.0]]))
    rows.append(np.array([[values[runs[-1][1]], 0.0, 0.0, 0.0]]))
    return Table([Axis(places)], np.concatenate(rows), 3, "cubic", "hold")


def presence(time: FloatArray, runs: Sequence[tuple[int, int]], slack: float) -> Table:
    """1 on every run of two numbers or more, including its ends, and 0 elsewhere."""
    found = [(time[a] - slack, np.nextafter(time[b] + slack, np.inf)) for a, b in runs if a < b]
    edges = [edge for ends in found for edge in ends] or [time[runs[0][0]], time[runs[-1][1]]]
    coefficients = np.zeros((len(edges) + 1, 4))
    coefficients[1::2, 0] = float(bool(found))
    return Table([Axis(np.array(edges))], coefficients, 0, "steps", "hold")
