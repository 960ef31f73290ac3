/* Forward and back substitution through the stages of a chain (see chain_elimination.h). */
#ifndef STC_CHAIN_SUBSTITUTION_H
#define STC_CHAIN_SUBSTITUTION_H

#include "../native.h"
#include "../vec8.h"
#include "chain_elimination.h"
#include "chain_rows.h"
#include "lane_state.h"

/* Blocks with a single 1 are cut out of a row of UNITS numbers that has it here. */
enum {
    ONE = 11,
};

/* The same for two vectors. */
void chain_substitution_backward_both(int64_t checked, int64_t distance, int64_t stages,
                                      const int64_t *restrict table, const int32_t *restrict code, int64_t stride,
                                      const double *restrict units, const double *restrict factors,
                                      const double *restrict matrix, double *restrict work, double *restrict x,
                                      double *restrict other_x, double *restrict z, double *restrict other_z);

/* The opposite of gather_outer. */
ALWAYS_INLINE void chain_substitution_return_outer(const int64_t *restrict stage, const int32_t *restrict code,
                                                   const double *restrict part, double *restrict x) {
    const int32_t *program = code + stage[CODE];
    const int32_t *outer = code + stage[OUTER];
    double *own = x + stage[BASE];
    int64_t border = program[CHAIN_ELIMINATION_BORDER];
    for (int64_t k = 0; k < border; k++) x[code[k]] = part[k];
    for (int64_t k = border; k < program[SIZE] - program[INSIDE]; k++) own[outer[k - border]] = part[k];
}

/* How many vectors the factors of a panel are, the corner's first. */
ALWAYS_INLINE int64_t chain_substitution_vectors_of(const int32_t *restrict panel) {
    int64_t members = panel[0];
    return (members == 4 ? 2 : 1) + members * panel[4];
}

/* L y = x for a panel of four; D^-1 y goes to held. */
ALWAYS_INLINE void chain_substitution_forward_four(const int32_t *restrict panel, const double *restrict factors,
                                                   double *restrict part, double *restrict held) {
    int64_t high = panel[3];
    double y0 = part[high];
    double y1 = part[high - 1] - factors[6] * y0;
    double y2 = part[high - 2] - factors[7] * y0 - factors[9] * y1;
    double y3 = part[high - 3] - factors[8] * y0 - factors[10] * y1 - factors[11] * y2;
    held[high] = factors[0] * y0 + factors[4] * y1;
    held[high - 1] = factors[1] * y1 + factors[4] * y0;
    held[high - 2] = factors[2] * y2 + factors[5] * y3;
    held[high - 3] = factors[3] * y3 + factors[5] * y2;
    const int32_t *columns = panel + 6;
    for (int64_t b = 0; b < panel[4]; b++) {
        int64_t column = columns[2 * b];
        int64_t at = 16 + 32 * b;
        vec8 value =
            sub_scaled8(sub_scaled8(load8(part, column), y0, load8(factors, at)), y1, load8(factors, at + 8));
        store8(part, column,
               sub_scaled8(sub_scaled8(value, y2, load8(factors, at + 16)), y3, load8(factors, at + 24)));
    }
}

/* The same for two. */
ALWAYS_INLINE void chain_substitution_forward_two(const int32_t *restrict panel, const double *restrict factors,
                                                  double *restrict part, double *restrict held) {
    int64_t high = panel[3];
    double y0 = part[high];
    double y1 = part[high - 1] - factors[3] * y0;
    held[high] = factors[0] * y0 + factors[2] * y1;
    held[high - 1] = factors[1] * y1 + factors[2] * y0;
    const int32_t *columns = panel + 6;
    for (int64_t b = 0; b < panel[4]; b++) {
        int64_t column = columns[2 * b];
        int64_t at = 8 + 16 * b;
        store8(part, column,
               sub_scaled8(sub_scaled8(load8(part, column), y0, load8(factors, at)), y1, load8(factors, at + 8)));
    }
}

/* The same for one. */
ALWAYS_INLINE void chain_substitution_forward_one(const int32_t *restrict panel, const double *restrict factors,
                                                  double *restrict part, double *restrict held) {
    int64_t high = panel[3];
    double y0 = part[high];
    held[high] = factors[0] * y0;
    const int32_t *columns = panel + 6;
    for (int64_t b = 0; b < panel[4]; b++) {
        int64_t column = columns[2 * b];
        store8(part, column, sub_scaled8(load8(part, column), y0, load8(factors, 8 + 8 * b)));
    }
}

