"""Points of the iteration, compiled: each pass goes once over the vectors and leaves a few numbers.

Those that find the step from one point to the next are in :mod:`stc.solver.step_kernels`.

Vectors are those of :class:`stc.solver.workspace.Workspace`, ``s`` is its array of numbers (:mod:`stc.solver.state`).
``index``, ``sign``, ``kind``, ``free`` and ``moving`` describe the form of the problem (:mod:`stc.solver.formulation`),
``start``, ``order`` and ``rows`` the columns of J (:func:`column_times`):
rows are equalities, inequalities or ignored (:data:`EQUALITY`, :data:`INEQUALITY`, :data:`IGNORED`).
"""

from __future__ import annotations

from typing import Final

from stc.core.functions import function

EQUALITY: Final = 0
INEQUALITY: Final = 1
IGNORED: Final = 2

#: The largest number that dual errors are divided by (:func:`multiplier_scale`).
LARGEST_MULTIPLIER: Final = 1e3

#: Sum of the logarithms of positive numbers, nan when one is not.
log_sum = function("kernels_log_sum")
#: What dual errors are divided by where multipliers are large, given the sum of their magnitudes.
multiplier_scale = function("kernels_multiplier_scale")
#: Errors of the optimality conditions; ``residual`` becomes the gradient of the whole Lagrangian.
measure = function("kernels_measure")
#: Largest ``(limit - value) * unit`` of rows and variables, at least 0; infinite where a row is no number.
overstepped = function("kernels_overstepped")
#: Copy a vector.
copy = function("kernels_copy")
#: The point at a fraction of the step, and its variables where the functions look for them.
place = function("kernels_place")
#: Gaps, residual of the rows and what the filter asks of a point whose rows have been evaluated.
inspect = function("kernels_inspect")
#: Multipliers of the trial point.
blend = function("kernels_blend")
#: Make the trial point the iterate, unless a derivative is not finite there.
move = function("kernels_move")
#: Complete an iterate that has been evaluated and inspected.
adopt = function("kernels_adopt")
#: Move ``w`` inside its bounds by ``push``, relative to the bound's size or the bounds' distance.
push_inside = function("kernels_push_inside")
