"""Pivots of one and two unknowns: which are acceptable, and taking them out of the window.

The method and its code are in ``stc/core/staged/pivots.c``.
"""

from __future__ import annotations

__all__ = [
    "COUNTS",
    "DELAYED",
    "FACTORS",
    "INDICES",
    "NEGATIVE",
    "PIVOTS",
    "POSITIVE",
    "REJECTED",
    "STRAYED",
    "ZERO",
]

#: Places in ``counts``: pivots taken, entries of indices and of factors used, eigenvalues by sign, unknowns delayed
#: to another stage, candidates rejected, stages that left the plan.
PIVOTS = 0
INDICES = 1
FACTORS = 2
POSITIVE = 3
NEGATIVE = 4
ZERO = 5
DELAYED = 6
REJECTED = 7
STRAYED = 8
COUNTS = 9
