"""Factorisations where all goes to plan, in one call of machine code each.

Most matrices of a solve are such: nothing is left to decide.  A chain of calls factorises them, ends where something is
not as planned, and tells where; then :meth:`AttachedKKT.resume` does what is left to do.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, i64, i64s, native
from stc.solver.kkt.lane_panel import COUNTED, LARGEST
from stc.solver.kkt.pivots import FACTORS, NEGATIVE, POSITIVE, REJECTED, STRAYED, ZERO

__all__ = ["ALLOWED", "MADE", "TALLY", "begin", "end", "end_of_segments", "has_served", "note_waste"]

#: In the tally of a system: attempts that succeeded since it was last looked at, and how many more there may be.
MADE, ALLOWED, TALLY = 0, 1, 2


#: A matrix costs more than its plan by its further entries, by this share of all for stages that strayed, ...
STRAYING = 0.5
#: ... and by so many entries for a rejected pivot.
REJECTION = 25
#: In the account of a system: what matrices have cost beyond the plan, what they may, entries and stages of the plan.
WASTED, ALLOWANCE, ENTRIES, STAGES, ACCOUNT = 0, 1, 2, 3, 4


@native
def note_waste(counts: i64s, account: f64s) -> None:
    """Compare what the last factorisation cost with the plan."""
    if counts[STRAYED] > 0 or counts[REJECTED] > 0 or counts[FACTORS] > account[ENTRIES]:
        strayed = counts[STRAYED] / max(account[STAGES], 1.0)
        account[WASTED] += max(counts[FACTORS] - account[ENTRIES], 0.0) + STRAYING * strayed * counts[FACTORS]
        account[WASTED] += REJECTION * counts[REJECTED]


@native
def has_served(account: f64s) -> i64:
    """1 when another plan is due."""
    return 1 if account[WASTED] >= account[ALLOWANCE] else 0


@native
def begin(curved: i64, curvatures: i64s, account: f64s, tally: i64s) -> i64:
    """1 where another plan may suit better: H has become zero or is so no longer, or it is time to choose anew."""
    if has_served(account) != 0:
        return 1
    if tally[ALLOWED] <= 0 or (curvatures[0] != 0) != (curved != 0):
        return 1
    tally[ALLOWED] -= 1
    return 0


@native
def end(counts: i64s, account: f64s, fine: f64, inertia: i64s, accuracy: f64s, tally: i64s) -> i64:
    """The inertia found, (3,); 1 where the matrix is singular."""
    if counts[ZERO] > 0:
        return 1
    note_waste(counts, account)
    inertia[0] = counts[POSITIVE]
    inertia[1] = counts[NEGATIVE]
    inertia[2] = 0
    accuracy[0] = fine
    tally[MADE] += 1
    return 0


@native
def end_of_segments(
    counts: i64s, account: f64s, trusted: f64, eliminated: i64, added: i64, state: f64s, fine: f64, inertia: i64s,
    accuracy: f64s, tally: i64s,
) -> i64:  # fmt: skip
    """The same, of segments and the rest.

    Args:
        trusted: growth and inverses up to which the factors of the segments are not tried.
        eliminated: unknowns of the segments.
        added: pairs of unknowns that were added, which have one eigenvalue of either sign.
    """
    if counts[ZERO] > 0 or not (state[LARGEST] <= trusted):
        return 1
    note_waste(counts, account)
    negative = int(state[COUNTED])
    inertia[0] = eliminated - negative + counts[POSITIVE] - added
    inertia[1] = negative + counts[NEGATIVE] - added
    inertia[2] = 0
    accuracy[0] = fine
    tally[MADE] += 1
    return 0
