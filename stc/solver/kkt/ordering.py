"""In which order to eliminate the unknowns of one stage, found by eliminating the sizes of its entries.

The method and its code are in ``stc/core/staged/ordering.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = [
    "MARGIN",
    "SECOND",
    "SETS",
    "SMALLEST",
    "order_stage",
]

#: The kind of an unknown in an order that is the second of a pivot of two.
SECOND = 0

#: The thresholds that pivots are planned for are multiples of this.
MARGIN = 0.01
#: Sizes stay between these, so that what is there never vanishes.
SMALLEST = 1e-30
#: Sets of slots that the search needs room for.
SETS = 4

#: Eliminate the slots ``waiting`` (count,) from the sizes (top * top,), in place.
order_stage = function("ordering_order_stage")
