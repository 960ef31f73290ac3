"""A recorded motion in the coordinates of a model: read from a table, and smoothed.

A table (``.csv``) or archive (``.npz``) has a column ``time`` in seconds and one for each coordinate of the model,
called as in the language (``joint.knee``, or ``knee`` alone; ``joint.root.x`` to ``joint.root.qz`` of a free joint),
with its unit behind it if one likes: ``joint.knee [deg]``.  Or it has one array ``qpos`` in MuJoCo's order.  Other
columns are not looked at.  What ``stc export --format joints`` writes is such a table.
"""

from __future__ import annotations

import csv
import math
import re
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc import npz
from stc.errors import UsageError
from stc.language.model.scope import Coordinates, coordinates_of
from stc.mechanism.mechanism import Mechanism
from stc.records import dataclass, field

__all__ = ["Recording", "read_recording"]

FloatArray = NDArray[np.float64]

#: Rows that a motion has at least.
FEWEST = 8
#: Degree of the splines that smooth, and what share of the rows the numbers of one may be.
DEGREE, MOST_FREE = 4, 0.7
#: Names of the column that says when.
_TIMES = ("time", "t")


@dataclass(slots=True)
class Recording:
    """A motion as it was recorded.

    Attributes
    ----------
    mechanism
        The model.
    time
        (k,) seconds, from 0.
    positions
        (k, nq) the numbers of the table; quaternions of length one, without sudden changes of sign.
    noise
        (nq,) the standard deviation of the noise, as far as smoothing can tell.
    """

    mechanism: Mechanism
    time: FloatArray
    positions: FloatArray
    noise: FloatArray = field(default_factory=lambda: np.zeros(0))
    _curves: list[Any] = field(default_factory=list)

    def __post_init__(self) -> None:
        fitted = [_smoothed(self.time, column) for column in self.positions.T]
        self._curves = [curve for curve, _ in fitted]
        self.noise = np.array([noise for _, noise in fitted])

    def unsure_speeds(self) -> FloatArray:
        """(2, nv) the standard deviations that noise gives the velocities at both ends."""
        from scipy.interpolate import BSpline

        rates = np.zeros((2, len(self._curves)))
        for k, curve in enumerate(self._curves):
            matrix = BSpline.design_matrix(self.time, curve.t, DEGREE).toarray()
            units = np.eye(matrix.shape[1])
            slopes = BSpline(curve.t, units, DEGREE)(self.time[[0, -1]], nu=1)
            spread = np.linalg.solve(matrix.T @ matrix, slopes.T)
            rates[:, k] = self.noise[k] * np.sqrt(np.einsum("ek,ke->e", slopes, spread))
        columns = []
        for one in self.coordinates:
            first = one.joint.qpos
            columns += [rates[:, first + k] for k in range(len(one.positions))]
            if one.rotation is not None:
                place = first + len(one.positions)
                columns += 3 * [2.0 * rates[:, place : place + 4].max(axis=1)]
        return np.stack(columns, axis=1)

    @property
    def duration(self) -> float:
        """Seconds from the first to the last row."""
        return float(self.time[-1])

    @property
    def coordinates(self) -> list[Coordinates]:
        """The names of the variables of each joint."""
        return [coordinates_of(joint) for joint in self.mechanism.joints]

    @property
    def names(self) -> list[str]:
        """The coordinates as the language calls them, in MuJoCo's order, (nq,)."""
        return [name for one in self.coordinates for name in one.pose]

    def at(self, times: FloatArray, order: int = 0) -> FloatArray:
        """(k, nq) the smoothed motion at some times, or a derivative of it."""
        found = np.stack([curve(times, nu=order) for curve in self._curves], axis=1)
        if not order:
            for place in _quaternions(self.mechanism):
                found[:, place] /= np.linalg.norm(found[:, place], axis=1, keepdims=True)
        return found

    def velocities(self, times: FloatArray) -> FloatArray:
        """(k, nv) of the smoothed motion, as MuJoCo counts them: angular velocities in the body's frame."""
        places, rates, columns = self.at(times), self.at(times, 1), []
        for one in self.coordinates:
            first = one.joint.qpos
            columns += [rates[:, first + k] for k in range(len(one.positions))]
            if one.rotation is not None:
                at = first + len(one.positions)
                w, x, y, z = places[:, at : at + 4].T
                a, b, c, d = rates[:, at : at + 4].T
                # Twice the vector part of the conjugate times the rate.
                columns += [
                    2.0 * (w * b - x * a - y * d + z * c),
                    2.0 * (w * c + x * d - y * a - z * b),
                    2.0 * (w * d - x * c + y * b - z * a),
                ]
        return np.stack(columns, axis=1)


