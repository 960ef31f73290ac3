"""The members of a panel eliminated from each other, in eight segments at once (see stc.solver.kkt.lane_panel).

All of it is done in registers and without a loop: there are formulas for every way to divide up to four members into
pivots of one and two unknowns.
"""

from __future__ import annotations

__all__ = ["BESIDE", "CORNER", "KNOWN", "MOST"]

#: Places in what is known of the members of a panel, eight numbers each: D^-1 on its diagonal, L in the corner (01, 02,
#: 03, 12, 13, 23), D^-1 beside its diagonal, and the largest entries of C; numbers of all.
CORNER = 32
BESIDE = 80
MOST = 104
KNOWN = 136
