"""Vectors of eight floats in compiled functions: what inner loops keep in registers.

    total = splat8(0.0)
    for t in range(n):
        total += factors[t] * load8(rows, 8 * t)
    store8(sums, 0, total)

Vectors are added, subtracted, multiplied and divided, by each other and by numbers.  In plain Python they are arrays.

Where registers hold only four, a vector of eight takes two of them, so that inner loops run out of registers early.
These take ``wide()`` numbers at a time instead, with functions whose names end in w, and go over the rest in turn:

    part = 0
    while part < 8:
        total = splatw(0.0)
        for t in range(n):
            total += factors[t] * loadw(rows, 8 * t + part)
        storew(sums, part, total)
        part += wide()
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "abs8",
    "absw",
    "gather8",
    "largest8",
    "load8",
    "loadw",
    "masked8",
    "max8",
    "maxw",
    "negative8",
    "negativew",
    "prefetch8",
    "scatter8",
    "splat8",
    "splatw",
    "spread8",
    "store8",
    "storew",
    "stream8",
    "sum8",
    "sums8",
    "wide",
]

#: A local vector: it is never an argument, nor a result.
Vector = Any
#: ``wide()`` in plain Python.
_WIDE = 8


def load8(x: NDArray[np.float64], k: int) -> Vector:
    """``x[k]`` to ``x[k + 7]``."""
    return x[k : k + 8].copy()


def store8(x: NDArray[np.float64], k: int, vector: Vector) -> None:
    """Write a vector to ``x[k]`` to ``x[k + 7]``."""
    x[k : k + 8] = vector


def stream8(x: NDArray[np.float64], k: int, vector: Vector) -> None:
    """``store8`` that goes past the caches, for what is read much later: memory need not be read to be written.

    ``x[k]`` must begin a line of 64 bytes (see ``stc.arrays.aligned_zeros``).
    """
    x[k : k + 8] = vector


def prefetch8(x: NDArray[np.float64], k: int) -> None:
    """Ask for the memory of ``x[k]`` to be near soon; it need not exist."""


def masked8(x: NDArray[np.float64], k: int, mask: int) -> Vector:
    """``x[k]`` to ``x[k + 7]`` where bits of ``mask``, the lowest first, are 1; 0 elsewhere, where nothing is read."""
    vector = np.zeros(8)
    for lane in range(8):
        if mask >> lane & 1:
            vector[lane] = x[k + lane]
    return vector


def gather8(x: NDArray[np.float64], places: NDArray[np.int32], k: int) -> Vector:
    """The elements of ``x`` at ``places[k]`` to ``places[k + 7]``."""
    return x[places[k : k + 8]]


def spread8(
    x: NDArray[np.float64],
    places: NDArray[np.int32],
    k: int,
    out: NDArray[np.float64],
    first: int,
    second: int,
    third: int,
    fourth: int,
) -> None:
    """``gather8`` of the places, and of those one, two and three behind: four vectors that follow one another in ``x``.

    They are written to ``out[first]`` and what follows, to ``out[second]``, ...
    """
    for ahead, at in enumerate((first, second, third, fourth)):
        out[at : at + 8] = x[places[k : k + 8] + ahead]


def scatter8(x: NDArray[np.float64], places: NDArray[np.int32], k: int, vector: Vector) -> None:
    """Write a vector to the elements of ``x`` at ``places[k]`` to ``places[k + 7]``; the last one stays of equals."""
    x[places[k : k + 8]] = vector


def negative8(vector: Vector) -> Vector:
    """1 where a number is negative, 0 elsewhere."""
    return (vector < 0.0).astype(np.float64)


def splat8(value: float) -> Vector:
    """Eight times the same number."""
    return np.full(8, value)


def abs8(vector: Vector) -> Vector:
    """Magnitudes."""
    return np.abs(vector)


def max8(one: Vector, other: Vector) -> Vector:
    """The larger one of each pair; where the first is nan the other one, where the second is nan either."""
    return np.fmax(one, other)


def largest8(vector: Vector) -> float:
    """Largest of the eight; nans may be passed over."""
    return float(np.fmax.reduce(vector))


def sum8(vector: Vector) -> float:
    """Sum of the eight, in any order."""
    return float(vector.sum())


def wide() -> int:
    """How many floats a register holds of the machine that code is made for: four or eight."""
    return _WIDE


def loadw(x: NDArray[np.float64], k: int) -> Vector:
    """``x[k]`` and what follows, ``wide()`` numbers; the others that end in w do as those that end in 8."""
    return x[k : k + _WIDE].copy()


def storew(x: NDArray[np.float64], k: int, vector: Vector) -> None:
    """See ``store8``."""
    x[k : k + _WIDE] = vector


def splatw(value: float) -> Vector:
    """See ``splat8``."""
    return np.full(_WIDE, value)


def absw(vector: Vector) -> Vector:
    """See ``abs8``."""
    return np.abs(vector)


def maxw(one: Vector, other: Vector) -> Vector:
    """See ``max8``."""
    return np.fmax(one, other)


def negativew(vector: Vector) -> Vector:
    """See ``negative8``."""
    return (vector < 0.0).astype(np.float64)


def sums8(x: NDArray[np.float64], k: int) -> Vector:
    """The sums of eight vectors that follow one another from ``x[k]`` on, in any order of their terms."""
    return x[k : k + 64].reshape(8, 8).sum(axis=1)
