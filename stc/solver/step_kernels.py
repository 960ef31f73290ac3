"""The step of an iteration, compiled: right-hand sides, what follows from a solution, and how far it may go.

The method and its code are in ``stc/core/iteration/step.c``.
"""

from __future__ import annotations

from stc.core.functions import function

#: What a shift may add to the curvature of a variable that only the objective bends: so much of what it has, and so
#: much of the shift.
SHARE, SLIGHT = 0.1, 1e-3
#: How much of the rows' part of the Hessian is used where the whole of it makes the matrix indefinite.
ROWS_SHARE = 0.4
#: Gaps that are looked at for one trial after the other, so that they stay at hand.
BLOCK = 512

#: ``ratio = z / gap``, its sum per entry of w, and the diagonals without shifts.
diagonals = function("step_diagonals")
#: The diagonals with the ``shifts`` (n,) of the Hessian and of the equality rows.
shifted = function("step_shifted")
#: The Hessian ``hess`` with a share of the rows' part of it: ``bend`` is the objective's.
damped = function("step_damped")
#: The target of equal products of gaps and multipliers, as large as they are on average.
mean_centre = function("step_mean_centre")
#: ``mu / gap``.
mu_centre = function("step_mu_centre")
#: Of the reduced system, for gaps' multipliers that are to become ``centre``.
right_hand_side = function("step_right_hand_side")
#: Steps of variables, slacks and gap multipliers from the solution of the reduced system.
recover = function("step_recover")
#: How far the bounds let a step go, and how it begins.
lengths = function("step_lengths")
#: ``out = one + factor * other``.
combine = function("step_combine")
#: The centring parameter of those in ``grid`` (count,) whose step is predicted to leave the smallest squared error.
choose_centring = function("step_choose_centring")
#: The system whose solution makes the Lagrangian's gradient smallest.
least_squares = function("step_least_squares")
