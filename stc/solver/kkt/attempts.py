"""Factorisations where all goes to plan, in one call of machine code each.

Most matrices of a solve are such: nothing is left to decide.  A chain of calls factorises them, ends where something is
not as planned, and tells where; then :meth:`AttachedKKT.resume` does what is left to do.  Between several plans,
stc.solver.kkt.plan_calls chooses.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, i64, i64s, native
from stc.solver.kkt.pivots import FACTORS, NEGATIVE, POSITIVE, REJECTED, STRAYED, ZERO

__all__ = ["ACCOUNT", "MADE", "TALLY", "end", "has_served", "note_waste"]

#: In the tally of a system: attempts that succeeded since it was last looked at.
MADE, TALLY = 0, 1

#: A matrix costs more than its plan by its further entries, by this share of all for stages that strayed, ...
STRAYING = 0.5
#: ... and by so many entries for a rejected pivot.
REJECTION = 25
#: In the account of a system: what matrices have cost beyond the plan, what they may, entries and stages of the plan,
#: the latter counted several times where straying costs little.
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
