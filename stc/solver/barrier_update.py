"""How far the barrier parameter mu goes down at each iteration, and the step that goes with it.

The method and its code are in ``stc/core/iteration/barrier_update.c``.
"""

from __future__ import annotations

from stc.core.functions import function

SMALLEST_TAU = 0.99
#: Why no step was found.
DOUBTFUL_SOLUTION = 2

#: Decide the mode for the iterate, just measured, and, in the held mode, the parameter.
update = function("barrier_update_update")
#: Find the step with the factorised system; chooses mu first in the free mode.
find_step = function("barrier_update_find_step")
