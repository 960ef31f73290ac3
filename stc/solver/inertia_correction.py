"""Inertia correction, compiled: which shift of the Hessian to try next.

The method and its code are in ``stc/core/iteration/inertia_correction.c``.
"""

from __future__ import annotations

from stc.core.functions import function

SMALLEST_SHIFT = 1e-20
LARGEST_SHIFT = 1e40
GROWTH = 8.0
DECAY = 1.0 / 3.0
#: What a factorisation has to do next: try the shifts, look at what that has found, shift more, damp, or either, ...
LOOK = 1.0
#: ... and how it may end: done, or somebody else has to factorise, provide a call, or give up.
DONE, REFACTOR, NO_SHIFT = 0, 1, 3
UNKNOWN = -1.0

#: The median of the magnitudes that are not zero, 0 where all are; of two, the larger one.  Reorders ``values``.
median_magnitude = function("inertia_correction_median_magnitude")
#: Prepare the factorisation at an iterate; :func:`factorize` does it.
begin = function("inertia_correction_begin")
#: The next shift to try, after another one or the last iterate's; more than LARGEST_SHIFT where there is none.
larger_shift = function("inertia_correction_larger_shift")
#: Factorise, shifting until the inertia is right.
factorize = function("inertia_correction_factorize")
