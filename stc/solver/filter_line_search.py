"""The filter line search on (constraint violation, barrier function).

The method and its code are in ``stc/core/iteration/line_search.c``.
"""

from __future__ import annotations

from stc.core.functions import function

SMALL_VIOLATION = 1e-4
"""A violation, or error, below which an iterate is near."""
HALF = 0.5
"""Of a step, of a violation or of an error: what is nearly whole, and what is clearly less."""
CORRECTION_PROGRESS = 0.99
MOST_CORRECTIONS = 4
#: How a search may end.
TAKEN, CALL_MISSING, NOT_FINITE = 0, 2, 3

#: Move the iterate along the step by the largest fraction of :data:`LIMIT`, halved again and again, that will do.
backtrack = function("line_search_backtrack")
#: Search along the step from the iterate.
search = function("line_search_search")
