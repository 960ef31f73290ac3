"""Choosing between plans for segments in compiled code, as long as old ones will do.

A table has the calls of each plan: the elimination of the segments, the search for another scale, a probe of the
factors, the end of a factorisation, and the solves.  Which plan is in use, which is due, and what has come of it is in
the tally of a system; stc.solver.kkt.plan_choice decides what to put there, and takes account of it.
"""

from __future__ import annotations

from stc.codegen.calls import invoke
from stc.codegen.native import f64, f64s, i64, i64s, native
from stc.solver.kkt.attempts import MADE, has_served, note_waste
from stc.solver.kkt.lane_state import COUNTED, LARGEST, TRUSTED
from stc.solver.kkt.pivots import NEGATIVE, POSITIVE, ZERO
from stc.solver.kkt.segmented_passes import DOUBTED_SCALE

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

#: In the tally of a system, behind the attempts that succeeded: how many more there may be, -1 where another plan is
#: due; the plan of the factors, and that for the next matrix; another one to try when no more are allowed, or -1; how
#: many are allowed when that suits, and when not; what came of it (0 so far), and how many had succeeded by then; 1 as
#: long as there is no scale yet.
ALLOWED, NOW, NEXT, OTHER, IF_SUITED, IF_REFUSED, OUTCOME, MADE_BEFORE, FRESH, TALLY = (
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
INACCURATE = 1e-5
SINGULAR = 3e9
#: Where both are below this share of that, factors are not tried again until they are so many times as suspect, but
#: above this share in any case, ...
EASILY = 0.01
MORE = 3.0
MOST_TRUSTED = 1e-2
#: ... unless both are below this one: factors of many bodies are always suspect and hardly ever inaccurate.
BY_FAR = 1e-4


@native(shared=True)
def begin(curved: i64, curvatures: i64s, account: f64s, calls: i64s, tally: i64s) -> i64:
    """1 where another plan may suit better: H has become zero or is so no longer, or it is time to choose.

    Otherwise the first of all matrices is scaled.
    """
    if has_served(account) != 0 or (curvatures[0] != 0) != (curved != 0):
        return 1
    if tally[ALLOWED] <= 0 and tally[OTHER] < 0:
        return 1
    tally[ALLOWED] -= 1
    if tally[FRESH] != 0:
        tally[FRESH] = 0
        invoke(calls, CALLS * tally[NEXT] + EQUILIBRATE)
    return 0


@native(shared=True)
def eliminate_by(calls: i64s, plan: i64) -> i64:
    """Eliminate the segments by a plan, with another scale where the old one does not serve; 0 where that could be."""
    own = CALLS * plan
    ended = invoke(calls, own + ELIMINATE)
    if ended != 0 and invoke(calls, own + EQUILIBRATE) != 0:
        ended = invoke(calls, own + ELIMINATE)
    # A scale that has been doubted serves, or there is a new one.
    return 0 if ended == DOUBTED_SCALE else ended


@native(shared=True)
def eliminate(calls: i64s, tally: i64s) -> i64:
    """The same by the plan for the next matrix, or by another one that is due and suits."""
    if tally[OTHER] >= 0 and tally[ALLOWED] < 0:
        other = tally[OTHER]
        tally[OTHER] = -1
        tally[MADE_BEFORE] = tally[MADE]
        tally[MADE] = 0
        if eliminate_by(calls, other) == 0:
            tally[OUTCOME] = SUITED
            tally[NOW] = other
            tally[NEXT] = other
            tally[ALLOWED] = tally[IF_SUITED]
            return 0
        tally[OUTCOME] = REFUSED
        tally[ALLOWED] = tally[IF_REFUSED]
    tally[NOW] = tally[NEXT]
    return eliminate_by(calls, tally[NOW])


@native(shared=True)
def end(calls: i64s, tally: i64s) -> i64:
    """``end_of_plan`` for the plan of the factors."""
    return invoke(calls, CALLS * tally[NOW] + END)


@native(shared=True)
def is_accurate(calls: i64s, plan: i64, report: f64s, state: f64s) -> i64:
    """Solve once: a matrix that is nearly singular has long solutions, inaccurate factors a large residual."""
    invoke(calls, CALLS * plan + PROBE)
    if report[0] < EASILY * INACCURATE and report[2] < EASILY * SINGULAR:
        by_far = report[0] < BY_FAR * INACCURATE and report[2] < BY_FAR * SINGULAR
        state[TRUSTED] = min(1.0 if by_far else MOST_TRUSTED, MORE * state[LARGEST])
    return 1 if report[0] < INACCURATE and report[2] < SINGULAR else 0


@native(shared=True)
def end_of_plan(
    calls: i64s, plan: i64, counts: i64s, account: f64s, eliminated: i64, added: i64, state: f64s, report: f64s,
    fine: f64, inertia: i64s, accuracy: f64s, tally: i64s,
) -> i64:  # fmt: skip
    """``attempts.end``, of segments and the rest; 1 also where the factors are not accurate.

    Args:
        eliminated: unknowns of the segments.
        added: pairs of unknowns that were added, which have one eigenvalue of either sign.
        report: what the plan's probe leaves.
    """
    if counts[ZERO] > 0:
        return 1
    if not (state[LARGEST] <= state[TRUSTED]) and is_accurate(calls, plan, report, state) == 0:
        return 1
    note_waste(counts, account)
    negative = int(state[COUNTED])
    inertia[0] = eliminated - negative + counts[POSITIVE] - added
    inertia[1] = negative + counts[NEGATIVE] - added
    inertia[2] = 0
    accuracy[0] = fine
    tally[MADE] += 1
    return 0


@native(shared=True)
def solve(calls: i64s, which: i64, tally: i64s) -> None:
    """Solve with the factors at hand; ``which`` is SOLVE or SOLVE_BOTH."""
    invoke(calls, CALLS * tally[NOW] + which)
