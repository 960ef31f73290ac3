"""Products with long vectors and sparse matrices in coordinate form, on one thread.

BLAS is not asked for dot products: it wakes its threads for vectors of ten thousand entries, which takes longer than
the product and keeps the other core from those who need it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.core.functions import function
from stc.solver.nlp import Floats, Ints, Mask

Indices = NDArray[np.int64]

__all__ = [
    "EPSILON", "NOTHING", "ROUGHLY", "ROUNDED", "between", "inner", "multiplier_scale", "norm", "symmetric_times",
    "term_sums", "times",
]  # fmt: skip

EPSILON = 2.0**-52
ROUNDED = 16.0 * EPSILON
"""What rounding may change a sum by, relative to the sizes of its terms."""
ROUGHLY = 1e-12
"""The same after many operations, with a margin."""
NOTHING = 1e-8
"""What counts as nothing beside 1: shifts of rows and of curvature (Waechter and Biegler 2006, 3.1). One over its
square holds variables and leaves rows out: no curvature that counts comes from that."""


def between(x: Floats, lower: Floats, upper: Floats) -> Floats:
    """``x`` moved onto the bounds that it oversteps; ``np.clip`` takes longer than that for short vectors."""
    return np.minimum(np.maximum(x, lower), upper)


def at_bounds(value: Floats, lower: Floats, upper: Floats, slack: float) -> tuple[Mask, Mask]:
    """Which values are at their lower and at their upper bounds, those of equal bounds at both.

    Args:
        slack: the distance that counts as none, relative to ``max(1, |bound|)``.
    """
    equal = lower == upper
    with np.errstate(invalid="ignore"):
        low = value - lower <= slack * np.maximum(1.0, np.abs(lower))
        high = upper - value <= slack * np.maximum(1.0, np.abs(upper))
    return np.isfinite(lower) & (equal | low), np.isfinite(upper) & (equal | high)


def inner(a: Floats, b: Floats) -> float:
    """``a.b``."""
    return float(np.einsum("i,i", a, b))


def norm(a: Floats) -> float:
    """Euclidean length."""
    return float(np.sqrt(np.einsum("i,i", a, a)))


def times(rows: Indices, cols: Indices, values: Floats, v: Floats, size: int) -> Floats:
    """Matrix times vector, (size,); the entries are ``values`` (k,) at ``rows``, ``cols`` (k,)."""
    return np.asarray(np.bincount(rows, weights=values * v[cols], minlength=size), dtype=float)


def term_sums(rows: Ints, cols: Ints, values: Floats, v: Floats, size: int) -> Floats:
    """The sums of the magnitudes of the terms of such a product, (size,), to which rounding errors are proportional."""
    return np.asarray(np.bincount(rows, weights=np.abs(values * v[cols]), minlength=size), dtype=float)


def symmetric_times(rows: Indices, cols: Indices, values: Floats, v: Floats, size: int) -> Floats:
    """Symmetric matrix times vector, (size,); the lower triangle is given, as for :func:`times`."""
    across = np.where(rows == cols, 0.0, values)
    return times(rows, cols, values, v, size) + times(cols, rows, across, v, size)


#: What dual errors are divided by where multipliers are large, given the sum of their magnitudes.
multiplier_scale = function("point_multiplier_scale")
