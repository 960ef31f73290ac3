"""A motion as a table of numbers: one row per instant, a column for the time and for every quantity."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from stc.atomic import replacing
from stc.solution import Solution
from stc.validate.export.proportion import intervals, require_proportion
from stc.validate.metrics import FloatArray


def columns(solution: Solution, rate: float | None = None) -> dict[str, FloatArray]:
    """The time, every variable, every derivative that the spec uses, and the forces on the model.

    Args:
        solution: the motion.
        rate: instants per second, the last one being the end of the motion; None takes the frames, and where
            quantities jump the value after the jump.

    Returns:
        Arrays of one length by name; derivatives have primes, parameters are constant columns.

    Raises:
        UsageError: with this rate the table is out of proportion.
    """
    if rate is None or solution.n == 0:
        times = solution.time
        values = {name: np.asarray(solution[name]) for name in solution.names}
    else:
        require_proportion(solution.duration * rate, 1 + len(solution.names), f"a rate of {rate:g} Hz")
        count = max(1, intervals(solution.duration, rate))
        times = np.minimum(solution.time[0] + np.arange(count + 1) / rate, solution.time[-1])
        found = solution.at(times)
        values = {name: np.asarray(found[name]) for name in solution.names}
    return {"time": times, **{name: np.broadcast_to(value, times.shape) for name, value in values.items()}}


def write(solution: Solution, path: Path, rate: float | None = None) -> None:
    """Write the table as ``.csv`` (a header, then rows, every digit kept) or ``.npz`` (one array per column).

    Raises:
        UsageError: with this rate the table is out of proportion.
        OSError: the file cannot be written.
    """
    found = columns(solution, rate)
    if path.suffix.lower() == ".npz":
        with replacing(path) as temporary, temporary.open("wb") as stream:
            np.savez(stream, **found)  # type: ignore[arg-type]
        return
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(found)
        writer.writerows([repr(float(value)) for value in row] for row in zip(*found.values()))
