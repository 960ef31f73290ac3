"""A panel: the columns of several pivots out of the window at once, and one update of the window by all of them.

The method and its code are in ``stc/core/staged/panel.c``.
"""

from __future__ import annotations

import numpy as np

__all__ = ["LARGEST_GROUP", "MASKS", "VECTOR"]

#: Numbers of a vector.
VECTOR = 8
#: Row k of these, eight numbers each, keeps the entries of a vector after k; the last one keeps all.
MASKS = np.vstack([np.triu(np.ones((VECTOR, VECTOR)), 1), np.ones(VECTOR)]).reshape(-1)
#: Room for members of a group.
LARGEST_GROUP = 32
