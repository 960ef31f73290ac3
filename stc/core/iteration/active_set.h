/* Points whose optimality is judged, and Newton's method on their active sets (see iteration.h for the barrier method). */
#ifndef STC_ACTIVE_SET_H
#define STC_ACTIVE_SET_H

#include "iteration.h"

/* minimise f(x) subject to row_lower <= r(x) <= row_upper, x_lower <= x <= x_upper: all but the functions. */
typedef API_STRUCT {
    int64_t n, m, jac_entries, hess_entries;
    const int64_t *jac_rows, *jac_cols, *hess_rows, *hess_cols;
    const double *x_lower, *x_upper, *row_lower, *row_upper;
    const double *held, *equality; /* 1 for variables and rows of equal bounds */
} program;

/* A point, its derivatives, and its active set. */
typedef API_STRUCT {
    const program *nlp;
    const int64_t *calls;          /* VALUES, DERIVATIVES and SOLVE, by the numbers in iteration.h */
    const linear_system *kkt;
    double *x, *y, *z;             /* multipliers are positive at an upper bound, negative at a lower one */
    const double *r, *gradient, *jac, *hess;
    const double *values_status, *derivatives_status; /* 0 where all is finite, (1) */
    double *lagrangian;            /* grad f + J^T y */
    double *active_x, *active_rows; /* 1 for variables and rows at a bound, else 0 */
    double *x_target, *row_target; /* that bound */
    double *dx, *dy;               /* the part of the step that the active set fixes */
    double error;                  /* the largest violated condition */
    double largest_curvature;      /* entry of the Hessian */
    double change;                 /* of a variable, the largest in the last step */
    double stationarity, complementarity, violation;
    double largest_gradient, largest_term, largest_multiplier; /* entries; largest terms of J^T y */
    double multipliers;            /* their sum */
} primal_dual;

/* --- Conditions (conditions.c). */

/* The conditions as stated; multipliers of the bounds are chosen where they are not given.  See stc.solver.residuals. */
API void conditions_state(primal_dual *p, int64_t given);
/* The same where z is what makes the Lagrangian stationary for variables that are balanced (n); stationarity and
 * complementarity are one. */
API void conditions_balance(primal_dual *p, const double *balanced);
/* The active set, and the error in projected form; 1 where it is none. */
int64_t conditions_project(primal_dual *p);
/* Matrix and right-hand side of the Newton step on the active set: variables go to their bounds, multipliers of rows
 * that are not active to zero.  The matrix has all entries, whatever is active: diagonals tell that. */
API void conditions_restrict(primal_dual *p);
/* Diagonals that hold active variables and leave out rows that are not active, nearly: as a barrier's do.
 *
 * shift_x, shift_y: of variables and rows; firm: of variables at their bounds. */
API void conditions_restricted_diagonals(primal_dual *p, double shift_x, double shift_y, double firm);
/* What a step does: pull = -(gradient + H d + J^T y) and moved = J d; 0, or nan where it is not finite. */
API double conditions_respond(const primal_dual *p, const double *d, const double *y, double *pull, double *moved);
/* Right-hand side of another step on an active set that the point is on already. */
void conditions_remain(primal_dual *p);
/* The point after a Newton step on the active set, inside the bounds; 0 where it is not finite. */
API int64_t conditions_advance(primal_dual *p, const primal_dual *next);

/* --- Steps (active_set.c). */

/* Evaluate and judge; 1 where something is undefined. */
API int64_t active_set_evaluate(primal_dual *p);
/* Make a Newton step, found already, and make it better with the same factorisation where it has contracted.
 *
 * tolerance: the error to reach.  Returns which point, 1 or 2, is the result; 0 where there is none. */
API int64_t active_set_improve(primal_dual *first, primal_dual *second, double tolerance);

#endif
