/* Places in a workspace's array of numbers, and in its table of calls.
 *
 * What compiled functions of the iteration know of one another is in one array: they find it by these places, and so does
 * whoever looks on from Python. */
#ifndef STC_STATE_H
#define STC_STATE_H

#include "../native.h"

/* A KKT error that may count as solved where rounding errors allow no better. */
#define ACCEPTABLE 1e-06
/* Of the iterate, and of the step and the point tried last. */
enum {
    OBJECTIVE = 0, /* f, |c|_1 and the sum of the gaps' logarithms at the iterate */
    THETA = 1,
    LOGARITHMS = 2,
    DUAL = 3, /* the iterate's errors, not scaled */
    PRIMAL = 4,
    COMPLEMENTARITY = 5,
    Z_SUM = 6,
    Y_SUM = 7,
    PRODUCTS = 8, /* sum of gap times multiplier */
    DUAL_SQUARED = 9,
    PRIMAL_SQUARED = 10,
    FARTHEST = 11, /* largest |w| */
    SIGMA = 12, /* the centring parameter found best */
    PRIMAL_STEP = 13, /* fractions of the step that the bounds allow */
    DUAL_STEP = 14,
    SLOPE = 15, /* of f, and of the sum of logarithms */
    LOG_SLOPE = 16,
    LENGTH = 17, /* of the variables' part of the step */
    RELATIVE = 18, /* largest |dw| / (1 + |w|) */
    FINITE = 19, /* 0 where all of the step is finite, else nan */
    TRIAL_THETA = 20,
    TRIAL_LOGARITHMS = 21,
    TRIAL_GAP = 22, /* the smallest */
    MOVED = 23, /* 1 when the trial point has become the iterate */
    STEP = 24, /* largest relative change of a variable */
    VIOLATION = 25, /* in the user's terms */
    DUAL_ERROR = 26, /* errors over the size of the multipliers, and the largest of all three */
    GAP_ERROR = 27,
    ERROR = 28,
};
/* Of the whole iteration (stc.solver.interior). */
enum {
    LENGTH_TAKEN = 32, /* fraction of the last step that was taken, 0 where none was */
    STEP_TAKEN = 33, /* largest relative change of a variable then */
    TINY = 34, /* 1 when the step was below rounding error */
    STUCK = 35, /* 1 when it was, or was refused */
    ATTENTION = 36, /* the error at which more is to be looked at */
    ENDED_BY = 37, /* why the last factorisation or search could not go on */
    MOST = 38, /* iterations at most in a row */
    MADE = 39, /* and how many iterates were recorded */
};
/* Of those who watch it (progress.h, stc.solver.multipliers). */
enum {
    OBJECTIVE_BEFORE = 40,
    OBJECTIVE_NOW = 41,
    DUAL_BEFORE = 42,
    DUAL_NOW = 43,
    NEAREST_ERROR = 44,
    WAITING = 45,
    TINY_STEPS = 47,
    SMALL_STEPS = 48,
    SHORT_STEPS = 49,
    THETA_BEFORE = 50,
};
/* Of the barrier parameter (barrier_update.c). */
enum {
    MU = 56,
    TAU = 57,
    FREE = 58, /* 1 while the parameter is chosen anew at every iterate */
    ADAPTIVE = 59, /* 1 when it may be */
    CHANGED = 60,
    SMALLEST_MU = 61,
    LARGEST_MU = 62,
    DOUBT = 65, /* the residual at which a solution is not used */
};
/* Of the linear system (stc.solver.newton_system). */
enum {
    SHIFT = 72,
    DUAL_SHIFT = 73,
    LAST_SHIFT = 74,
    STIFFNESS = 75,
    SOFT = 76,
    FAILURES = 79,
    UNTRIED = 80,
    WHOLE = 82,
    EXCESS = 83,
    BENDS = 85,
    TASK = 86,
    EXACT = 87,
    EQUATIONS = 90, /* 1 when there are equality rows */
    BENDS_ALIKE = 91, /* 1 when the objective bends the same everywhere */
    ENDED = 92, /* how the last attempt to factorise did */
    SLOW_STEPS = 93, /* damped ones in a row that were whole */
    SLOW_BEST = 94, /* the smallest dual error of these, and of as many before them */
    SLOW_BEFORE = 95,
};
/* Of the search along a step (line_search.c). */
enum {
    FROM_THETA = 96, /* what the points tried are compared with */
    FROM_PHI = 97,
    FROM_SLOPE = 98,
    LIMIT = 99,
    SHORTEST = 101,
    SMALL_THETA = 104,
    REACH = 106, /* fraction of the step that the bounds allow, be it more than all of it */
    LENGTHENS = 107, /* 1 where more than all of a step may be taken */
};
/* Of the records, in the user's terms (progress.h). */
enum {
    STATED = 112, /* the objective */
    FEASIBILITY = 113, /* the violation that counts as none */
    BEST_OBJECTIVE = 114,
    BEST_VIOLATION = 115,
    BEST_KNOWN = 116,
    BEST_NEW = 117, /* 1 when the best point has changed since it was last asked for */
};
/* Places in a record: of the user's terms, and of the step that led there. */
enum {
    ROW_OBJECTIVE = 0,
    ROW_VIOLATION = 1,
    ROW_ERROR = 2,
    ROW_STEP = 3,
    ROW_LENGTH = 4,
    ROW_MU = 5,
    ROW_SHIFT = 6,
    ROW = 7,
};
/* Prepared calls. */
enum {
    MEASURE = 0,
    DIAGONALS = 1,
    SHIFTED = 2,
    ATTEMPT = 3, /* a factorisation where all goes to plan: 0, else where it ended */
    BEND = 4,
    DAMPED = 5,
    PREDICT = 6,
    COMBINE = 7,
    CENTRE = 8,
    NEWTON = 9,
    LENGTHS = 11,
    TRY_STEP = 12,
    TRY_POINT = 13,
    MOVE = 14,
    RETURN = 15, /* derivatives of the iterate again, as if none had been evaluated since */
    CORRECTION = 16,
    MEASURED = 17, /* of a whole iteration, its two parts */
    ITERATION = 18,
    CALLS = 19,
    RAISED = 2 * CALLS, /* in the cells of the table: 1 when a Python function has raised something */
};
/* What counts as nothing beside 1: shifts of rows and of curvature (Waechter and Biegler 2006, 3.1). */
#define NOTHING 1e-08
/* A violation, or error, below which an iterate is near. */
#define SMALL_VIOLATION 1e-04
/* Of a step, of a violation or of an error: what is nearly whole, and what is clearly less. */
#define HALF 0.5
/* The least fraction of the way to the boundary that a step may take (Waechter and Biegler 2006, table of constants). */
#define SMALLEST_TAU 0.99
#define STATE_FAR 10000000.0
/* An objective below any sensible value. */
#define LOW (-1e+20)

#endif
