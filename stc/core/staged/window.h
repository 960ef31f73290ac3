/* The dense window of the elimination: reading a column, taking a pivot out. */
#ifndef STC_WINDOW_H
#define STC_WINDOW_H

#include "../native.h"

/* List the nonzeros of a column among the slots below top and from low to high; their number. */
API int64_t window_gather(int64_t slot, int64_t top, int64_t low, int64_t high, int64_t stride,
                          const double *restrict window, int32_t *restrict found, double *restrict values);

/* Values of a column at the listed slots (the column's own is not among them). */
API void window_gather_listed(int64_t slot, int64_t count, const int32_t *restrict listed, int64_t stride,
                              const double *restrict window, double *restrict values);

/* Largest magnitude of a column. */
API double window_largest(int64_t count, const double *restrict values);

/* Set a column to zero at the listed slots and on the diagonal. */
API void window_clear(int64_t slot, int64_t count, const int32_t *restrict listed, int64_t stride,
                      double *restrict window);

/* Bring two columns to their common list of slots, leaving out one slot of each; its length. */
API int64_t window_merge(int64_t count_1, const int32_t *restrict found_1, const double *restrict values_1,
                         int64_t skip_1, int64_t count_2, const int32_t *restrict found_2,
                         const double *restrict values_2, int64_t skip_2, int32_t *restrict found,
                         double *restrict first, double *restrict second);

/* window -= factors values^T on the listed slots; spread (stride,) is zero before and after. */
API void window_subtract_one(int64_t count, const int32_t *restrict listed, const double *restrict values,
                             const double *restrict factors, int64_t stride, double *restrict spread,
                             double *restrict window);

/* window -= factors_1 first^T + factors_2 second^T on the listed slots.
 *
 * Where the first of a pair is zero its product is left out, which keeps zeros exact. */
API void window_subtract_two(int64_t count, const int32_t *restrict listed, const double *restrict first,
                             const double *restrict second, const double *restrict factors_1,
                             const double *restrict factors_2, int64_t stride, double *restrict spread_1,
                             double *restrict spread_2, double *restrict window);

/* Add those of the waiting unknowns that are coupled with a group to its members; how many it has then. */
int64_t window_adopt(int64_t members, int32_t *restrict who, int64_t waiting, const int32_t *restrict queue,
                     const int32_t *restrict slot, int64_t stride, const double *restrict window);

/* List the planned slots of a group, and those others that members are coupled with; how many there are.
 *
 * The lists given increase, and so does the result. */
int64_t window_list_rows(int64_t members, const int32_t *restrict who, int64_t waiting,
                         const int32_t *restrict queue, const int32_t *restrict slot, int64_t stride,
                         const double *restrict window, int64_t count, const int32_t *restrict listed,
                         int64_t surplus_count, const int32_t *restrict surplus, int32_t *restrict rows);

/* Whether there is none of the entries that are not planned. */
static inline int64_t window_only_planned(int64_t count, const int32_t *restrict rows,
                                          const int32_t *restrict columns, int64_t stride,
                                          const double *restrict window) {
    for (int64_t k = 0; k < count; k++)
        if (window[rows[k] * stride + columns[k]] != 0.0) return 0;
    return 1;
}

#endif
