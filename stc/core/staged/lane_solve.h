/* Substitutions with the factors of lanes.h, eight segments at once, for one vector or for two. */
#ifndef STC_LANE_SOLVE_H
#define STC_LANE_SOLVE_H

#include "../native.h"
#include "../vec8.h"
#include "lane_panel.h"
#include "lane_rows.h"
#include "lane_state.h"
#include "lanes.h"

/* Forward substitution inside a panel. */
ALWAYS_INLINE void lane_solve_forward_corner(int64_t members, const int32_t *restrict kinds,
                                             const int32_t *restrict who, const double *restrict factors,
                                             double *restrict part) {
    int64_t row = 0;
    for (int64_t p = 0; p < members; p++) {
        vec8 y = load8(part, 8 * (int64_t)who[p]);
        for (int64_t q = p + imax(kinds[p], 1); q < members; q++) {
            int64_t to = 8 * (int64_t)who[q];
            store8(part, to, sub_product8(load8(part, to), y, load8(factors, row + 8 * (q - p))));
        }
        row += 8 * (members - p);
    }
}

/* Back substitution inside a panel. */
ALWAYS_INLINE void lane_solve_backward_corner(int64_t members, const int32_t *restrict kinds,
                                              const int32_t *restrict who, const double *restrict factors,
                                              double *restrict part) {
    int64_t row = 4 * members * (members + 1);
    for (int64_t back = 0; back < members; back++) {
        int64_t p = members - 1 - back;
        row -= 8 * (members - p);
        vec8 y = load8(part, 8 * (int64_t)who[p]);
        for (int64_t q = p + imax(kinds[p], 1); q < members; q++)
            y = sub_product8(y, load8(part, 8 * (int64_t)who[q]), load8(factors, row + 8 * (q - p)));
        store8(part, 8 * (int64_t)who[p], y);
    }
}

/* Divide by D. */
ALWAYS_INLINE void lane_solve_divide(int64_t members, const int32_t *restrict kinds, const int32_t *restrict who,
                                     const double *restrict factors, double *restrict part) {
    int64_t p = 0;
    int64_t row = 0;
    while (p < members) {
        vec8 y = load8(part, 8 * (int64_t)who[p]);
        int64_t next_row = row + 8 * (members - p);
        if (kinds[p] == 2) {
            vec8 z = load8(part, 8 * (int64_t)who[p + 1]);
            vec8 mixed = load8(factors, row + 8);
            store8(part, 8 * (int64_t)who[p], add_product8(mul8(y, load8(factors, row)), z, mixed));
            store8(part, 8 * (int64_t)who[p + 1], add_product8(mul8(y, mixed), z, load8(factors, next_row)));
            row = next_row + 8 * (members - p - 1);
            p += 2;
        } else {
            store8(part, 8 * (int64_t)who[p], mul8(y, load8(factors, row)));
            row = next_row;
            p++;
        }
    }
}

/* Forward substitution and division by D for one panel. */
ALWAYS_INLINE void lane_solve_forward_panel(int64_t both, int64_t members, int64_t count,
                                            const int32_t *restrict kinds, const int32_t *restrict who,
                                            const int32_t *restrict rows, const double *restrict factors,
                                            double *restrict part, double *restrict other) {
    lane_solve_forward_corner(members, kinds, who, factors, part);
    if (both != 0) lane_solve_forward_corner(members, kinds, who, factors, other);
    const double *own = factors + 4 * members * (members + 1);
    int64_t p = 0;
    int64_t far = 8 * members;
    if (members == 4) {
        vec8 y0 = load8(part, 8 * (int64_t)who[0]);
        vec8 y1 = load8(part, 8 * (int64_t)who[1]);
        vec8 y2 = load8(part, 8 * (int64_t)who[2]);
        vec8 y3 = load8(part, 8 * (int64_t)who[3]);
        vec8 z0 = load8(other, 8 * (int64_t)who[0]);
        vec8 z1 = load8(other, 8 * (int64_t)who[1]);
        vec8 z2 = load8(other, 8 * (int64_t)who[2]);
        vec8 z3 = load8(other, 8 * (int64_t)who[3]);
        for (int64_t e = 0; e < count; e++) {
            int64_t to = 8 * (int64_t)rows[e];
            int64_t at = 32 * e;
            vec8 f0 = load8(own, at);
            vec8 f1 = load8(own, at + 8);
            vec8 f2 = load8(own, at + 16);
            vec8 f3 = load8(own, at + 24);
            store8(part, to,
                   sub_product8(sub_product8(sub_product8(sub_product8(load8(part, to), y0, f0), y1, f1), y2, f2),
                                y3, f3));
            if (both != 0) {
                store8(
                    other, to,
                    sub_product8(sub_product8(sub_product8(sub_product8(load8(other, to), z0, f0), z1, f1), z2, f2),
                                 z3, f3));
            }
        }
        p = 4;
    }
    while (p < members) {
        vec8 y = load8(part, 8 * (int64_t)who[p]);
        vec8 z = load8(other, 8 * (int64_t)who[p]);
        for (int64_t e = 0; e < count; e++) {
            int64_t to = 8 * (int64_t)rows[e];
            vec8 f = load8(own, e * far + 8 * p);
            store8(part, to, sub_product8(load8(part, to), y, f));
            if (both != 0) store8(other, to, sub_product8(load8(other, to), z, f));
        }
        p++;
    }
    lane_solve_divide(members, kinds, who, factors, part);
    if (both != 0) lane_solve_divide(members, kinds, who, factors, other);
}

