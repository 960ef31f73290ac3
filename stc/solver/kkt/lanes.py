"""Eight segments of the horizon eliminated at once, one in each lane of the vectors, stage by stage.

The method and its code are in ``stc/core/staged/lanes.c``.
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
