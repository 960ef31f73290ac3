"""What is noted of every iterate and step, compiled; :mod:`stc.solver.progress` tells what it is for."""

from __future__ import annotations

from stc.core.functions import function

ITS_PATIENCE = 15
MOST_TINY_STEPS = 2
SHORT = 1e-2
LARGEST_ERROR = 1e50

#: For :class:`Drift`: the objective and the dual error of the iterate just measured.
note_objective = function("progress_note_objective")
#: For :class:`Nearest`: the iterate just measured.
note_iterate = function("progress_note_iterate")
#: Whether a point is better than the best so far: violations up to ``tolerance`` count as none.
is_better = function("progress_is_better")
#: Record the iterate, and keep its variables (n,) and row multipliers (m,) where it is the best so far.
record = function("progress_record")
