"""Panels of one, two or four unknowns, taken out of the window of a stage (see stc.solver.kkt.chain_elimination).

D has blocks of one and, for the first or last two members of a panel, of two unknowns.  A panel is a list of numbers:

    members; 2 where the first two make one pivot; the same of the last two; row of the first member (the others are
    above); blocks; rows
    for each block: its column, and how many rows have it to the left of their diagonal or on it
    for each row, decreasing: where it begins in the window, and where its factor is, behind those of the corner

Its factors are D^-1 and L of the corner, where its members meet, then D^-1 C, block by block, C being the members' rows
once they have been eliminated from each other.
"""

from __future__ import annotations

__all__ = ["NEGATIVE"]

#: Places in ``state``: the largest entries on the diagonal of D^-1 so far, in groups of eight; the largest products due
#: to these, the same; a sum that is finite if all pivots are; negative pivots; the largest entry of D^-1 beside the
#: diagonal; the square of the largest product due to one. Others are as in lane_state.
NEGATIVE = 20
