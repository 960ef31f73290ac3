"""Compiled parts of Newton's method on the active set: how far a point is from a solution, and what a step leads to.

The method and its code are in ``stc/core/iteration/projection.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = [
    "ACCURATE",
    "ADVANCE",
    "CALLS",
    "CONTRACTION",
    "EVALUATE",
    "REMAINING",
    "SOLVE",
    "improve",
    "judge",
    "undefined",
]

CONTRACTION = 0.1
ACCURATE = 0.1
"""Share of the tolerance that a point is to reach where another step would."""
EXACT = 1e-3
"""Share of the tolerance above which a correction with the factorisation at hand is worth its while."""

#: Calls of a pair of points, those of the first one and then of the second: evaluate it; the right-hand side for a
#: correction from there; move from there to the other one. The last one solves.
EVALUATE, REMAINING, ADVANCE, SOLVE, CALLS = 0, 2, 4, 6, 7

#: 1 where functions are undefined.
undefined = function("projection_undefined")
#: The largest violated condition, dual ones over the size of the ``count`` multipliers; 1 where it is none.
judge = function("projection_judge")
#: Make a Newton step, found already, and make it better with the same factorisation where it has contracted.
improve = function("projection_improve")
