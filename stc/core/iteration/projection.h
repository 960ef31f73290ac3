/* The optimality conditions as a projection equation, evaluated at fixed places in one call. */
#ifndef STC_PROJECTION_H
#define STC_PROJECTION_H

#include "../native.h"

/* 1 where functions are undefined. */
API int64_t projection_undefined(const double *restrict status);

/* The largest violated condition, dual ones over the size of the count multipliers; 1 where it is none.
 *
 * of_x, of_rows: see conditions.project_entries.
 * status: of the derivatives.
 * error: the result. */
API int64_t projection_judge(int64_t count, const double *restrict of_x, const double *restrict of_rows,
                             const double *restrict status, double *restrict error);

/* Make a Newton step, found already, and make it better with the same factorisation where it has contracted.
 *
 * A correction makes a factorisation gain as much as one and a half Newton steps (J. F. Traub, Iterative methods for
 * the solution of equations, 1964, section 8.4).  One is made, and more where that saves another step.
 *
 * calls: those of the pair of points.
 * here: the point where the step begins, 0 or 1.
 * tolerance: the error to reach.
 * active_x, active_rows, errors: of the first point; then those of the other one.
 * largest: becomes the largest change of a variable, and what is 0 where all is finite.
 * Returns:
 *     The place of the point it leads to, counted from 1, or 0 where there is none. */
API int64_t projection_improve(const int64_t *calls, int64_t here, int64_t n, int64_t m, double tolerance,
                               const double *active_x, const double *active_rows, const double *other_active_x,
                               const double *other_active_rows, const double *errors, const double *other_errors,
                               double *largest);

#endif
