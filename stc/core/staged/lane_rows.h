/* Passes over the entries of the matrix, eight segments at once: largest entries of its rows, products with vectors. */
#ifndef STC_LANE_ROWS_H
#define STC_LANE_ROWS_H

#include "../native.h"
#include "../vec8.h"
#include "lane_state.h"
#include "lanes.h"

/* Largest entry of each row of S K S in the segments; most has those outside as far as they are known.
 *
 * fetched: 1 where entries are asked for ahead.
 * groups, table, index, code: see eliminate.
 * diagonal: that of the matrix, (N,).
 * scales, part: work space. */
void lane_rows_largest_in_segments(int64_t fetched, int64_t groups, const int64_t *restrict table,
                                   const int32_t *restrict index, const int32_t *restrict code,
                                   const double *restrict given, const double *restrict diagonal,
                                   const double *restrict scale, double *restrict most, double *restrict scales,
                                   double *restrict part);

/* Move what a step has left for F to the next step's U. */
ALWAYS_INLINE void lane_rows_add_following(const int64_t *restrict group, const int32_t *restrict code,
                                           double *restrict part) {
    int64_t own = group[OWN];
    const int32_t *following = code + group[FOLLOWING];
    for (int64_t k = 0; k < group[LANES_NEXT]; k++) {
        int64_t to = 8 * (int64_t)following[k];
        store8(part, to, add8(load8(part, to), load8(part, 8 * (own + k))));
        store8(part, 8 * (own + k), splat8(0.0));
    }
}

/* Add what the segments have left for the last F, L and B to a vector. */
ALWAYS_INLINE void lane_rows_add_outside(const int64_t *restrict group, const int32_t *restrict index,
                                         const double *restrict part, double *restrict x) {
    int64_t own = group[OWN];
    const int32_t *outside = index + group[LASTS];
    for (int64_t lane = 0; lane < group[SEGMENTS]; lane++)
        for (int64_t k = 0; k < group[LANES_NEXT] + group[LEFT] + group[LANES_BORDER]; k++)
            x[outside[8 * k + lane]] += part[8 * (own + k) + lane];
}

/* Subtract the products of entries from both of their rows. */
ALWAYS_INLINE void lane_rows_subtract(int64_t both, int64_t distance, int64_t count, const int32_t *restrict places,
                                      const double *restrict matrix, const double *restrict x, double *restrict y,
                                      const double *restrict other_x, double *restrict other_y) {
    int64_t i = 0;
    vec8 x_i = load8(x, 0);
    vec8 y_i = load8(y, 0);
    vec8 other_x_i = load8(other_x, 0);
    vec8 other_y_i = load8(other_y, 0);
    for (int64_t k = 0; k < count; k++) {
        if (8 * (int64_t)places[3 * k + 1] != i) {
            store8(y, i, y_i);
            if (both != 0) store8(other_y, i, other_y_i);
            i = 8 * (int64_t)places[3 * k + 1];
            x_i = load8(x, i);
            y_i = load8(y, i);
            if (both != 0) {
                other_x_i = load8(other_x, i);
                other_y_i = load8(other_y, i);
            }
        }
        int64_t j = 8 * (int64_t)places[3 * k + 2];
        vec8 value = load8(matrix, 8 * k);
        lane_state_ask_ahead(distance, 1, 0, 8 * k, matrix);
        y_i = sub_product8(y_i, value, load8(x, j));
        store8(y, j, sub_product8(load8(y, j), value, x_i));
        if (both != 0) {
            other_y_i = sub_product8(other_y_i, value, load8(other_x, j));
            store8(other_y, j, sub_product8(load8(other_y, j), value, other_x_i));
        }
    }
    store8(y, i, y_i);
    if (both != 0) store8(other_y, i, other_y_i);
}

/* z = y - K x for the rows of segments; from other rows, those of left, their entries' part is subtracted.
 *
 * both: 1 to do the same with other_x, other_y, other_z in the same pass; a constant.
 * distance: how far ahead memory is asked for, which is written past the caches then; 0 where it is near.
 * groups, table, index, code, matrix: see eliminate.
 * work, part: work space, for two vectors each when both.
 * norms: largest magnitudes in segments of x, z, other_x, other_z; of the z nan when not all are finite. */
