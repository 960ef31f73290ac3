"""What is done with the segments of one part of a horizon, while another thread may be at those of another part.

The method and its code are in ``stc/core/staged/segmented_parts.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = [
    "ACTIVE",
    "BACKWARD",
    "CALLS",
    "FORWARD",
    "NORMS",
    "OTHER_ACTIVE",
    "OTHER_RIGHT",
    "PROGRESS",
    "RETURN",
    "RIGHT",
    "SPREADS",
    "STEPS",
    "backward_part",
    "eliminate_part",
    "forward_part",
    "return_part",
]

#: Numbers that ``eliminate`` notes of the rows of a part.
SPREADS = 16
#: How far a solve is: refinements so far, and whether either solution is still to be refined.
STEPS, ACTIVE, OTHER_ACTIVE, PROGRESS = 0, 1, 2, 3
#: Largest magnitudes that a part finds: those of ``subtract_segments``, then of the scaled right-hand sides.
RIGHT, OTHER_RIGHT, NORMS = 4, 5, 8
#: Where the phases of a solve are among the prepared calls.
FORWARD, BACKWARD, RETURN, CALLS = 0, 1, 2, 3

#: Eliminate the segments of a part (see ``eliminate``); ``state[COUNTED]`` becomes what that returns.
eliminate_part = function("segmented_parts_eliminate_part")
#: Bring a part of the right-hand side, from ``begin`` to ``end``, and substitute forward (see ``forward``).
forward_part = function("segmented_parts_forward_part")
#: Substitute back (see ``backward``), refine the solution, and find its residual, ``change``.
backward_part = function("segmented_parts_backward_part")
#: Return a part of the solution to the unknowns' own order.
return_part = function("segmented_parts_return_part")
