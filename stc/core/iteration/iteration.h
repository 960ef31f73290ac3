/* One iteration of the barrier method: what it works on, and its stages.  Read this header first.
 *
 *     minimise f(x)   subject to   r(x) - s = 0,   w = (x, s),   gap = sign * (w[index] - bound) >= 0
 *
 * The Lagrangian is f + y.(r - s) - z.gap.  Names are those of J. Nocedal and S. J. Wright, Numerical Optimization, 2006,
 * chapter 19.  Python allocates all arrays and fills the structures once (stc/solver/workspace.py); sizes in brackets.
 *
 * A stage returns 0, or why Python has to go on from there. */
#ifndef STC_ITERATION_H
#define STC_ITERATION_H

#include "../native.h"

/* What counts as nothing beside 1: shifts of rows and of curvature (Waechter and Biegler 2006, 3.1). */
#define NOTHING 1e-08
/* A KKT error that may count as solved where rounding errors allow no better. */
#define ACCEPTABLE 1e-06
/* A violation, or error, below which an iterate is near. */
#define SMALL_VIOLATION 1e-04
/* Of a step, of a violation or of an error: what is nearly whole, and what is clearly less. */
#define HALF 0.5
/* The least fraction of the way to the boundary that a step may take (Waechter and Biegler 2006, table of constants). */
#define SMALLEST_TAU 0.99
#define EPSILON 0x1.0000000000000p-52

/* Kinds of rows. */
enum { EQUALITY = 0, INEQUALITY = 1, IGNORED = 2 };

/* Sizes, bounds and sparsity of a problem. */
typedef API_STRUCT {
    int64_t n, m, size, gaps;           /* variables, rows, n + m, bounds of w */
    int64_t jac_entries, hess_entries;  /* of J, and of the lower triangle of H */
    int64_t slack_entries;              /* of J in rows that have a slack */
    int64_t diagonal_entries;           /* of H on its diagonal */
    int64_t convex_entries;             /* of these, those whose curvature is the objective's alone */
    int64_t moving_entries;             /* of w that the iteration changes, at least 1 */
    int64_t many_gaps, any_equality;    /* 0 or 1 */
    double objective_unit;              /* the objective that is 1 in the user's terms */
    const int64_t *index;               /* of each gap, (gaps) */
    const double *sign, *bound;
    const double *lower, *upper;        /* of w, (size), infinite where there is none */
    const int32_t *kind;                /* of rows, (m) */
    const double *free, *moving;        /* 1 for variables (n), and entries of w (size), that may change */
    const double *extra_diagonal;       /* of H, (n) */
    const int64_t *jac_rows, *jac_cols, *hess_rows, *hess_cols;
    const int32_t *column_start;        /* entries of J by columns: where each begins, (n + 1), */
    const int32_t *column_entry, *column_row;
    const int64_t *slack_entry, *diagonal_entry, *convex_entry, *convex_variable;
} formulation;

/* Where functions are evaluated: the calls VALUES and DERIVATIVES read x and y and write the others. */
typedef API_STRUCT {
    double *x, *y, *f, *r, *gradient, *jac, *hess;
    double *values_status, *derivatives_status; /* 0 where all are finite, (1) */
} evaluation;

/* The arrays of a KKT system: see KKTSystem in stc/solver/kkt/contract.py. */
typedef API_STRUCT {
    double *hess, *jac, *primal, *dual, *rhs, *second_rhs, *solution, *second_solution;
    const double *report;
    double *accuracy;
    const int64_t *inertia;
} linear_system;

/* A point of the iteration. */
typedef API_STRUCT {
    double *w, *y, *z;                  /* variables and slacks; multipliers of rows and of gaps */
    double *r, *gap, *c, *dual;         /* rows, gaps, r - s, and (grad f + J^T y, -y) */
    double f, theta, logarithms;        /* objective, |c|_1, and the sum of the gaps' logarithms */
    double smallest_gap;
} iterate;

typedef API_STRUCT {
    double *dw, *dy, *dz;
} step;

/* Pairs of violation and barrier function that later points must not be dominated by. */
typedef API_STRUCT {
    int64_t count;
    double largest;                     /* violation accepted */
    double *pairs;                      /* (ROOM, 2) */
} filter;

/* Pairs that there is room for; the oldest gives way to one more. */
enum { ROOM = 1000 };

/* What is told of an iterate, and of the step that led there. */
typedef API_STRUCT {
    double objective, violation, error, step, length, mu, shift;
} record;

