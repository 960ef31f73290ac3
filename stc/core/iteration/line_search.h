/* The line search, compiled. */
#ifndef STC_LINE_SEARCH_H
#define STC_LINE_SEARCH_H

#include "../native.h"

/* 1 when no pair dominates the point. */
API int64_t line_search_accepts(const double *restrict filter, double theta, double phi);

/* Forbid points no better than (theta, phi) by a margin. */
API void line_search_add(double *restrict filter, double theta, double phi);

/* Move the iterate along the step by the largest fraction of LIMIT, halved again and again, that will do.
 *
 * Where all of the step will, more than that may be taken (lengthen). dy is the step's;
 * dw and residual are those of the second-order correction.
 *
 * Returns: TAKEN, NOT_TAKEN or CALL_MISSING. */
API int64_t line_search_backtrack(const int64_t *calls, int64_t n, int64_t m, int64_t gaps, const int64_t *index,
                                  const double *sign, const double *w, const double *y, const double *c,
                                  const double *gap, const double *dy, double *trial_w, const double *trial_c,
                                  double *x, const double *f, const double *dw, double *residual, double *alphas,
                                  double *mu, double *shifted, const double *report, double *filter, double *s);

/* Search along the step from the iterate.
 *
 * Returns: As backtrack, or NOT_FINITE; s[ENDED_BY] keeps it. */
API int64_t line_search_search(const int64_t *calls, int64_t n, int64_t m, int64_t gaps, const int64_t *index,
                               const double *sign, const double *w, const double *y, const double *c,
                               const double *gap, const double *dy, double *trial_w, const double *trial_c,
                               double *x, const double *f, const double *dw, double *residual, double *alphas,
                               double *mu, double *shifted, const double *report, double *filter, double *s);

#endif
