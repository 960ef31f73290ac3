"""A panel: the columns of several pivots out of the window at once, and one update of the window by all of them.

    group       k1 k2 k3 | rows r1 r2 r3 ...         row t of ``panel`` is the column of pivot t: what is left of it
                                                     when the pivots before have been taken out; row t of
                ( d . .  |  .  .  .  )               ``lower`` is the same times D^-1, the factors.
                ( . d .  |  .  .  .  )
                ( . . d  |  .  .  .  )               window[rows, rows] -= lower[:, rows]^T panel[:, rows]

Inside the group, pivots that fail the threshold test are tried again after the others and with other partners: where
the plan has all of rows x rows filled, the order inside a group is free.  Rows are padded to whole vectors.
"""

from __future__ import annotations

import numpy as np

__all__ = ["CHANGED", "LARGEST_GROUP", "MASKS", "VECTOR"]

#: Numbers of a vector.
VECTOR = 8
#: Row k of these, eight numbers each, keeps the entries of a vector after k; the last one keeps all.
MASKS = np.vstack([np.triu(np.ones((VECTOR, VECTOR)), 1), np.ones(VECTOR)]).reshape(-1)
#: Added to the number of those eliminated when the order was not as planned.
CHANGED = 1000
#: Room for members of a group.
LARGEST_GROUP = 32
