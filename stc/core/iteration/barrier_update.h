/* The barrier parameter, and the step that goes with it, compiled. */
#ifndef STC_BARRIER_UPDATE_H
#define STC_BARRIER_UPDATE_H

#include "../native.h"

/* Decide the mode for the iterate, just measured, and, in the held mode, the parameter.
 *
 * target is the barrier parameter that the iterate is measured with; accepted the filter of the free mode. */
API void barrier_update_update(const int64_t *calls, int64_t gaps, double *target, double *accepted, double *s);

/* Find the step with the factorised system; chooses mu first in the free mode.
 *
 * Returns: 0, or CALL_MISSING, or DOUBTFUL_SOLUTION. */
API int64_t barrier_update_find_step(const int64_t *calls, int64_t gaps, double *mu, double *tau, double *factor,
                                     const double *report, double *s);

#endif