/* L^T x = D^-1 y for a panel of four. */
ALWAYS_INLINE void chain_substitution_backward_four(const int32_t *restrict panel, const double *restrict factors,
                                                    const double *restrict units, double *restrict part,
                                                    const double *restrict held) {
    int64_t high = panel[3];
    const int32_t *columns = panel + 6;
    /* What is held is among the sums from the start: whatever follows on the last block that is read takes time. */
    vec8 x = load8(part, columns[0]);
    vec8 s0 = sub_product8(masked8(held, high, 1), load8(factors, 16), x);
    vec8 s1 = sub_product8(masked8(held, high - 1, 1), load8(factors, 24), x);
    vec8 s2 = sub_product8(masked8(held, high - 2, 1), load8(factors, 32), x);
    vec8 s3 = sub_product8(masked8(held, high - 3, 1), load8(factors, 40), x);
    for (int64_t b = 1; b < panel[4]; b++) {
        x = load8(part, columns[2 * b]);
        int64_t at = 16 + 32 * b;
        s0 = sub_product8(s0, load8(factors, at), x);
        s1 = sub_product8(s1, load8(factors, at + 8), x);
        s2 = sub_product8(s2, load8(factors, at + 16), x);
        s3 = sub_product8(s3, load8(factors, at + 24), x);
    }
    double x3 = sum8(s3);
    double x2 = sum8(s2) - factors[11] * x3;
    double x1 = sum8(s1) - factors[10] * x3 - factors[9] * x2;
    double x0 = sum8(s0) - factors[8] * x3 - factors[7] * x2 - factors[6] * x1;
    /* Whole blocks are written: they are read as such at once. */
    int64_t begin = floor_div(high - 3, CHAIN_ELIMINATION_BLOCK) * CHAIN_ELIMINATION_BLOCK;
    int64_t unit = ONE - high + begin;
    vec8 one = add_scaled8(add_scaled8(load8(part, begin), x3, load8(units, unit + 3)), x2, load8(units, unit + 2));
    store8(part, begin, add_scaled8(add_scaled8(one, x1, load8(units, unit + 1)), x0, load8(units, unit)));
    if (high >= begin + CHAIN_ELIMINATION_BLOCK) {
        begin += CHAIN_ELIMINATION_BLOCK;
        unit += CHAIN_ELIMINATION_BLOCK;
        one = add_scaled8(load8(part, begin), x2, load8(units, unit + 2));
        store8(part, begin, add_scaled8(add_scaled8(one, x1, load8(units, unit + 1)), x0, load8(units, unit)));
    }
}

/* The same for two. */
ALWAYS_INLINE void chain_substitution_backward_two(const int32_t *restrict panel, const double *restrict factors,
                                                   const double *restrict units, double *restrict part,
                                                   const double *restrict held) {
    int64_t high = panel[3];
    const int32_t *columns = panel + 6;
    vec8 x = load8(part, columns[0]);
    vec8 s0 = mul8(load8(factors, 8), x);
    vec8 s1 = mul8(load8(factors, 16), x);
    for (int64_t b = 1; b < panel[4]; b++) {
        x = load8(part, columns[2 * b]);
        int64_t at = 8 + 16 * b;
        s0 = add_product8(s0, load8(factors, at), x);
        s1 = add_product8(s1, load8(factors, at + 8), x);
    }
    double x1 = held[high - 1] - sum8(s1);
    double x0 = held[high] - sum8(s0) - factors[3] * x1;
    int64_t begin = floor_div(high - 1, CHAIN_ELIMINATION_BLOCK) * CHAIN_ELIMINATION_BLOCK;
    int64_t unit = ONE - high + begin;
    store8(part, begin,
           add_scaled8(add_scaled8(load8(part, begin), x1, load8(units, unit + 1)), x0, load8(units, unit)));
    if (high >= begin + CHAIN_ELIMINATION_BLOCK) part[high] = x0;
}

