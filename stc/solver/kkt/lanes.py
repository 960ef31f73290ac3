"""Eight segments of the horizon eliminated at once, one in each lane of the vectors, stage by stage.

All lanes take the same pivots in the same order, fixed before.  What is in work is a dense lower triangle of vectors,
row by row: entry (i, j), i >= j, of all eight lanes is at ``work[8 (i (i + 1) / 2 + j)]``.  Its rows are, in order,

    U   unknowns of the stage, which are all eliminated
    F   unknowns of the next stage that couple with these
    L   states of the seam before the segment (see stc.solver.kkt.seams), which couple with its first stage
    B   unknowns that couple with every stage

and F becomes part of the next step's U.  Pivots are taken in panels of unknowns that share their rows.

In ``code``, a panel is: how many members, how many rows; for each member 1, 2 for the first of a pair or 0 for the
second; the members; the rows, increasing; where C is in the triangle, member by member.

What belongs to a group of eight segments is found by way of a table, FIELDS numbers for each group.
"""

from __future__ import annotations

__all__ = ["FIELDS", "RUNS"]

#: The numbers of a group: how many steps; unknowns of U, of F, L and B; ...
STEPS, OWN, NEXT, LEFT, BORDER = range(5)
#: ... where the unknowns of U begin in vectors, step by step, eight for each place; where in vectors those of the last
#: step's F are, as listed in ``index``, and, right behind them there, of L and B; ...
UNKNOWNS, LASTS, ENDS = 5, 6, 7
#: ... entries of a stage: how many (of which the first ADDED are added to what is carried over, the others stored
#: there), where the sources of each step are listed in ``index``, and where the places of
#: one step, three numbers each (entry, and its row and column in any order, the first the same for many entries in a
#: row), in ``code``; the same for those of L with the first stage; ...
ENTRIES, ENTRY_INDEX, ENTRY_CODE = 8, 9, 10
FIRST, FIRST_INDEX, FIRST_CODE = 11, 12, 13
#: ... panels, and where they are in ``code``; entries to be cleared before each step, before the first step, and those
#: that move (from, to); ...
PANELS, PANEL_CODE, CLEARED, CLEARED_CODE, EMPTY, EMPTY_CODE, MOVED, MOVED_CODE = range(14, 22)
#: ... what is left at the end: how many entries, which, and where each lane's go (targets); ...
RESULTS, RESULT_CODE, RESULT_INDEX = 22, 23, 24
#: ... where factors begin and how many vectors a step has; segments, the other lanes being copies of the first; where
#: the places of F in the next step's U, and the places of the panels in ``code``, are listed in ``code``; where the
#: scaled entries begin: those of L with the first stage, then the diagonal and the entries of each step; ...
FACTORS, FACTOR_STEP, SEGMENTS, FOLLOWING, PANEL_STARTS, MATRIX, ADDED = 25, 26, 27, 28, 29, 30, 31
#: ... where ``index`` has the runs of the entries (see stc.solver.kkt.lane_runs), 0 where each step loads its own.
RUNS = 32
FIELDS = 33
#: Entries of the matrix are asked for so many steps ahead; a line of memory has those of a lane for so many or more.
