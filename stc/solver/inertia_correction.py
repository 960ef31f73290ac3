"""Inertia correction, compiled: which shift of the Hessian to try next.

A. Waechter and L. T. Biegler, Math. Program. 106, 2006, algorithm IC. See :mod:`stc.solver.newton_system` for the
system, and :mod:`stc.solver.state` for the numbers ``s`` and the calls.
"""

from __future__ import annotations

from stc.core.functions import function

FIRST_SHIFT = 1e-4
"""In units of the Hessian's usual curvature, which is taken to be within these."""
SMALLEST_CURVATURE, LARGEST_CURVATURE = 1e-6, 1e2
SMALLEST_SHIFT = 1e-20
LARGEST_SHIFT = 1e40
GROWTH_AT_FIRST = 100.0
GROWTH = 8.0
DECAY = 1.0 / 3.0
SMALLER = 0.9
"""A shift below such a share of the last iterate's is a smaller one; should it fail, that one is tried next."""
ITS_DUAL_SHIFT = 1e-8
MOST_UNTRIED = 3
"""Iterations in a row at most in which a matrix without a shift is not tried, after it has failed again and again."""
FAR = 1e-4
"""Error of the iterate from which on it is far."""
NEARLY_WHOLE = 0.5
"""Share of a step, from which on it is counted as accepted."""
SOFTER = 0.01
SMALLEST_STIFFNESS = 1e-8
WATCHED, SLOW = 6, 0.6
WHOLE_STEP = 0.99
"""So many damped steps in a row that are whole, but leave more than such a share of the dual error, are the last."""
BENT = 0.05
"""Share of the variables that an objective has to bend at least."""
#: What a factorisation has to do next: try the shifts, look at what that has found, shift more, damp, or either, ...
TRY, LOOK, GROW, DAMP, DAMP_OR_GROW = 0.0, 1.0, 2.0, 3.0, 4.0
#: ... and how it may end: done, or somebody else has to factorise, provide a call, or give up.
DONE, REFACTOR, CALL_MISSING, NO_SHIFT = 0, 1, 2, 3
UNKNOWN = -1.0

#: The median of the magnitudes that are not zero, 0 where all are; of two, the larger one.  Reorders ``values``.
median_magnitude = function("inertia_correction_median_magnitude")
#: Prepare the factorisation at an iterate; :func:`factorize` does it.
begin = function("inertia_correction_begin")
#: The next shift to try, after another one or the last iterate's; more than LARGEST_SHIFT where there is none.
larger_shift = function("inertia_correction_larger_shift")
#: Factorise, shifting until the inertia is right.
factorize = function("inertia_correction_factorize")