ALWAYS_INLINE void lane_rows_subtract_segments(
    int64_t both, int64_t distance, int64_t groups, const int64_t *restrict table, const int32_t *restrict index,
    const int32_t *restrict code, const double *restrict matrix, const double *restrict x, const double *restrict y,
    double *restrict z, double *restrict left, const double *restrict other_x, const double *restrict other_y,
    double *restrict other_z, double *restrict other_left, double *restrict work, double *restrict part,
    double *restrict norms) {
    vec8 high_x = splat8(0.0);
    vec8 high_z = splat8(0.0);
    vec8 high_other_x = splat8(0.0);
    vec8 high_other_z = splat8(0.0);
    vec8 check = splat8(0.0);
    vec8 other_check = splat8(0.0);
    for (int64_t g = 0; g < groups; g++) {
        const int64_t *group = table + g * LANES_FIELDS;
        int64_t own = group[OWN];
        int64_t near = own + group[LANES_NEXT];
        int64_t size = near + group[LEFT] + group[LANES_BORDER];
        double *other_work = work + 8 * size;
        double *other_part = part + 8 * size;
        const double *values = matrix + 8 * group[LANES_MATRIX];
        lanes_collect_ends(group, index, x, work);
        for (int64_t k = own; k < size; k++) store8(part, 8 * k, splat8(0.0));
        if (both != 0) {
            lanes_collect_ends(group, index, other_x, other_work);
            for (int64_t k = own; k < size; k++) store8(other_part, 8 * k, splat8(0.0));
        }
        for (int64_t step = 0; step < group[LANES_STEPS]; step++) {
            int64_t here = group[UNKNOWNS] + 8 * step * own;
            lane_state_ask_ahead(distance, own, 8, here, x);
            lane_state_ask_ahead(distance, own, 8, here, y);
            lanes_collect_following(step, group, index, code, x, work);
            const double *diagonal = values + 0;
            if (step == 0) diagonal = values + 8 * group[LANES_FIRST];
            for (int64_t k = 0; k < own; k++) {
                vec8 value = load8(x, here + 8 * k);
                high_x = max8(high_x, abs8(value));
                store8(work, 8 * k, value);
                store8(part, 8 * k, sub_product8(load8(y, here + 8 * k), load8(diagonal, 8 * k), value));
            }
            if (both != 0) {
                lane_state_ask_ahead(distance, own, 8, here, other_x);
                lane_state_ask_ahead(distance, own, 8, here, other_y);
                lanes_collect_following(step, group, index, code, other_x, other_work);
                for (int64_t k = 0; k < own; k++) {
                    vec8 value = load8(other_x, here + 8 * k);
                    high_other_x = max8(high_other_x, abs8(value));
                    store8(other_work, 8 * k, value);
                    store8(other_part, 8 * k,
                           sub_product8(load8(other_y, here + 8 * k), load8(diagonal, 8 * k), value));
                }
            }
            if (step > 0) {
                lane_rows_add_following(group, code, part);
                if (both != 0) lane_rows_add_following(group, code, other_part);
            } else {
                lane_rows_subtract(both, distance, group[LANES_FIRST], code + group[FIRST_CODE], values, work, part,
                                   other_work, other_part);
            }
            values = diagonal + 8 * own;
            lane_rows_subtract(both, distance, group[LANES_ENTRIES], code + group[ENTRY_CODE], values, work, part,
                               other_work, other_part);
            values = values + 8 * group[LANES_ENTRIES];
            for (int64_t k = 0; k < own; k++) {
                vec8 value = load8(part, 8 * k);
                high_z = max8(high_z, abs8(value));
                check = add_scaled8(check, 0.0, value);
                if (distance > 0)
                    stream8(z, here + 8 * k, value);
                else
                    store8(z, here + 8 * k, value);
                if (both != 0) {
                    value = load8(other_part, 8 * k);
                    high_other_z = max8(high_other_z, abs8(value));
                    other_check = add_scaled8(other_check, 0.0, value);
                    if (distance > 0)
                        stream8(other_z, here + 8 * k, value);
                    else
                        store8(other_z, here + 8 * k, value);
                }
            }
        }
        lane_rows_add_outside(group, index, part, left);
        if (both != 0) lane_rows_add_outside(group, index, other_part, other_left);
    }
    norms[0] = largest8(high_x);
    norms[1] = largest8(high_z) + sum8(check);
    norms[2] = largest8(high_other_x);
    norms[3] = largest8(high_other_z) + sum8(other_check);
}

#endif