/* The same for one. */
ALWAYS_INLINE void chain_substitution_backward_one(const int32_t *restrict panel, const double *restrict factors,
                                                   const double *restrict units, double *restrict part,
                                                   const double *restrict held) {
    int64_t high = panel[3];
    const int32_t *columns = panel + 6;
    vec8 s0 = mul8(load8(factors, 8), load8(part, columns[0]));
    for (int64_t b = 1; b < panel[4]; b++)
        s0 = add_product8(s0, load8(factors, 8 + 8 * b), load8(part, columns[2 * b]));
    double x0 = held[high] - sum8(s0);
    int64_t begin = floor_div(high, CHAIN_ELIMINATION_BLOCK) * CHAIN_ELIMINATION_BLOCK;
    store8(part, begin, add_scaled8(load8(part, begin), x0, load8(units, ONE - high + begin)));
}

/* L and D of one stage, in place. */
ALWAYS_INLINE void chain_substitution_forward(int64_t both, int64_t distance, const int64_t *restrict stage,
                                              const int32_t *restrict code, int64_t stride,
                                              const double *restrict factors, double *restrict work, double *x,
                                              double *other_x) {
    double *part = work;
    double *held = work + HELD * stride;
    double *other_part = work + VECTORS * stride;
    double *other_held = other_part + HELD * stride;
    const int32_t *program = code + stage[CODE];
    chain_elimination_gather_rows(stage, code, x, part);
    if (both != 0) chain_elimination_gather_rows(stage, code, other_x, other_part);
    const int32_t *panels = program + program[PANELS_AT];
    const int32_t *places = program + program[PLACES_AT];
    for (int64_t p = 0; p < program[CHAIN_ELIMINATION_PANELS]; p++) {
        const int32_t *panel = panels + places[2 * p];
        int64_t at = stage[CHAIN_ELIMINATION_FACTORS] + places[2 * p + 1];
        const double *own = factors + at;
        lane_state_ask_ahead(distance, chain_substitution_vectors_of(panel), 8, at, factors);
        if (panel[0] == 4) {
            chain_substitution_forward_four(panel, own, part, held);
            if (both != 0) chain_substitution_forward_four(panel, own, other_part, other_held);
        } else if (panel[0] == 2) {
            chain_substitution_forward_two(panel, own, part, held);
            if (both != 0) chain_substitution_forward_two(panel, own, other_part, other_held);
        } else {
            chain_substitution_forward_one(panel, own, part, held);
            if (both != 0) chain_substitution_forward_one(panel, own, other_part, other_held);
        }
    }
    chain_substitution_return_outer(stage, code, part, x);
    chain_elimination_put_own(stage, code, held, x);
    if (both != 0) {
        chain_substitution_return_outer(stage, code, other_part, other_x);
        chain_elimination_put_own(stage, code, other_held, other_x);
    }
}

/* Bring what a vector has for B and F to part, which is 0 for U, and U's to held. */
ALWAYS_INLINE void chain_substitution_hold_own(const int64_t *restrict stage, const int32_t *restrict code,
                                               const double *restrict x, double *restrict part,
                                               double *restrict held) {
    const int32_t *program = code + stage[CODE];
    int64_t inside = program[SIZE] - program[INSIDE];
    chain_elimination_gather_outer(stage, code, x, part);
    chain_elimination_take_own(stage, code, x, held);
    for (int64_t k = 0; k < program[INSIDE]; k += CHAIN_ELIMINATION_BLOCK) store8(part, inside + k, splat8(0.0));
}

/* L^T of all stages, in place; where it is checked, z -= K x as well.
 *
 * Pivots wait for one another; meanwhile products with the matrix of the last stage are added. */
