/* Products with the matrix of a chain, as it is kept for them (see chain_elimination.h). */
#ifndef STC_CHAIN_ROWS_H
#define STC_CHAIN_ROWS_H

#include "../native.h"
#include "../vec8.h"
#include "chain_elimination.h"

/* Vectors of a stage in the work space, for each of two: the part of x that belongs to its rows; what is held back
 * meanwhile; the part once it is scaled; sums of products with the matrix, by columns and by rows, of which there are
 * eight for each row first. */
enum {
    HELD = 1,
    SCALED = 2,
    SUMS = 3,
    TOTALS = 4,
    DOTS = 5,
    VECTORS = 13,
};

/* z = y - K x. */
void chain_rows_subtract(int64_t stages, const int64_t *restrict table, const int32_t *restrict code,
                         int64_t stride, const double *restrict matrix, double *restrict work, int64_t size,
                         const double *restrict x, const double *restrict y, double *restrict z);

/* Add products of rows of a stage's entries, from the row first on; where the next row's blocks are. */
ALWAYS_INLINE int64_t chain_rows_subtract_rows(int64_t both, int64_t first, int64_t last,
                                               const int32_t *restrict program, const double *restrict kept,
                                               int64_t at, int64_t stride, double *restrict work) {
    const double *entries = kept + chain_elimination_entries_at(program);
    const int32_t *blocks = program + program[BLOCKS_AT];
    const int32_t *rows = program + program[ROWS_AT];
    const double *x = work + SCALED * stride;
    double *sums = work + SUMS * stride;
    double *dots = work + DOTS * stride;
    double *other = work + VECTORS * stride;
    const double *other_x = other + SCALED * stride;
    double *other_sums = other + SUMS * stride;
    double *other_dots = other + DOTS * stride;
    int64_t block = at;
    for (int64_t r = first; r < last; r++) {
        int64_t i = rows[2 * r];
        int64_t end = block + rows[2 * r + 1];
        vec8 dot = splat8(0.0);
        vec8 other_dot = splat8(0.0);
        double x_i = x[i];
        double other_x_i = other_x[i];
        while (block < end) {
            int64_t j = blocks[RECORD * block];
            vec8 value = masked8(entries, blocks[RECORD * block + 3], blocks[RECORD * block + 2]);
            dot = add_product8(dot, value, load8(x, j));
            store8(sums, j, add_scaled8(load8(sums, j), x_i, value));
            if (both != 0) {
                other_dot = add_product8(other_dot, value, load8(other_x, j));
                store8(other_sums, j, add_scaled8(load8(other_sums, j), other_x_i, value));
            }
            block++;
        }
        store8(dots, CHAIN_ELIMINATION_BLOCK * r, dot);
        if (both != 0) store8(other_dots, CHAIN_ELIMINATION_BLOCK * r, other_dot);
    }
    return block;
}

/* Scale what is in part, and begin with the products of the diagonal. */
ALWAYS_INLINE void chain_rows_begin_products(const int32_t *restrict program, const double *restrict kept,
                                             int64_t stride, double *restrict work) {
    int64_t size = program[SIZE];
    int64_t own = program[INSIDE];
    int64_t inside = size - own;
    const double *diagonal = kept + chain_elimination_padded(size);
    double *x = work + SCALED * stride;
    double *sums = work + SUMS * stride;
    for (int64_t k = size, end_k = chain_elimination_padded(size); k < end_k; k++) work[k] = 0.0;
    for (int64_t k = 0; k < size; k += CHAIN_ELIMINATION_BLOCK) {
        store8(x, k, mul8(load8(work, k), load8(kept, k)));
        store8(sums, k, splat8(0.0));
    }
    for (int64_t k = 0; k < own; k++) sums[inside + k] = diagonal[k] * x[inside + k];
}

/* Subtract the products of a stage from z. */
ALWAYS_INLINE void chain_rows_end_products(const int64_t *restrict stage, const int32_t *restrict code,
                                           const double *restrict kept, int64_t stride, double *restrict work,
                                           double *restrict z) {
    const int32_t *program = code + stage[CODE];
    const int32_t *outer = code + stage[OUTER];
    int64_t size = program[SIZE];
    int64_t border = program[CHAIN_ELIMINATION_BORDER];
    int64_t base = stage[BASE];
    int64_t own = program[INSIDE];
    int64_t inside = size - own;
    double *sums = work + SUMS * stride;
    double *totals = work + TOTALS * stride;
    const double *dots = work + DOTS * stride;
    int64_t count = program[ROWS];
    const int32_t *rows = program + program[ROWS_AT];
    for (int64_t r = 0; r < count; r += CHAIN_ELIMINATION_BLOCK)
        store8(totals, r, sums8(dots, CHAIN_ELIMINATION_BLOCK * r));
    for (int64_t r = 0; r < count; r++) sums[rows[2 * r]] += totals[r];
    for (int64_t k = 0; k < size; k += CHAIN_ELIMINATION_BLOCK)
        store8(sums, k, mul8(load8(sums, k), load8(kept, k)));
    for (int64_t k = 0; k < border; k++) z[code[k]] -= sums[k];
    double *beyond = z + base;
    for (int64_t k = border; k < inside; k++) beyond[outer[k - border]] -= sums[k];
    int64_t whole = floor_div(own, CHAIN_ELIMINATION_BLOCK) * CHAIN_ELIMINATION_BLOCK;
    for (int64_t k = 0; k < whole; k += CHAIN_ELIMINATION_BLOCK)
        store8(z, base + k, sub8(load8(z, base + k), load8(sums, inside + k)));
    for (int64_t k = whole; k < own; k++) z[base + k] -= sums[inside + k];
}

#endif
