"""A system of segments and a rest: equilibrating it, eliminating, and solving with the factors of both.

The method and its code are in ``stc/core/staged/segmented_passes.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = [
    "DOUBTED_SCALE",
    "REFUSED",
    "STALE_SCALE",
    "diagonal_of",
    "eliminate_all",
    "equilibrate_all",
    "solve_all",
]

#: Results of ``eliminate_all``.
REFUSED = 1
STALE_SCALE = 2
DOUBTED_SCALE = 3

#: Collect the diagonal, (n + m,); p and d begin at ``given[at]``.
diagonal_of = function("segmented_passes_diagonal_of")
#: Make ``scale`` serve the matrix (see ``equilibrate`` in ``stc/core/load.h``); whether it did not do so before.
equilibrate_all = function("segmented_passes_equilibrate_all")
#: Load the rest, eliminate the segments and add what they leave to the rest, ``result``.
eliminate_all = function("segmented_passes_eliminate_all")
#: Solve K x = rhs: the segments' part, the rest's, the segments' again; refined.
solve_all = function("segmented_passes_solve_all")
