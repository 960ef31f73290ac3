"""The filter: pairs of violation and barrier function that later points must not be dominated by.

R. Fletcher and S. Leyffer, Nonlinear programming without a penalty function, Math. Program. 91 (2002).
"""

from __future__ import annotations

import numpy as np

from stc.core.functions import function

__all__ = ["Filter", "accepts", "add"]

GAMMA_THETA = 1e-5
GAMMA_PHI = 1e-8
#: In an array that holds a filter: the number of pairs, the largest violation accepted, then the pairs.
COUNT, LARGEST, FIRST = 0, 1, 2
#: Pairs that there is room for; the oldest gives way to one more.
ROOM = 1000

#: 1 when no pair dominates the point.
accepts = function("line_search_accepts")
#: Forbid points no better than (theta, phi) by a margin.
add = function("line_search_add")


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
