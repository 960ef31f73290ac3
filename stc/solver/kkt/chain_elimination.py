"""Stages of a chain eliminated one after the other, in a window whose places are fixed before.

Unknowns of a stage stand in the window in the opposite order of their elimination, behind those that it leaves to later
stages:

    B   unknowns that couple with every stage
    F   unknowns of the next stage that couple with these
    U   unknowns of the stage, the first one to be eliminated last

Of the window there is the lower triangle, row by row, ``stride`` numbers each.  So whatever a pivot couples with is to
the left of it in its own row, and rows are read and written in blocks of eight numbers.  Pivots are taken in panels
(see stc.solver.kkt.chain_panel).

What is right of the diagonal is never read as a number that counts, but is finite where all else is.

In vectors, too, the unknowns of U follow one another as in the window, stage by stage, and B comes last; there is room
for seven more numbers, which are read but do not count.

Programs are lists of numbers, one for all stages of a kind.  They begin with PROGRAM numbers, places of lists being
counted from there.  Each stage has FIELDS numbers in a table.
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
#: ... panels (see stc.solver.kkt.chain_panel); ...
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
