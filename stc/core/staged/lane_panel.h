/* One panel of pivots taken out of eight segments at once (see lanes.h). */
#ifndef STC_LANE_PANEL_H
#define STC_LANE_PANEL_H

#include "../native.h"

/* How many vectors are kept of a panel. */
API int64_t lane_panel_panel_vectors(int64_t members, int64_t count);

/* Take the members out of work.
 *
 * known: KNOWN numbers to work with.
 * factors: room for theirs, where they are kept unless they are streamed to target. */
API void lane_panel_take_panel(int64_t distance, int64_t streamed, int64_t members, int64_t count,
                               const int32_t *restrict kinds, const int32_t *restrict rows,
                               const int32_t *restrict sources, double growth, double suspect,
                               double *restrict work, double *restrict known, double *restrict factors,
                               double *restrict target, double *restrict state);

#endif
