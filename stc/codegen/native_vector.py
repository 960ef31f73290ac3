"""Vectors of eight floats in compiled functions: what inner loops keep in registers.

    total = splat8(0.0)
    for t in range(n):
        total += factors[t] * load8(rows, 8 * t)
    store8(sums, 0, total)

Vectors are added, subtracted and multiplied with each other and with numbers.  In plain Python they are arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["abs8", "largest8", "load8", "max8", "splat8", "store8", "sum8"]

#: A local vector: it is never an argument, nor a result.
Vector = Any


def load8(x: NDArray[np.float64], k: int) -> Vector:
    """``x[k]`` to ``x[k + 7]``."""
    return x[k : k + 8].copy()


def store8(x: NDArray[np.float64], k: int, vector: Vector) -> None:
    """Write a vector to ``x[k]`` to ``x[k + 7]``."""
    x[k : k + 8] = vector


def splat8(value: float) -> Vector:
    """Eight times the same number."""
    return np.full(8, value)


def abs8(vector: Vector) -> Vector:
    """Magnitudes."""
    return np.abs(vector)


def max8(one: Vector, other: Vector) -> Vector:
    """The larger one of each pair; of a nan and a number either."""
    return np.fmax(one, other)


def largest8(vector: Vector) -> float:
    """Largest of the eight; nans may be passed over."""
    return float(np.fmax.reduce(vector))


def sum8(vector: Vector) -> float:
    """Sum of the eight, in any order."""
    return float(vector.sum())