/* All of an iteration. */
typedef API_STRUCT {
    const int64_t *calls;               /* prepared calls by the numbers below */
    const formulation *form;
    const evaluation *at;
    const linear_system *kkt;
    iterate *now, *trial;               /* the iterate, and the point tried */
    iterate *incumbent;                 /* w, y and z of the iterate with the smallest error */
    step *step, *affine, *centring, *correction;
    filter *filter;                     /* of the search along a step */
    filter *accepted;                   /* of iterates while mu is chosen anew at each */

    double *residual;                   /* gradient of the whole Lagrangian, (size) */
    double *sigma, *ratio;              /* z / gap for each entry of w, and each gap */
    double *primal_diagonal, *dual_diagonal; /* without shifts, (n) and (m) */
    double *shifts;                     /* of the Hessian's diagonal in the last factorisation, (n) */
    double *bend;                       /* the objective's part of the Hessian where it was last asked for */
    double *centre;                     /* what gaps' multipliers are to become, (gaps) */
    double *correction_c;               /* residual of rows that a second-order correction removes, (m) */
    double *pull, *turn;                /* scratch, (size) */
    double *scratch;                    /* (2 gaps), also (diagonal_entries) */

    /* Errors of the optimality conditions at the iterate: norms, and over the size of the multipliers. */
    double dual, primal, complementarity;
    double dual_error, gap_error, error;    /* the last one is the largest of all three */
    double products;                    /* sum of gap times multiplier */
    double dual_squared, primal_squared;
    double farthest;                    /* largest |w| */

    /* The barrier parameter. */
    double mu, tau;
    double smallest_mu, largest_mu;
    int64_t free, adaptive;             /* 1 while mu is chosen anew at every iterate; 1 when it may be */
    int64_t changed;
    double centring_parameter;
    double doubt;                       /* the residual at which a solution of a linear system is not used */

    /* Inertia correction. */
    double shift, dual_shift, last_shift, stiffness, soft;
    int64_t failures, untried, exact, bends, task;
    int64_t whole;                      /* 0 where only a share of the rows' part of the Hessian is used */
    int64_t bends_alike;                /* 1 when the objective bends the same everywhere */
    int64_t ended;                      /* how the last attempt to factorise did */
    int64_t slow_steps;                 /* damped ones in a row that were whole */
    double slow_best, slow_before;      /* the smallest dual error of these, and of as many before them */

    /* The step, and the search along it. */
    double alpha;                       /* fraction tried */
    double primal_step, dual_step, reach;   /* fractions that the bounds allow; the last may be above 1 */
    double slope, log_slope;            /* of f, and of the sum of logarithms */
    double length, relative;            /* norm of the variables' part; largest |dw| / (1 + |w|) */
    double finite;                      /* 0 where all of the step is finite, else nan */
    double from_theta, from_phi, from_slope;    /* what points tried are compared with */
    double shortest, small_theta;
    int64_t lengthens;                  /* 1 where more than all of a step may be taken */
    int64_t tiny;                       /* 1 when the step is below rounding error */
    int64_t ended_by;                   /* why the last factorisation or search could not go on */
    double length_taken, step_taken;    /* fraction taken, 0 where none was; largest relative change of a variable */
    int64_t stuck;                      /* 1 when the step was tiny, or was refused */

    /* What is watched and recorded. */
    double objective_now, dual_now;     /* of the iterate measured last */
    int64_t falling;                    /* 1 when the last step reduced the dual error little and the objective much */
    double least_error, attention;      /* the error at which more is to be looked at */
    int64_t waiting, tiny_steps, small_steps, short_steps;
    int64_t waited, stalled;            /* 1: the best error is acceptable, but not improved; nothing moves any more */
    double theta_before;
    int64_t most, made;                 /* iterations at most in a row; how many iterates were recorded */
    double *records;                    /* of struct record */
    double stated, violation;           /* of the iterate, in the user's terms */
    double feasibility;                 /* the violation that counts as none */
    double best_objective, best_violation;
    int64_t best_known, best_new;       /* the latter 1 when the best point has changed since it was last asked for */
    double *best_x, *best_y;
} iteration;

/* Prepared calls: of the functions; of what is in the user's terms; of the linear system. */
enum {
    VALUES = 0,
    DERIVATIVES = 1,
    WATCH = 2,
    ATTEMPT = 3, /* a factorisation where all goes to plan: 0, else where it ended */
    SOLVE = 4,
    SOLVE_BOTH = 5,
    RAISED = 12, /* in the cells of the table: 1 when a Python function has raised something */
};

/* Where an iteration may need Python. */
enum {
    LOOK = 1,          /* before the next one there is more to be thought of */
    FACTORIZATION = 3, /* somebody else has to factorise, or there is no shift */
    STEP_FOUND = 4,
    SEARCH = 5,
    BLOCKED = 6,
};

/* --- Points (points.c). */

