/* Choosing between plans for segments in compiled code, as long as old ones will do. */
#ifndef STC_PLAN_CALLS_H
#define STC_PLAN_CALLS_H

#include "../native.h"

/* 1 where another plan may suit better: H has become zero or is so no longer, or it is time to choose.
 *
 * Otherwise the first of all matrices is scaled. */
API int64_t plan_calls_begin(int64_t curved, const int64_t *curvatures, const int64_t *calls, int64_t *tally);

/* The same by the plan for the next matrix, or by another one that is due and suits. */
API int64_t plan_calls_eliminate(const int64_t *calls, int64_t *tally);

/* end_of_plan for the plan of the factors. */
API int64_t plan_calls_end(const int64_t *calls, const int64_t *tally);

/* Solve once: a matrix that is nearly singular has long solutions, inaccurate factors a large residual. */
API int64_t plan_calls_is_accurate(const int64_t *calls, int64_t plan, const double *report, double *state);

/* The inertia found, (3,), of segments and the rest; 1 where the factors are not accurate.
 *
 * rest: the inertia of the rest, which is regular.
 * eliminated: unknowns of the segments.
 * added: pairs of unknowns that were added, which have one eigenvalue of either sign.
 * report: what the plan's probe leaves. */
API int64_t plan_calls_end_of_plan(const int64_t *calls, int64_t plan, const int64_t *rest, int64_t eliminated,
                                   int64_t added, double *state, const double *report, double fine,
                                   int64_t *inertia, double *accuracy, int64_t *tally);

/* Solve with the factors at hand; which is SOLVE or SOLVE_BOTH. */
API void plan_calls_solve(const int64_t *calls, int64_t which, const int64_t *tally);

#endif
