"""Choosing between plans for segments in compiled code, as long as old ones will do.

The method and its code are in ``stc/core/staged/plan_calls.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = [
    "ALLOWED",
    "CALLS",
    "ELIMINATE",
    "END",
    "EQUILIBRATE",
    "FRESH",
    "IF_REFUSED",
    "IF_SUITED",
    "MADE",
    "MADE_BEFORE",
    "NEXT",
    "NOW",
    "OTHER",
    "OUTCOME",
    "PROBE",
    "REFUSED",
    "SOLVE",
    "SOLVE_BOTH",
    "SUITED",
    "TALLY",
    "begin",
    "eliminate",
    "end",
    "end_of_plan",
    "is_accurate",
    "solve",
]

#: In the tally of a system: attempts that succeeded since it was last looked at; how many more there may be, -1 where
#: another plan is due; the plan of the factors, and that for the next matrix; another one to try when no more are
#: allowed, or -1; how many are allowed when that suits, and when not; what came of it (0 so far), and how many had
#: succeeded by then; 1 as long as there is no scale yet.
MADE, ALLOWED, NOW, NEXT, OTHER, IF_SUITED, IF_REFUSED, OUTCOME, MADE_BEFORE, FRESH, TALLY = (
    0,
    1,
    2,
    3,
    4,
    5,
    6,
    7,
    8,
    9,
    10,
)
SUITED, REFUSED = 1, 2
#: Calls of a plan for segments, in a table that has so many for each.
ELIMINATE, EQUILIBRATE, PROBE, END, SOLVE, SOLVE_BOTH, CALLS = 0, 1, 2, 3, 4, 5, 6
#: Where growth or inverses are larger than is trusted, factors are tried on a right-hand side: the residual, before
#: refinement, should be no larger than INACCURATE, and the solution no longer than SINGULAR times as much.
SINGULAR = 3e9
#: Where both are below this share of that, factors are not tried again until they are so many times as suspect, but
#: above this share in any case, ...
MOST_TRUSTED = 1e-2

#: 1 where another plan may suit better: H has become zero or is so no longer, or it is time to choose.
begin = function("plan_calls_begin")
#: The same by the plan for the next matrix, or by another one that is due and suits.
eliminate = function("plan_calls_eliminate")
#: ``end_of_plan`` for the plan of the factors.
end = function("plan_calls_end")
#: Solve once: a matrix that is nearly singular has long solutions, inaccurate factors a large residual.
is_accurate = function("plan_calls_is_accurate")
#: The inertia found, (3,), of segments and the rest; 1 where the factors are not accurate.
end_of_plan = function("plan_calls_end_of_plan")
#: Solve with the factors at hand; ``which`` is SOLVE or SOLVE_BOTH.
solve = function("plan_calls_solve")