/* Sum of the logarithms of positive numbers, nan when one is not. */
API double point_log_sum(int64_t count, const double *values);
/* What dual errors are divided by where multipliers are large, given the sum of their magnitudes. */
API double point_multiplier_scale(double total, int64_t count);
/* Largest (limit - value) * unit of rows and variables, at least 0; infinite where a row is no number. */
API void point_overstepped(int64_t row_count, const int64_t *row_places, const double *row_limits,
                           const double *row_units, const double *r, int64_t x_count, const int64_t *x_places,
                           const double *x_limits, const double *x_units, const double *x, double *out);
API void point_copy(int64_t count, const double *source, double *target);
/* Move w inside its bounds by push, relative to the bound's size or the bounds' distance. */
API void point_push_inside(const formulation *form, double push, double *w);
/* Everything at w, y and z of the iterate; functions may be undefined there. */
API void point_evaluate(iteration *it);
/* Errors of the optimality conditions of the barrier problem with parameter mu; residual. */
API void point_measure(iteration *it, double mu);
/* Evaluate the rows at the trial point, or at a fraction alpha of the step. */
void point_try(iteration *it);
API void point_try_step(iteration *it, double alpha);
/* Make the trial point, a fraction alpha of the step, the iterate; 0 where a derivative is undefined there. */
API int64_t point_move(iteration *it);

/* --- Steps (step.c). */

/* The diagonals without shifts, and the other values of the matrix. */
API void step_diagonals(iteration *it);
/* The diagonals with shifts of the Hessian and of the equality rows. */
API void step_shifted(iteration *it);
/* The objective's part of the Hessian, and a matrix with only a share of the rows' part. */
void step_bend(iteration *it);
void step_damp(iteration *it);
/* The system whose solution makes the Lagrangian's gradient smallest. */
API void step_least_squares(iteration *it);
/* Newton's step with the factorised system, towards mu. */
API void step_newton(iteration *it);
/* The second-order correction: the step towards mu that removes the residual correction_c of the rows. */
void step_correct(iteration *it);
/* The affine and the centring step, and the centring parameter that suits them. */
API void step_predict(iteration *it);
API void step_choose_centring(iteration *it);
/* step = affine + factor * centring. */
void step_combine(iteration *it, double factor);
/* How far the bounds let the step go, and how it begins. */
API void step_lengths(iteration *it);

/* --- Inertia correction (inertia_correction.c). */

/* Why a factorisation ended: done, or somebody else has to factorise, or no shift is enough. */
enum { DONE = 0, REFACTOR = 1, NO_SHIFT = 3 };

/* The median of the magnitudes that are not zero, 0 where all are; of two, the larger one.  Reorders values. */
API double inertia_correction_median_magnitude(int64_t count, double *values);
/* Prepare the factorisation at an iterate; factorize does it. */
API void inertia_correction_begin(iteration *it);
/* The next shift to try, after another one or the last iterate's; more than LARGEST_SHIFT where there is none. */
API double inertia_correction_larger_shift(iteration *it);
API int64_t inertia_correction_factorize(iteration *it);
/* Let the stiffness go where a step is accepted nearly whole, and where none is. */
void inertia_correction_relax(iteration *it);

/* --- The barrier parameter (barrier_update.c). */

/* Decide the mode for the iterate, just measured, and, in the held mode, the parameter. */
API void barrier_update_update(iteration *it);
/* Find the step with the factorised system; chooses mu first in the free mode.  1 where its residual is doubtful. */
API int64_t barrier_update_find_step(iteration *it);

/* --- The line search (line_search.c). */

/* How a search may end. */
enum { TAKEN = 0, NOT_TAKEN = 1, NOT_FINITE = 3 };

/* 1 when no pair dominates the point. */
API int64_t line_search_accepts(const filter *f, double theta, double phi);
/* Forbid points no better than (theta, phi) by a margin. */
API void line_search_add(filter *f, double theta, double phi);
/* Search along the step from the iterate. */
API int64_t line_search_search(iteration *it);

/* --- Iterations (progress.c). */

/* Whether a point is better than the best so far: violations up to tolerance count as none. */
API int64_t progress_is_better(double objective, double violation, double best_objective, double best_violation,
                               double tolerance);
/* Measure and note the iterate; 1 where more is to be looked at: the error is small, or anything is large, or nothing
 * moves any more. */
API int64_t progress_measure(iteration *it);
/* Note the step taken; 1 where steps are too short to go on. */
API int64_t progress_settle(iteration *it);
/* What comes after the factorisation. */
API int64_t progress_advance(iteration *it);
API int64_t progress_iterate(iteration *it);
/* Measure, record and iterate, `most` times at most, the first of them without the iteration where that is 0.
 *
 * Where something was raised (RAISED) the result says nothing. */
API int64_t progress_repeat(iteration *it);

#endif
