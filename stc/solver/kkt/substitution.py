"""Solving with the factors of stc.solver.kkt.elimination, and refining against the matrix itself."""

from __future__ import annotations

from stc.core.functions import function

__all__ = ["REPORT", "solve"]

#: Columns of fewer entries are gone through one by one.
LONG = 20
#: Length of ``report``: relative residual, refinements made, and of the scaled system, solution over right-hand side.
REPORT = 3
#: Residuals are relative to the right-hand side plus the solution, or this much of the right-hand side.
LARGEST_GAIN = 1e6

#: Solve K x = rhs with the factors of S K S; ``rhs`` and ``result`` (N,) in the unknowns' own order.
solve = function("substitution_solve")
