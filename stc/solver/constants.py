"""Numbers that several files of the solver share, most of them with its core (``stc/core/iteration``)."""

from __future__ import annotations

from typing import Final

SMALL_VIOLATION: Final = 1e-4
"""A violation, or error, below which an iterate is near."""
HALF: Final = 0.5
"""Of a step, of a violation or of an error: what is nearly whole, and what is clearly less."""
CONTRACTION: Final = 0.1
ACCURATE: Final = 0.1
"""Share of the tolerance that a point is to reach where another step would."""
EXACT: Final = 1e-3
"""Share of the tolerance above which a correction with the factorisation at hand is worth its while."""
SHORT: Final = 1e-2
SMALLEST_TAU: Final = 0.99
CORRECTION_PROGRESS: Final = 0.99
MOST_CORRECTIONS: Final = 4
SMALLEST_SHIFT: Final = 1e-20
LARGEST_SHIFT: Final = 1e40
GROWTH: Final = 8.0
LARGEST_MULTIPLIER: Final = 1e3
"""The largest number that dual errors are divided by."""
LARGEST_ERROR: Final = 1e50

# Of ``iteration.h``: kinds of rows; prepared calls; numbers in a record; where an iteration, a factorisation, a search
# may end.
EQUALITY: Final = 0
INEQUALITY: Final = 1
IGNORED: Final = 2
VALUES: Final = 0
DERIVATIVES: Final = 1
WATCH: Final = 2
ATTEMPT: Final = 3
SOLVE: Final = 4
SOLVE_BOTH: Final = 5
CALLS: Final = 6
RECORD: Final = 7
LOOK: Final = 1
FACTORIZATION: Final = 3
SEARCH: Final = 5
BLOCKED: Final = 6
DONE: Final = 0
NO_SHIFT: Final = 3
TAKEN: Final = 0
NOT_FINITE: Final = 3
UNKNOWN: Final = -1
