"""The line search, compiled.

See :mod:`stc.solver.globalization` for the method, and :mod:`stc.solver.state` for the numbers ``s`` and the calls.
"""

from __future__ import annotations

from stc.core.functions import function

GAMMA_THETA = 1e-5
GAMMA_PHI = 1e-8
DELTA = 1.0
S_THETA = 1.1
S_PHI = 2.3
ETA = 1e-8
GAMMA_ALPHA = 0.05
MOST_CORRECTIONS = 4
CORRECTION_PROGRESS = 0.99
SMALLEST_POWER = 1e-300
LONGER, WORTHWHILE = 2.0, 1.25
"""By how much a step is lengthened at a time, and at least."""
LIKELY = 0.25
"""Share of the fall that the Lagrangian's slope promises, which has to come true for that."""
DOWNHILL = 0.5
"""Share of the same slope that is to be the barrier function's, rather than the violation's."""
SURE = 0.3
"""How far the Lagrangian may be from the parabola through what was found before, relative to its fall."""
EPSILON = 2.0**-52
#: How a search may end.
TAKEN, NOT_TAKEN, CALL_MISSING, NOT_FINITE = 0, 1, 2, 3
#: What a point tried may be: refused, acceptable by its barrier function, or by the filter, which is then extended.
REFUSED, DESCENT, OUTSIDE = 0, 1, 2

#: Move the iterate along the step by the largest fraction of :data:`LIMIT`, halved again and again, that will do.
backtrack = function("line_search_backtrack")
#: Search along the step from the iterate.
search = function("line_search_search")
