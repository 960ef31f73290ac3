"""Small functions for arrays; some replace NumPy functions whose import is slow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def distinct(values: NDArray) -> NDArray:
    """The different values of an array in ascending order, as ``numpy.unique``, which imports masked arrays."""
    ordered = np.sort(values, axis=None)
    first = np.ones(ordered.size, dtype=bool)
    np.not_equal(ordered[1:], ordered[:-1], out=first[1:])
    return ordered[first]


def ranks(values: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """The rank of each entry among the distinct values in ascending order, and the number of these values.

    This is the inverse of ``numpy.unique``, without sorting if the values are close together.
    """
    if values.size == 0:
        return np.zeros(0, dtype=np.int64), 0
    least = int(values.min())
    span = int(values.max()) - least + 1
    if span > 4 * values.size:
        different, inverse = np.unique(values, return_inverse=True)
        return inverse, different.size
    offset = values - least
    present = np.zeros(span, dtype=bool)
    present[offset] = True
    rank = np.cumsum(present) - 1
    return rank[offset], int(rank[-1]) + 1


def stretches_of(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """The intervals of a mask (n,) on which it is True, in order: the first index of each and one past its last."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def scattered(count: int) -> NDArray[np.float64]:
    """Numbers (count,) between -1 and 1 that look random.

    They replace ``numpy.random``, which takes 5 ms to import.
    """
    return np.modf(1e4 * np.sin(np.arange(1, count + 1)))[0]


def aligned_zeros(shape: int | tuple[int, ...]) -> NDArray[np.float64]:
    """Zeros that start on a cache line, so that vector stores never straddle two lines."""
    count = int(np.prod(shape))
    raw = np.zeros(count + 8)
    skip = (-raw.ctypes.data % 64) // 8
    return raw[skip : skip + count].reshape(shape)
