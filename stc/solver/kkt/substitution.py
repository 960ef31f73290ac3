"""Solving with the factors of stc.solver.kkt.elimination, and refining against the matrix itself."""

from __future__ import annotations

from stc.core.functions import function

__all__ = ["REPORT", "solve"]

#: Length of ``report``: relative residual, refinements made, and of the scaled system, solution over right-hand side.
REPORT = 3

#: Solve K x = rhs with the factors of S K S; ``rhs`` and ``result`` (N,) in the unknowns' own order.
solve = function("substitution_solve")
