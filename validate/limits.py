"""Every limit that a verdict depends on, and every setting that decides how fine a replay is.

A motion passes when all its metrics stay within their limits.  Lengths are in metres, angles in radians.
"""

from __future__ import annotations

from typing import Final

#: Longest time step of the replay, in seconds; a frame step is cut into equal parts no longer than this.
TIME_STEP: Final = 1e-3

#: A frame step is cut into at least so many parts, however short it is.
SUBSTEPS: Final = 4

#: Largest open-loop drift of a joint or compared output from the solved motion, by transcription.  The
#: collocation of hermite-simpson is of fourth order in the step, the two others are of second order: their
#: own truncation shows in the drift, so that they are held to a coarser limit.
OPEN_LOOP_DRIFT: Final[dict[str, float]] = {
    "hermite-simpson": 1e-4,
    "trapezoidal": 1e-2,
    "central": 1e-2,
}

#: Largest inverse-dynamics residual where the equations of motion hold, as a share of the motion's largest
#: generalised force.  It measures the equations alone: neither the step nor an unstable system enlarges it.
INVERSE_DYNAMICS: Final = 1e-9
