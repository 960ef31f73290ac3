"""Places in a workspace's array of numbers, and in its table of calls.

What compiled functions of the iteration know of one another is in one array: they find it by these places, and so does
whoever looks on from Python.
"""

from __future__ import annotations

from typing import Final

# Of the iterate, and of the step and the point tried last.
OBJECTIVE: Final = 0  # f, |c|_1 and the sum of the gaps' logarithms at the iterate
THETA: Final = 1
LOGARITHMS: Final = 2
PRIMAL: Final = 4
PRODUCTS: Final = 8  # sum of gap times multiplier
DUAL_SQUARED: Final = 9
PRIMAL_SQUARED: Final = 10
FARTHEST: Final = 11  # largest |w|
SIGMA: Final = 12  # the centring parameter found best
PRIMAL_STEP: Final = 13  # fractions of the step that the bounds allow
DUAL_STEP: Final = 14
SLOPE: Final = 15  # of f, and of the sum of logarithms
LOG_SLOPE: Final = 16
LENGTH: Final = 17  # of the variables' part of the step
FINITE: Final = 19  # 0 where all of the step is finite, else nan
TRIAL_THETA: Final = 20
TRIAL_LOGARITHMS: Final = 21
TRIAL_GAP: Final = 22  # the smallest
MOVED: Final = 23  # 1 when the trial point has become the iterate
VIOLATION: Final = 25  # in the user's terms
DUAL_ERROR: Final = 26  # errors over the size of the multipliers, and the largest of all three
GAP_ERROR: Final = 27
ERROR: Final = 28

# Of the whole iteration (stc.solver.interior).
LENGTH_TAKEN: Final = 32  # fraction of the last step that was taken, 0 where none was
STEP_TAKEN: Final = 33  # largest relative change of a variable then
TINY: Final = 34  # 1 when the step was below rounding error
STUCK: Final = 35  # 1 when it was, or was refused
ATTENTION: Final = 36  # the error at which more is to be looked at
ENDED_BY: Final = 37  # why the last factorisation or search could not go on
MOST: Final = 38  # iterations at most in a row
MADE: Final = 39  # and how many iterates were recorded

# Of those who watch it (stc.solver.progress, stc.solver.multipliers).
OBJECTIVE_BEFORE: Final = 40
OBJECTIVE_NOW: Final = 41
DUAL_BEFORE: Final = 42
DUAL_NOW: Final = 43
NEAREST_ERROR: Final = 44
WAITING: Final = 45
TINY_STEPS: Final = 47
SMALL_STEPS: Final = 48
SHORT_STEPS: Final = 49
THETA_BEFORE: Final = 50

# Of the barrier parameter (stc.solver.barrier_update).
MU: Final = 56
TAU: Final = 57
FREE: Final = 58  # 1 while the parameter is chosen anew at every iterate
ADAPTIVE: Final = 59  # 1 when it may be
CHANGED: Final = 60
SMALLEST_MU: Final = 61
LARGEST_MU: Final = 62
DOUBT: Final = 65  # the residual at which a solution is not used

# Of the linear system (stc.solver.newton_system).
SHIFT: Final = 72
DUAL_SHIFT: Final = 73
LAST_SHIFT: Final = 74
STIFFNESS: Final = 75
FAILURES: Final = 79
UNTRIED: Final = 80
WHOLE: Final = 82
EXCESS: Final = 83
BENDS: Final = 85
EXACT: Final = 87
EQUATIONS: Final = 90  # 1 when there are equality rows
BENDS_ALIKE: Final = 91  # 1 when the objective bends the same everywhere
ENDED: Final = 92  # how the last attempt to factorise did
SLOW_STEPS: Final = 93  # damped ones in a row that were whole
SLOW_BEFORE: Final = 95

# Of the search along a step (stc.solver.filter_line_search).
SHORTEST: Final = 101
SMALL_THETA: Final = 104
LENGTHENS: Final = 107  # 1 where more than all of a step may be taken

# Of the records, in the user's terms (stc.solver.progress_kernels).
STATED: Final = 112  # the objective
FEASIBILITY: Final = 113  # the violation that counts as none
BEST_OBJECTIVE: Final = 114
BEST_VIOLATION: Final = 115
BEST_KNOWN: Final = 116
BEST_NEW: Final = 117  # 1 when the best point has changed since it was last asked for

NUMBERS: Final = 120

#: Places in a record: of the user's terms, and of the step that led there.
ROW = 7

# Prepared calls.
MEASURE: Final = 0
DIAGONALS: Final = 1
SHIFTED: Final = 2
ATTEMPT: Final = 3  # a factorisation where all goes to plan: 0, else where it ended
BEND: Final = 4
DAMPED: Final = 5
PREDICT: Final = 6
COMBINE: Final = 7
CENTRE: Final = 8
NEWTON: Final = 9
LENGTHS: Final = 11
TRY_STEP: Final = 12
TRY_POINT: Final = 13
MOVE: Final = 14
RETURN: Final = 15  # derivatives of the iterate again, as if none had been evaluated since
CORRECTION: Final = 16
MEASURED: Final = 17  # of a whole iteration, its two parts
ITERATION: Final = 18
CALLS: Final = 19
