"""Pivots of one and two unknowns: which are acceptable, and taking them out of the window.

Factors: pivot k takes out the positions ``pivots[2 k]`` and, when 2x2, ``pivots[2 k + 1]`` (otherwise -1).  Its
rows, ``starts[2 k + 1]`` of them, begin at ``indices[starts[2 k]]``; their factors follow those of the pivot before:
when 2x2 those of the first unknown, then those of the second.  ``inverse[3 k:3 k + 3]`` is D^-1 as (pp, pq, qq).

Leaves are unknowns whose columns are still as in the matrix when they are eliminated.  Nothing is stored for them:
``starts[2 k + 1]`` is -1 less their rows, which are ``columns[starts[2 k]]`` and on, and their factors the values there
times D^-1.

``growth`` of a slot is the largest product subtracted from its column so far, at least 1: what remains of a column
after cancellation is worth no more than rounding errors of that size.
"""

from __future__ import annotations

__all__ = [
    "COUNTS",
    "DELAYED",
    "FACTORS",
    "INDICES",
    "NEGATIVE",
    "PIVOTS",
    "POSITIVE",
    "REJECTED",
    "STRAYED",
    "ZERO",
]

#: Places in ``counts``: pivots taken, entries of indices and of factors used, eigenvalues by sign, unknowns delayed
#: to another stage, candidates rejected, stages that left the plan.
PIVOTS = 0
INDICES = 1
FACTORS = 2
POSITIVE = 3
NEGATIVE = 4
ZERO = 5
DELAYED = 6
REJECTED = 7
STRAYED = 8
COUNTS = 9
