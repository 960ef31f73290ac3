"""A row of stages gone through from both ends at once, so that two threads can share it.

    stage    0   1   2   3   4   5   6        label   0   1   2   6   5   4   3
             ->  ->  ->  *  <-  <-  <-                a       a   *   b       b

What the two parts leave meets in the middle, *, which is last but for the border.  On one thread that takes as many
operations as from one end (the twisted factorisation of Babuska 1972).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.postponing import postponed
from stc.solver.kkt.segments import Numbered, Row, number_unknowns

__all__ = ["fold"]

#: Stages of either part at least.
SHORTEST = 8


def fold(
    couplings: Couplings,
    row: Row,
    held: NDArray[np.bool_] | None,
    equations: NDArray[np.bool_] | None = None,
) -> tuple[Numbered, tuple[int, int]] | None:
    """Number the stages from both ends to the middle; how many either part has. None where they are few.

    The first part has the first labels, then comes the second one, from the last stage on, then the middle.

    Args:
        held: see ``number_stages``; equations: see ``find_chain``.
    """
    forwards, backwards = row.directions()
    count = int(row.stage.max()) + 1
    # Whoever meets in the middle should have had as much to do.
    work = np.cumsum(np.bincount(row.stage, minlength=count).astype(np.float64) ** 2)
    middle = int(np.searchsorted(work, 0.5 * work[-1]))
    parts = middle, count - 1 - middle
    if min(parts) < SHORTEST:
        return None
    label = np.full(row.stage.size, count - 1, dtype=np.int32)
    first, second = forwards < middle, backwards > middle
    label[first] = forwards[first]
    label[second] = middle + (count - 1 - backwards[second])
    if np.bincount(label, minlength=count).min() == 0:
        return None
    label = postponed(couplings, label, row.border, held, equations, parts)
    return number_unknowns(couplings, label, row.border, held), parts
