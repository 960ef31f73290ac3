"""In which order to eliminate the unknowns of one stage, found by eliminating the sizes of its entries.

The method and its code are in ``stc/core/staged/ordering.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = [
    "COMPARED",
    "LEAF",
    "MARGIN",
    "SECOND",
    "SETS",
    "SMALLEST",
    "UNPLANNED",
    "follow_order",
    "order_stage",
    "take_leaves",
]

#: Kinds of unknowns in an order: first of a pivot of one or two, second of two, not eliminated.
SECOND = 0
UNPLANNED = -1

#: The thresholds that pivots are planned for are multiples of this.
MARGIN = 0.01
#: Leaves have no more entries than this in their columns, and diagonals of at least this share of the largest: they
#: leave no choice later.
LEAF = 4
#: Sizes stay between these, so that what is there never vanishes.
SMALLEST = 1e-30
#: Those with at most this many times the fewest multiplications are compared by their fill, as a rule.
COMPARED = 2.0
#: Sets of slots that the search needs room for.
SETS = 4

#: Eliminate slots in a known order; arguments as in ``order_stage``, ``lists`` is work space, (top,).
follow_order = function("ordering_follow_order")
#: Eliminate slots with few entries and a strong diagonal, no two of them coupled, before all others.
take_leaves = function("ordering_take_leaves")
#: Eliminate the slots ``waiting`` (count,) from the sizes (top * top,), in place.
order_stage = function("ordering_order_stage")
