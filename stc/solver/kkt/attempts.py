"""Factorisations where all goes to plan, in one call of machine code each.

The method and its code are in ``stc/core/staged/plan_calls.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = ["ACCOUNT", "MADE", "TALLY", "end", "has_served", "note_waste"]

#: In the tally of a system: attempts that succeeded since it was last looked at.
MADE, TALLY = 0, 1

#: In the account of a system: what matrices have cost beyond the plan, what they may, entries and stages of the plan,
#: the latter counted several times where straying costs little.
WASTED, ACCOUNT = 0, 4

#: Compare what the last factorisation cost with the plan.
note_waste = function("plan_calls_note_waste")
#: 1 when another plan is due.
has_served = function("plan_calls_has_served")
#: The inertia found, (3,); 1 where the matrix is singular.
end = function("plan_calls_end_attempt")
