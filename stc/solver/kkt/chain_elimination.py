"""Stages of a chain eliminated one after the other, in a window whose places are fixed before.

The method and its code are in ``stc/core/staged/chain_elimination.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = [
    "BASE",
    "BLOCK",
    "BLOCKS",
    "BLOCKS_AT",
    "BORDER",
    "CARRIED",
    "CARRIED_TO",
    "CLEARED",
    "CLEARED_AT",
    "CODE",
    "ENTRIES",
    "FACTORS",
    "FIELDS",
    "INSIDE",
    "JOINED",
    "JOINED_TO",
    "MATRIX",
    "OUTER",
    "PANELS",
    "PANELS_AT",
    "PLACES_AT",
    "PROGRAM",
    "RECORD",
    "ROWS",
    "ROWS_AT",
    "SIZE",
    "SOURCES",
    "eliminate",
    "eliminate_run",
    "padded",
]

#: Numbers that are read and written together.
BLOCK = 8
#: Of a stage: where its program begins, and its unknowns in vectors, the sources of its entries, what is kept of its
#: matrix and its factors; where in the programs the places of F in vectors are, counted from BASE.
CODE, BASE, SOURCES, MATRIX, FACTORS, OUTER, FIELDS = 0, 1, 2, 3, 4, 5, 6
#: Of a program: rows of the window; unknowns of U, and of B; ...
SIZE, INSIDE, BORDER = 0, 1, 2
#: ... blocks without entries to be cleared first, by their places in the window; entries off the diagonal, with the
#: zeros between those of a block, and behind the last one up to whole vectors; blocks with entries, row by row: the
#: column where each begins, its row, which of its numbers are among these, bit by bit, and where its first number
#: would be; rows with blocks, each with how many; ...
CLEARED, CLEARED_AT, ENTRIES, BLOCKS, BLOCKS_AT, ROWS, ROWS_AT = 3, 4, 5, 6, 7, 8, 9
RECORD = 4
#: ... how many rows the stage before has left, and where its triangle goes, entry by entry; ...
CARRIED, CARRIED_TO = 10, 11
#: ... panels (see ``stc/core/staged/chain_panel.c``); ...
PANELS, PANELS_AT = 12, 13
#: ... where each panel begins, counted from PANELS_AT, and its factors; ...
PLACES_AT = 14
#: ... the same as CARRIED for a second part of the chain that has come to its end.
JOINED, JOINED_TO, PROGRAM = 15, 16, 17

#: Room for so many numbers in whole blocks.
padded = function("chain_elimination_padded")
#: Eliminate stages that follow one another; ``state[COUNTED]`` becomes the negative pivots, -1 if one is refused.
eliminate_run = function("chain_elimination_eliminate_run")
#: Eliminate all stages.
eliminate = function("chain_elimination_eliminate")
