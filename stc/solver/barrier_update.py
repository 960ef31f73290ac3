"""The barrier parameter, and the step that goes with it, compiled.

See :mod:`stc.solver.barrier_parameter` for the method, :mod:`stc.solver.state` for the numbers ``s`` and the calls.
"""

from __future__ import annotations

from stc.core.functions import function

SMALLEST_TAU = 0.99
SOLVED = 10.0  # a barrier problem counts as solved when its error is below this multiple of mu
LINEAR_DECREASE = 0.2
MARGIN = 1e-5
HELD_FRACTION = 0.8
LARGEST_GROWTH = 1e3
#: Where the error has become RELAPSE times larger, so often, with a parameter no less than CRAWL times the one before,
#: the free choice takes several steps for each small reduction: problems that are solved allow larger ones.
RELAPSE, CRAWL, PATIENT = 10.0, 0.25, 2.0
#: Why no step was found.
CALL_MISSING, DOUBTFUL_SOLUTION = 1, 2

#: Decide the mode for the iterate, just measured, and, in the held mode, the parameter.
update = function("barrier_update_update")
#: Find the step with the factorised system; chooses mu first in the free mode.
find_step = function("barrier_update_find_step")