def read_recording(path: Path, mechanism: Mechanism) -> Recording:
    """Read a table or archive.

    Raises
    ------
    UsageError
        It cannot be read, columns of coordinates are missing, times do not increase, or rows are too few.
    """
    columns = _columns(path)
    time = next((columns[name][1] for name in _TIMES if name in columns), None)
    if time is None:
        raise UsageError(f"{path} has no column `time`", "in seconds, for each row when it was recorded")
    names = [name for joint in mechanism.joints for name in coordinates_of(joint).pose]
    if "qpos" in columns:
        positions = np.atleast_2d(columns["qpos"][1])
        if positions.shape != (len(time), len(names)):
            raise UsageError(f"{path}: `qpos` has the shape {positions.shape}, not {(len(time), len(names))}")
    else:
        found = {name: _found(columns, name) for name in names}
        missing = [name for name, column in found.items() if column is None]
        if missing:
            told = ", ".join(f"`{name}`" for name in missing[:4]) + (" and more" if len(missing) > 4 else "")
            raise UsageError(
                f"{path} has no column for {told}",
                "each coordinate of the model has one, called as `stc show MODEL` calls it",
            )
        if any(len(column) != len(time) for column in found.values() if column is not None):
            raise UsageError(f"{path}: its columns are not equally long")
        positions = np.stack([column for column in found.values() if column is not None], axis=1)
    known = np.isfinite(time) & np.isfinite(positions).all(axis=1)  # rows with gaps are left out
    time, positions = time[known], positions[known]
    if len(time) < FEWEST:
        raise UsageError(f"{path} has {len(time)} rows with all coordinates: a motion has {FEWEST} at least")
    if not np.all(np.diff(time) > 0):
        raise UsageError(f"{path}: the times of its rows do not increase")
    for place in _quaternions(mechanism):
        positions[:, place] = _continuous(path, positions[:, place])
    return Recording(mechanism, time - time[0], positions)


def _smoothed(time: FloatArray, column: FloatArray) -> tuple[Any, float]:
    """A spline through a column, and the standard deviation of the noise about it.

    A least-squares spline of degree 4 whose ends are free: natural ends would take the acceleration away with which
    motions begin.  Generalised cross-validation (Golub, Heath & Wahba 1979) chooses how many pieces it has.
    """
    from scipy.interpolate import make_lsq_spline

    count, best = len(time), (np.inf, None, 0.0)
    pieces = 1
    while pieces + DEGREE <= MOST_FREE * count:
        inner = np.quantile(time, np.linspace(0.0, 1.0, pieces + 1)[1:-1])
        knots = np.concatenate([np.full(DEGREE + 1, time[0]), inner, np.full(DEGREE + 1, time[-1])])
        curve = make_lsq_spline(time, column, knots, k=DEGREE)
        squares, free = float(np.sum((curve(time) - column) ** 2)), pieces + DEGREE
        score = count * squares / (count - free) ** 2
        if score < best[0]:
            best = score, curve, math.sqrt(squares / (count - free))
        pieces = max(pieces + 1, round(1.15 * pieces))
    return best[1], best[2]


def _found(columns: dict[str, tuple[str, FloatArray]], name: str) -> FloatArray | None:
    """The column of a coordinate, in rad or m."""
    for called in (name, name.removeprefix("joint."), name.replace('"', "")):
        if called in columns:
            unit, values = columns[called]
            return np.radians(values) if unit in ("deg", "degree", "degrees") else values
    return None


def _columns(path: Path) -> dict[str, tuple[str, FloatArray]]:
    """The unit (empty if none is given) and the numbers of each column, by its name.

    Raises
    ------
    UsageError
        The file cannot be read.
    """
    if not path.is_file():
        raise UsageError(f"there is no file `{path}`")
    if path.suffix.lower() == ".npz":
        try:
            arrays = npz.load(path, compressed=True)
            return {name: ("", np.asarray(values, dtype=float)) for name, values in arrays.items()}
        except npz.ContentsError as error:
            raise UsageError(f"{path} cannot be read as an archive of numbers: {error}") from None
        except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error):
            why = "it was cut off, or is no .npz file" if path.stat().st_size else "it is empty"
            raise UsageError(f"{path} cannot be read as an archive of numbers: {why}") from None
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            lines = [line for line in stream if line.strip() and not line.startswith("#")]
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{path} cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if not lines:
        raise UsageError(f"{path} is empty")
    try:
        header, *rows = csv.reader(lines, delimiter=max(",;\t", key=lines[0].count))
    except csv.Error as error:
        raise UsageError(f"{path} is not a table: {error}") from None
    found: dict[str, tuple[str, FloatArray]] = {}
    for k, title in enumerate(header):
        match = re.fullmatch(r"\s*(.*?)\s*(?:\[(.*)\])?\s*", title)
        name, unit = (match[1], match[2] or "") if match else (title, "")
        found[name] = unit, np.array([_number(row[k] if k < len(row) else "") for row in rows])
    return found


def _number(cell: str) -> float:
    """A cell's number; none where it is empty or says something else."""
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _quaternions(mechanism: Mechanism) -> list[slice]:
    """The ranges of indices of the quaternions in ``qpos``."""
    found = []
    for joint in mechanism.joints:
        if joint.kind in ("free", "ball"):
            first = joint.qpos + (3 if joint.kind == "free" else 0)
            found.append(slice(first, first + 4))
    return found


def _continuous(path: Path, quaternions: FloatArray) -> FloatArray:
    """(k, 4) the quaternions with length one, each with the sign that is nearer to the one before."""
    lengths = np.linalg.norm(quaternions, axis=1, keepdims=True)
    if np.any(np.abs(lengths - 1.0) > 0.1):
        raise UsageError(f"{path}: its quaternions are not of length one")
    found = quaternions / lengths
    for k in range(1, len(found)):
        if found[k] @ found[k - 1] < 0.0:
            found[k] *= -1.0
    return found