/* Back substitution for one panel. */
ALWAYS_INLINE void lane_solve_backward_panel(int64_t both, int64_t members, int64_t count,
                                             const int32_t *restrict kinds, const int32_t *restrict who,
                                             const int32_t *restrict rows, const double *restrict factors,
                                             double *restrict part, double *restrict other) {
    const double *own = factors + 4 * members * (members + 1);
    int64_t far = 8 * members;
    int64_t done = 0;
    if (members == 4) {
        vec8 y0 = load8(part, 8 * (int64_t)who[0]);
        vec8 y1 = load8(part, 8 * (int64_t)who[1]);
        vec8 y2 = load8(part, 8 * (int64_t)who[2]);
        vec8 y3 = load8(part, 8 * (int64_t)who[3]);
        vec8 z0 = load8(other, 8 * (int64_t)who[0]);
        vec8 z1 = load8(other, 8 * (int64_t)who[1]);
        vec8 z2 = load8(other, 8 * (int64_t)who[2]);
        vec8 z3 = load8(other, 8 * (int64_t)who[3]);
        for (int64_t e = 0; e < count; e++) {
            int64_t at = 32 * e;
            vec8 f0 = load8(own, at);
            vec8 f1 = load8(own, at + 8);
            vec8 f2 = load8(own, at + 16);
            vec8 f3 = load8(own, at + 24);
            vec8 value = load8(part, 8 * (int64_t)rows[e]);
            y0 = sub_product8(y0, value, f0);
            y1 = sub_product8(y1, value, f1);
            y2 = sub_product8(y2, value, f2);
            y3 = sub_product8(y3, value, f3);
            if (both != 0) {
                value = load8(other, 8 * (int64_t)rows[e]);
                z0 = sub_product8(z0, value, f0);
                z1 = sub_product8(z1, value, f1);
                z2 = sub_product8(z2, value, f2);
                z3 = sub_product8(z3, value, f3);
            }
        }
        store8(part, 8 * (int64_t)who[0], y0);
        store8(part, 8 * (int64_t)who[1], y1);
        store8(part, 8 * (int64_t)who[2], y2);
        store8(part, 8 * (int64_t)who[3], y3);
        if (both != 0) {
            store8(other, 8 * (int64_t)who[0], z0);
            store8(other, 8 * (int64_t)who[1], z1);
            store8(other, 8 * (int64_t)who[2], z2);
            store8(other, 8 * (int64_t)who[3], z3);
        }
        done = 4;
    }
    while (done < members) {
        vec8 y = load8(part, 8 * (int64_t)who[done]);
        vec8 z = load8(other, 8 * (int64_t)who[done]);
        for (int64_t e = 0; e < count; e++) {
            vec8 f = load8(own, e * far + 8 * done);
            y = sub_product8(y, load8(part, 8 * (int64_t)rows[e]), f);
            if (both != 0) z = sub_product8(z, load8(other, 8 * (int64_t)rows[e]), f);
        }
        store8(part, 8 * (int64_t)who[done], y);
        if (both != 0) store8(other, 8 * (int64_t)who[done], z);
        done++;
    }
    lane_solve_backward_corner(members, kinds, who, factors, part);
    if (both != 0) lane_solve_backward_corner(members, kinds, who, factors, other);
}

/* Move the solution for a step's F, which is what has just been found for the next step's U, to its place. */
ALWAYS_INLINE void lane_solve_carry_back(int64_t back, int64_t step, const int64_t *restrict group,
                                         const int32_t *restrict index, const int32_t *restrict code,
                                         const double *restrict y, double *restrict part) {
    if (back > 0) {
        int64_t own = group[OWN];
        const int32_t *following = code + group[FOLLOWING];
        for (int64_t k = 0; k < group[LANES_NEXT]; k++)
            store8(part, 8 * (own + k), load8(part, 8 * (int64_t)following[k]));
    } else {
        lanes_collect_following(step, group, index, code, y, part);
    }
}

/* Forward substitution and division by D from x to y; what is left for others is added to left.
 *
 * both: 1 to do the same from other_x to other_y and other_left in the same pass; a constant.
 * distance: how far ahead memory is asked for, which is written past the caches then; 0 where it is near.
 * groups, table, index, code, factors: see eliminate.
 * part: work space, for two vectors when both. */
