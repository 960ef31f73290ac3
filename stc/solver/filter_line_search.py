"""The line search, compiled.

See :mod:`stc.solver.globalization` for the method, and :mod:`stc.solver.state` for the numbers ``s`` and the calls.
"""

from __future__ import annotations

from stc.core.functions import function

#: How a search may end.
TAKEN, CALL_MISSING, NOT_FINITE = 0, 2, 3

#: Move the iterate along the step by the largest fraction of :data:`LIMIT`, halved again and again, that will do.
backtrack = function("line_search_backtrack")
#: Search along the step from the iterate.
search = function("line_search_search")
