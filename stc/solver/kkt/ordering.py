"""In which order to eliminate the unknowns of one stage, found by eliminating the sizes of its entries.

Pivots of one and two unknowns (Duff and Reid 1983) are taken greedily: among those that should pass the threshold
test with a margin, the ones with few multiplications are compared by the entries that they add.  For a pivot on p and
q, whose columns have the patterns P and Q,

    D^-1 = [ a_qq  -a_pq ] / det        fills  P x Q,   P x P if a_qq != 0,   Q x Q if a_pp != 0,
           [-a_pq   a_pp ]

so that a row of the problem without diagonal, paired with a variable, costs little more than |P| |Q|.

Sizes are entries of a stage like those to come in the window's slots, with their signs, zero where there is none: so
that pivots which always cancel, because fewer unknowns than these are behind them, are seen to.  An entry that cancels
is still an entry, if a tiny one.
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