ALWAYS_INLINE void lane_solve_forward(int64_t both, int64_t distance, int64_t groups, const int64_t *restrict table,
                                      const int32_t *restrict index, const int32_t *restrict code,
                                      const double *restrict factors, const double *restrict x, double *restrict y,
                                      double *restrict left, const double *restrict other_x,
                                      double *restrict other_y, double *restrict other_left,
                                      double *restrict part) {
    for (int64_t g = 0; g < groups; g++) {
        const int64_t *group = table + g * LANES_FIELDS;
        int64_t own = group[OWN];
        int64_t size = own + group[LANES_NEXT] + group[LEFT] + group[LANES_BORDER];
        double *other = part + 8 * size;
        int64_t at = 8 * group[LANES_FACTORS];
        for (int64_t k = own; k < size; k++) {
            store8(part, 8 * k, splat8(0.0));
            if (both != 0) store8(other, 8 * k, splat8(0.0));
        }
        for (int64_t step = 0; step < group[LANES_STEPS]; step++) {
            int64_t here = group[UNKNOWNS] + 8 * step * own;
            lane_state_ask_ahead(distance, own, 8, here, x);
            lanes_collect_own(step, group, x, part);
            if (both != 0) {
                lane_state_ask_ahead(distance, own, 8, here, other_x);
                lanes_collect_own(step, group, other_x, other);
            }
            if (step > 0) {
                lane_rows_add_following(group, code, part);
                if (both != 0) lane_rows_add_following(group, code, other);
            }
            const int32_t *panel = code + group[PANEL_CODE];
            for (int64_t panel_ = 0; panel_ < group[LANES_PANELS]; panel_++) {
                int64_t members = panel[0];
                int64_t count = panel[1];
                const int32_t *rows = panel + 2 + 2 * members;
                lane_state_ask_ahead(distance, lane_panel_panel_vectors(members, count), 8, at, factors);
                lane_solve_forward_panel(both, members, count, panel + 2, panel + 2 + members, rows, factors + at,
                                         part, other);
                panel = rows + count + members * (members + count);
                at += 8 * lane_panel_panel_vectors(members, count);
            }
            lane_state_put_vectors(distance, own, part, here, y);
            if (both != 0) lane_state_put_vectors(distance, own, other, here, other_y);
        }
        lane_rows_add_outside(group, index, part, left);
        if (both != 0) lane_rows_add_outside(group, index, other, other_left);
    }
}

/* Back substitution from x to y, in which the solution outside the segments is; arguments as above. */
ALWAYS_INLINE void lane_solve_backward(int64_t both, int64_t distance, int64_t groups,
                                       const int64_t *restrict table, const int32_t *restrict index,
                                       const int32_t *restrict code, const double *restrict factors,
                                       const double *restrict x, double *restrict y, const double *restrict other_x,
                                       double *restrict other_y, double *restrict part) {
    for (int64_t g = 0; g < groups; g++) {
        const int64_t *group = table + g * LANES_FIELDS;
        int64_t own = group[OWN];
        double *other = part + 8 * (own + group[LANES_NEXT] + group[LEFT] + group[LANES_BORDER]);
        lanes_collect_ends(group, index, y, part);
        if (both != 0) lanes_collect_ends(group, index, other_y, other);
        const int32_t *starts = code + group[PANEL_STARTS];
        int64_t at = 8 * (group[LANES_FACTORS] + group[LANES_STEPS] * group[FACTOR_STEP]);
        for (int64_t back = 0; back < group[LANES_STEPS]; back++) {
            int64_t step = group[LANES_STEPS] - 1 - back;
            int64_t here = group[UNKNOWNS] + 8 * step * own;
            lane_state_ask_behind(distance, own, here, x);
            lane_solve_carry_back(back, step, group, index, code, y, part);
            lanes_collect_own(step, group, x, part);
            if (both != 0) {
                lane_state_ask_behind(distance, own, here, other_x);
                lane_solve_carry_back(back, step, group, index, code, other_y, other);
                lanes_collect_own(step, group, other_x, other);
            }
            for (int64_t last = 0; last < group[LANES_PANELS]; last++) {
                const int32_t *panel = code + starts[group[LANES_PANELS] - 1 - last];
                int64_t members = panel[0];
                int64_t count = panel[1];
                at -= 8 * lane_panel_panel_vectors(members, count);
                lane_state_ask_behind(distance, lane_panel_panel_vectors(members, count), at, factors);
                lane_solve_backward_panel(both, members, count, panel + 2, panel + 2 + members,
                                          panel + 2 + 2 * members, factors + at, part, other);
            }
            lane_state_put_vectors(distance, own, part, here, y);
            if (both != 0) lane_state_put_vectors(distance, own, other, here, other_y);
        }
    }
}

#endif
