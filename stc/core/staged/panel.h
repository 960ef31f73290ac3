/* A panel: the columns of several pivots out of the window at once, and one update of the window by all of them. */
#ifndef STC_PANEL_H
#define STC_PANEL_H

#include "../native.h"

/* Added to the number of those eliminated when the order was not as planned. */
enum {
    PANEL_CHANGED = 1000,
};
/* Room for members of a group. */
enum {
    LARGEST_GROUP = 32,
};

/* Eliminate the positions who (members,), whose columns have their entries at rows.
 *
 * kinds: 1 or 2 where a planned pivot begins, (planned,): of the first of the members.
 * slots: work space, (members,); panel, lower: the same, (members * padded length,); rise: the
 *     same, (padded length,); sums: the same, (8 * padded length,).
 * masks: see MASKS.
 * Returns:
 *     How many could be eliminated, CHANGED more when not in the planned order; -1 when the factors are full. */
int64_t panel_take_group(int64_t planned, int64_t members, const int32_t *restrict who, int64_t count,
                         const int32_t *restrict rows, const int32_t *restrict kinds, int64_t stage,
                         double threshold, double tiny, int64_t capacity, int64_t stride, double *restrict window,
                         int32_t *restrict slot, const int32_t *restrict owner, double *restrict growth,
                         int32_t *restrict slots, double *restrict panel, double *restrict lower,
                         double *restrict rise, double *restrict sums, const double *restrict masks,
                         int32_t *restrict pivots, int32_t *restrict starts, int32_t *restrict indices,
                         double *restrict factors, double *restrict inverse, int64_t *restrict counts);

#endif
