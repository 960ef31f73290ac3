"""One panel of pivots taken out of eight segments at once (see stc.solver.kkt.lanes).

    C   members x (members + rows), what is left of their columns
    L   D^-1 C, the factors, which are kept             work[rows, rows] -= C^T L

The triangle's entry (i, j), i >= j, of all eight lanes is at ``work[8 (i (i + 1) / 2 + j)]``.  All that is kept of a
panel are the corner, members x members of L, and then the rest of L, the factors of one row after those of another.  Of
the corner there is the upper triangle, row by row: D^-1 on the diagonal, and beside it the other entry of D^-1 where a
pivot has two unknowns, which have no factor there.

The corner comes first (``lane_corner``).  The rest of C is made in registers, of two rows at a time, and so are their
factors; both rows are updated at once, each up to its diagonal, while their C is there.  So nothing but the triangle
and the factors goes through memory.  Where a register holds four numbers, four lanes take their turn with two rows,
then the other four: the vectors of eight would not fit.
"""

from __future__ import annotations

from stc.core.functions import function
from stc.solver.kkt.lane_corner import KNOWN

__all__ = ["KNOWN", "PANEL", "panel_vectors", "take_panel"]

#: Unknowns of a panel at most.
PANEL = 4

#: How many vectors are kept of a panel.
panel_vectors = function("lane_panel_panel_vectors")
#: Take the members out of ``work``.
take_panel = function("lane_panel_take_panel")
