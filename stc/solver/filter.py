"""The filter: pairs of violation and barrier function that later points must not be dominated by.

R. Fletcher and S. Leyffer, Nonlinear programming without a penalty function, Math. Program. 91 (2002).
"""

from __future__ import annotations

import numpy as np

from stc.codegen.native import f64, f64s, i64, native

__all__ = ["Filter", "accepts", "add"]

GAMMA_THETA = 1e-5
GAMMA_PHI = 1e-8
#: In an array that holds a filter: the number of pairs, the largest violation accepted, then the pairs.
COUNT, LARGEST, FIRST = 0, 1, 2
#: Pairs that there is room for; the oldest gives way to one more.
ROOM = 1000


@native
def accepts(filter: f64s, theta: f64, phi: f64) -> i64:
    """1 when no pair dominates the point."""
    if not (theta <= filter[LARGEST]):
        return 0
    pairs = filter[FIRST:]
    for k in range(int(filter[COUNT])):
        if not (theta <= pairs[2 * k] or phi <= pairs[2 * k + 1]):
            return 0
    return 1


@native
def add(filter: f64s, theta: f64, phi: f64) -> None:
    """Forbid points no better than (theta, phi) by a margin."""
    pairs = filter[FIRST:]
    phi = phi - GAMMA_PHI * theta
    theta = (1.0 - GAMMA_THETA) * theta
    count = int(filter[COUNT])
    kept = 0
    for k in range(1 if count == ROOM else 0, count):
        if pairs[2 * k] < theta or pairs[2 * k + 1] < phi:
            pairs[2 * kept] = pairs[2 * k]
            pairs[2 * kept + 1] = pairs[2 * k + 1]
            kept += 1
    pairs[2 * kept] = theta
    pairs[2 * kept + 1] = phi
    filter[COUNT] = float(kept + 1)


class Filter:
    """A filter in an array of its own.

    Attributes:
        array: as the functions above take it.
    """

    def __init__(self, largest_theta: float) -> None:
        self.array = np.empty(FIRST + 2 * ROOM)
        self.restart(largest_theta)

    def restart(self, largest_theta: float) -> None:
        """Empty it, with another limit."""
        self.array[COUNT], self.array[LARGEST] = 0.0, largest_theta

    def reset(self) -> None:
        """Forget every pair, as when the barrier parameter changes."""
        self.array[COUNT] = 0.0

    def add(self, theta: float, phi: float) -> None:
        """Forbid points no better than (theta, phi) by a margin."""
        add(self.array, theta, phi)

    def accepts(self, theta: float, phi: float) -> bool:
        """True when no pair dominates the point."""
        return accepts(self.array, theta, phi) != 0
