/* In which order to eliminate the unknowns of one stage, found by eliminating the sizes of its entries. */
#ifndef STC_ORDERING_H
#define STC_ORDERING_H

#include "../native.h"

/* Kinds of unknowns in an order: first of a pivot of one or two, second of two, not eliminated. */
enum {
    ORDERING_SECOND = 0,
};
/* Sizes stay between these, so that what is there never vanishes. */
#define SMALLEST 1e-30

/* Eliminate the slots waiting (count,) from the sizes (top * top,), in place.
 *
 * top: how many slots are in use.
 * margin: the threshold that pivots are planned for.
 * compared: pivots with at most this many times the fewest multiplications are compared by their fill.
 * all_taken: 1 where whoever eliminates takes all pivots in that order, whatever their values: then these count
 *     to the end. Where pivots that turn out weak are taken later, it is better to expect little of that: once
 *     every order costs the same, the sizes stay as they are.
 * order: the slots in the order of their elimination, (count,).
 * kinds: 1 or 2 where a pivot begins, 0 for the second of two, -1 for slots without a pivot: these come
 *     last, and the sizes then are as if they had been eliminated one by one.
 * starts: the column of pivot k is lists[starts[k]:starts[k + 1]]; the second of two has an empty one,
 *     (count + 1,).
 * capacity: length of lists.
 * degree, most, row_p, row_q: work space, (top,); bits: ((top + SETS) * words_of(top),).
 * first, second, costs: work space, (candidates,).
 * Returns:
 *     The number of entries in lists, or -1 when they do not fit. */
API int64_t ordering_order_stage(int64_t top, int64_t count, int32_t *restrict waiting, double margin,
                                 double compared, int64_t all_taken, double *restrict sizes,
                                 int32_t *restrict degree, double *restrict most, int32_t *restrict row_p,
                                 int32_t *restrict row_q, int64_t *restrict bits, int64_t candidates,
                                 int32_t *restrict first, int32_t *restrict second, double *restrict costs,
                                 int32_t *restrict order, int32_t *restrict kinds, int32_t *restrict starts,
                                 int64_t capacity, int32_t *restrict lists);

#endif
