"""The optimality conditions at a point, compiled: as stated, and as a projection equation."""

from __future__ import annotations

from typing import Final

from stc.core.functions import function

__all__ = [
    "advance",
    "better_signs",
    "gradient_of_lagrangian",
    "point_conditions",
    "project_entries",
    "remaining",
    "respond",
    "restrict",
    "restricted_diagonals",
    "stated_conditions",
]

#: Places in the results of :func:`stated_conditions`.
STATED: Final = 7

#: See :func:`stc.solver.residuals.assess`; without ``given`` multipliers of the bounds, ``z`` (n,) is chosen.
stated_conditions = function("conditions_stated_conditions")
#: Where each value ends when pushed and clipped, and which ones are clipped.
project_entries = function("conditions_project_entries")
#: Matrix and right-hand side of the Newton step on an active set.
restrict = function("conditions_restrict")
#: What a step does: ``pull = -(gradient + H d + J^T y)`` and ``moved = J d``.
respond = function("conditions_respond")
#: The active set that a solution for ``active`` suggests; returns in how many constraints they differ.
better_signs = function("conditions_better_signs")
#: ``grad f + J^T y``.
gradient_of_lagrangian = function("conditions_gradient_of_lagrangian")


#: Places in the results of :func:`point_conditions`.
POINT: Final = 3

#: Gradient of the Lagrangian, multipliers of bounds (n,) where ``balanced`` is not 0, and the errors.
point_conditions = function("conditions_point_conditions")
#: Diagonals that hold active variables and leave out rows that are not active, nearly: as a barrier's do.
restricted_diagonals = function("conditions_restricted_diagonals")
#: Right-hand side of another step on an active set that a point is on already: it fixes nothing more.
remaining = function("conditions_remaining")
#: The point after a Newton step on the active set, inside the bounds; what that fixes does not move any further.
advance = function("conditions_advance")
