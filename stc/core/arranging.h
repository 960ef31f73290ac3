/* Which stages of a horizon are alike. */
#ifndef STC_ARRANGING_H
#define STC_ARRANGING_H

#include "native.h"

/* Stable order of keys below count, and where the run of each begins, (count + 1,), zeros at first. */
API void arranging_counting_sort(int64_t size, const int32_t *restrict keys, int64_t count,
                                 int32_t *restrict pointers, int32_t *restrict order);

/* Mark, of each two unknowns that are more than a stage apart, the one with more such couplings.
 *
 * Others are marked in ahead and behind where they couple with one of the next stage or of that before. */
API void arranging_flag_border(int64_t count, const int32_t *restrict first, const int32_t *restrict second,
                               const int32_t *restrict stage, int32_t *restrict far, int32_t *restrict flagged,
                               int32_t *restrict ahead, int32_t *restrict behind);

/* Stage and code of each coupling: the earlier stage, and what is the same for all stages of a kind.
 *
 * sums are two scrambled sums of the codes for each stage. */
API void arranging_codes(int64_t count, const int32_t *restrict first, const int32_t *restrict second,
                         const int32_t *restrict stage, const int32_t *restrict local,
                         const int32_t *restrict border, int64_t base, int32_t *restrict edge_stage,
                         int64_t *restrict edge_code, int64_t *restrict sums);

/* The same for what concerns variables alone. */
API void arranging_own_codes(int64_t kind, int64_t count, const int32_t *restrict variable,
                             const int32_t *restrict stage, const int32_t *restrict local, int64_t base,
                             int64_t *restrict sums);

#endif