ALWAYS_INLINE void chain_substitution_backward(int64_t both, int64_t checked, int64_t distance, int64_t stages,
                                               const int64_t *restrict table, const int32_t *restrict code,
                                               int64_t stride, const double *restrict units,
                                               const double *restrict factors, const double *restrict matrix,
                                               double *restrict work, double *x, double *other_x, double *z,
                                               double *other_z) {
    double *part = work;
    double *held = work + HELD * stride;
    double *other = work + VECTORS * stride;
    double *other_held = other + HELD * stride;
    for (int64_t k = 0; k < stages; k++) {
        int64_t s = stages - 1 - k;
        const int64_t *stage = table + s * CHAIN_ELIMINATION_FIELDS;
        const int32_t *program = code + stage[CODE];
        chain_substitution_hold_own(stage, code, x, part, held);
        if (both != 0) chain_substitution_hold_own(stage, code, other_x, other, other_held);
        const int64_t *done = table + imin(s + 1, stages - 1) * CHAIN_ELIMINATION_FIELDS;
        const int32_t *behind = code + done[CODE];
        const double *kept = matrix + done[CHAIN_ELIMINATION_MATRIX];
        int64_t rows = checked != 0 && k > 0 ? behind[ROWS] : 0;
        const int32_t *panels = program + program[PANELS_AT];
        const int32_t *places = program + program[PLACES_AT];
        int64_t count = program[CHAIN_ELIMINATION_PANELS];
        int64_t share = chain_elimination_share_of(rows, imax(count, 1));
        int64_t row = 0;
        int64_t block = 0;
        for (int64_t q = 0; q < count; q++) {
            int64_t p = count - 1 - q;
            const int32_t *panel = panels + places[2 * p];
            int64_t at = stage[CHAIN_ELIMINATION_FACTORS] + places[2 * p + 1];
            const double *own = factors + at;
            lane_state_ask_behind(distance, chain_substitution_vectors_of(panel), at, factors);
            if (panel[0] == 4) {
                chain_substitution_backward_four(panel, own, units, part, held);
                if (both != 0) chain_substitution_backward_four(panel, own, units, other, other_held);
            } else if (panel[0] == 2) {
                chain_substitution_backward_two(panel, own, units, part, held);
                if (both != 0) chain_substitution_backward_two(panel, own, units, other, other_held);
            } else {
                chain_substitution_backward_one(panel, own, units, part, held);
                if (both != 0) chain_substitution_backward_one(panel, own, units, other, other_held);
            }
            if (row < rows) {
                int64_t last = imin(row + share, rows);
                block = chain_rows_subtract_rows(both, row, last, behind, kept, block, stride, work);
                row = last;
            }
        }
        chain_elimination_put_own(stage, code, part, x);
        if (both != 0) chain_elimination_put_own(stage, code, other, other_x);
        if (checked != 0) {
            if (k > 0) {
                chain_rows_subtract_rows(both, row, rows, behind, kept, block, stride, work);
                chain_rows_end_products(done, code, kept, stride, work, z);
                if (both != 0) chain_rows_end_products(done, code, kept, stride, other, other_z);
            }
            chain_rows_begin_products(program, matrix + stage[CHAIN_ELIMINATION_MATRIX], stride, work);
            if (both != 0)
                chain_rows_begin_products(program, matrix + stage[CHAIN_ELIMINATION_MATRIX], stride, other);
        }
    }
    if (checked != 0) {
        const int32_t *first = code + table[CODE];
        const double *kept = matrix + table[CHAIN_ELIMINATION_MATRIX];
        chain_rows_subtract_rows(both, 0, first[ROWS], first, kept, 0, stride, work);
        chain_rows_end_products(table + 0, code, kept, stride, work, z);
        if (both != 0) chain_rows_end_products(table + 0, code, kept, stride, other, other_z);
    }
}

/* L and D of stages that follow one another, in place. */
static inline void chain_substitution_forward_one_vector(int64_t distance, int64_t stages,
                                                         const int64_t *restrict table,
                                                         const int32_t *restrict code, int64_t stride,
                                                         const double *restrict factors, double *restrict work,
                                                         double *restrict x) {
    for (int64_t s = 0; s < stages; s++) {
        chain_substitution_forward(0, distance, table + s * CHAIN_ELIMINATION_FIELDS, code, stride, factors, work,
                                   x, x);
    }
}

/* The same for two vectors. */
static inline void chain_substitution_forward_both(int64_t distance, int64_t stages, const int64_t *restrict table,
                                                   const int32_t *restrict code, int64_t stride,
                                                   const double *restrict factors, double *restrict work,
                                                   double *restrict x, double *restrict other_x) {
    for (int64_t s = 0; s < stages; s++) {
        chain_substitution_forward(1, distance, table + s * CHAIN_ELIMINATION_FIELDS, code, stride, factors, work,
                                   x, other_x);
    }
}

/* L^T of stages that follow one another, in place; where it is checked, z -= K x as well. */
static inline void chain_substitution_backward_one_vector(
    int64_t checked, int64_t distance, int64_t stages, const int64_t *restrict table, const int32_t *restrict code,
    int64_t stride, const double *restrict units, const double *restrict factors, const double *restrict matrix,
    double *restrict work, double *restrict x, double *restrict z) {
    chain_substitution_backward(0, checked, distance, stages, table, code, stride, units, factors, matrix, work, x,
                                x, z, z);
}

#endif
