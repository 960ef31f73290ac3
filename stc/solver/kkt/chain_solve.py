"""Solving with the factors of a chain, refined: what its runs of stages do, and how that is put together.

The method and its code are in ``stc/core/staged/chain_solve.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = [
    "BACKWARD",
    "BACKWARD_TAIL",
    "CALLS",
    "FORWARD",
    "FORWARD_TAIL",
    "PROGRESS",
    "backward_run",
    "forward_run",
    "solve",
]

#: What a run of stages is to do: whether it is a first solution, which is checked, and for which of two vectors.
PROGRESS = 2
#: Where the runs' calls are among the prepared ones.
FORWARD, FORWARD_TAIL, BACKWARD_TAIL, BACKWARD, CALLS = 0, 1, 2, 3, 4

#: Substitute forward with the factors of stages that follow one another.
forward_run = function("chain_solve_forward_run")
#: Substitute back with the factors of these stages; arguments as for ``forward_run``.
backward_run = function("chain_solve_backward_run")
#: Solve K x = rhs, refined.
solve = function("chain_solve_solve")
