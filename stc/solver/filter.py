"""The filter: pairs of violation and barrier function that later points must not be dominated by.

R. Fletcher and S. Leyffer, Nonlinear programming without a penalty function, Math. Program. 91 (2002).
"""

from __future__ import annotations

import numpy as np

from stc.core.functions import function
from stc.core.structures import structure

__all__ = ["Filter"]

#: Pairs that there is room for; the oldest gives way to one more.
ROOM = 1000


class Filter:
    """A filter that functions of the core use as well."""

    def __init__(self, largest_theta: float) -> None:
        self.structure = structure("filter")(largest=largest_theta, pairs=np.empty(2 * ROOM))

    def restart(self, largest_theta: float) -> None:
        """Empty it, with another limit."""
        self.structure.count, self.structure.largest = 0, largest_theta

    def add(self, theta: float, phi: float) -> None:
        """Forbid points no better than (theta, phi) by a margin."""
        function("line_search_add")(self.structure, theta, phi)

    def accepts(self, theta: float, phi: float) -> bool:
        """True when no pair dominates the point."""
        return function("line_search_accepts")(self.structure, theta, phi) != 0
