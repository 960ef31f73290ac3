/* Passes over the entries of the matrix, eight segments at once: largest entries of its rows, products with vectors.
 *
 * Both leave to the caller what is outside the segments, entries and diagonal.  Vectors are in the order of the segments. */
#include "../native.h"
#include "../vec8.h"
#include "lane_rows.h"
#include "lanes.h"

/* Note the magnitudes of entries in both of their rows. */
ALWAYS_INLINE void largest(int64_t count, const int32_t *restrict sources, const int32_t *restrict places,
                           const double *restrict given, const double *restrict scales, double *restrict most) {
    int64_t i = 0;
    vec8 scale_i = load8(scales, 0);
    vec8 most_i = load8(most, 0);
    for (int64_t k = 0; k < count; k++) {
        if (8 * (int64_t)places[3 * k + 1] != i) {
            store8(most, i, most_i);
            i = 8 * (int64_t)places[3 * k + 1];
            scale_i = load8(scales, i);
            most_i = load8(most, i);
        }
        int64_t j = 8 * (int64_t)places[3 * k + 2];
        vec8 value = mul8(mul8(abs8(gather8(given, sources, 8 * k)), scale_i), load8(scales, j));
        most_i = max8(value, most_i);
        store8(most, j, max8(value, load8(most, j)));
    }
    store8(most, i, most_i);
}

void lane_rows_largest_in_segments(int64_t fetched, int64_t groups, const int64_t *restrict table,
                                   const int32_t *restrict index, const int32_t *restrict code,
                                   const double *restrict given, const double *restrict diagonal,
                                   const double *restrict scale, double *restrict most, double *restrict scales,
                                   double *restrict part) {
    for (int64_t g = 0; g < groups; g++) {
        const int64_t *group = table + g * LANES_FIELDS;
        int64_t own = group[OWN];
        int64_t near = own + group[LANES_NEXT];
        int64_t ends = group[LEFT] + group[LANES_BORDER];
        const int32_t *following = code + group[FOLLOWING];
        lanes_collect_ends(group, index, scale, scales);
        for (int64_t k = own; k < near + ends; k++) store8(part, 8 * k, splat8(0.0));
        for (int64_t step = 0; step < group[LANES_STEPS]; step++) {
            int64_t here = group[UNKNOWNS] + 8 * step * own;
            if (fetched != 0) lanes_ask_for_step(step, group, index, diagonal, given);
            lanes_collect_own(step, group, scale, scales);
            lanes_collect_following(step, group, index, code, scale, scales);
            for (int64_t k = 0; k < own; k++) {
                vec8 s = load8(scales, 8 * k);
                store8(part, 8 * k, mul8(mul8(abs8(gather8(diagonal, index, here + 8 * k)), s), s));
            }
            if (step > 0) {
                for (int64_t k = 0; k < group[LANES_NEXT]; k++) {
                    int64_t to = 8 * (int64_t)following[k];
                    store8(part, to, max8(load8(part, to), load8(part, 8 * (own + k))));
                    store8(part, 8 * (own + k), splat8(0.0));
                }
            } else {
                largest(group[LANES_FIRST], index + group[FIRST_INDEX], code + group[FIRST_CODE], given, scales,
                        part);
            }
            int64_t count = group[LANES_ENTRIES];
            const int32_t *sources = index + group[ENTRY_INDEX] + 8 * step * count;
            largest(count, sources, code + group[ENTRY_CODE], given, scales, part);
            for (int64_t k = 0; k < own; k++) store8(most, here + 8 * k, load8(part, 8 * k));
        }
        lanes_note_outside(group, index, part, most);
    }
}
