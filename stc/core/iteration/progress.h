/* What is noted of every iterate and step, compiled; progress.h tells what it is for. */
#ifndef STC_PROGRESS_H
#define STC_PROGRESS_H

#include "../native.h"

/* For Drift: the objective and the dual error of the iterate just measured. */
API void progress_note_objective(double *restrict s);

/* For Nearest: the iterate just measured.
 *
 * Returns: 1 where more is to be looked at: the error is small, or anything is large, or nothing moves any more. */
API int64_t progress_note_iterate(int64_t size, int64_t m, int64_t gaps, const double *restrict w,
                                  const double *restrict y, const double *restrict z, double *restrict kept_w,
                                  double *restrict kept_y, double *restrict kept_z, double *restrict s);

/* Whether a point is better than the best so far: violations up to tolerance count as none. */
API int64_t progress_is_better(double objective, double violation, double best_objective, double best_violation,
                               double tolerance);

/* Record the iterate, and keep its variables (n,) and row multipliers (m,) where it is the best so far. */
API void progress_record(int64_t n, int64_t m, const double *restrict w, const double *restrict y,
                         double *restrict best_x, double *restrict best_y, double *restrict rows,
                         double *restrict s);

/* Note the step taken; 1 where steps are too short to go on. */
API int64_t progress_settle(double *restrict s);

/* Measure, record and iterate, s[MOST] times at most, the first of them without the iteration where that is 0.
 *
 * Returns: 0, or LOOK where more is to be thought of before the next iteration, or where that needs help:
 * FACTORIZATION and so on. Where something was raised all of that may be. */
API int64_t progress_repeat(const int64_t *calls, int64_t n, int64_t m, const double *w, const double *y,
                            double *best_x, double *best_y, double *rows, double *s);

#endif
