/* Stages of a chain eliminated one after the other, in a window whose places are fixed before. */
#ifndef STC_CHAIN_ELIMINATION_H
#define STC_CHAIN_ELIMINATION_H

#include "../native.h"
#include "../vec8.h"

/* Numbers that are read and written together. */
enum {
    CHAIN_ELIMINATION_BLOCK = 8,
};
/* Of a stage: where its program begins, and its unknowns in vectors, the sources of its entries, what is kept of its
 * matrix and its factors; where in the programs the places of F in vectors are, counted from BASE. */
enum {
    CODE = 0,
    BASE = 1,
    CHAIN_ELIMINATION_MATRIX = 3,
    CHAIN_ELIMINATION_FACTORS = 4,
    OUTER = 5,
    CHAIN_ELIMINATION_FIELDS = 6,
};
/* Of a program: rows of the window; unknowns of U, and of B; ... */
enum {
    SIZE = 0,
    INSIDE = 1,
    CHAIN_ELIMINATION_BORDER = 2,
};
/* ... blocks without entries to be cleared first, by their places in the window; entries off the diagonal, with the
 * zeros between those of a block, and behind the last one up to whole vectors; blocks with entries, row by row: the
 * column where each begins, its row, which of its numbers are among these, bit by bit, and where its first number
 * would be; rows with blocks, each with how many; ... */
enum {
    BLOCKS_AT = 7,
    ROWS = 8,
    ROWS_AT = 9,
    RECORD = 4,
};
/* ... panels (see chain_panel.h); ... */
enum {
    CHAIN_ELIMINATION_PANELS = 12,
    PANELS_AT = 13,
};
/* ... where each panel begins, counted from PANELS_AT, and its factors; ... */
enum {
    PLACES_AT = 14,
};

/* Room for so many numbers in whole blocks. */
API int64_t chain_elimination_padded(int64_t count);

/* Eliminate stages that follow one another; state[COUNTED] becomes the negative pivots, -1 if one is refused.
 *
 * Pivots wait for one another; meanwhile the next stage is loaded, into the other one of two windows.
 *
 * stages, table, code: FIELDS numbers for each stage, and the places of B in vectors, then the programs, that
 *     stages refer to.
 * index: which unknown is at each place of vectors.
 * growth, suspect: pivots are accepted as long as no product that is subtracted exceeds 1 / growth, and no
 *     entry of D^-1 1 / suspect, in the scaled matrix.
 * masks: k ones and 8 - k zeros, for k from 0 to 8.
 * source: of each entry in given, where there is a zero as well, stage by stage, in the order of the blocks.
 * given: entries of the matrix: H, J, p and d; diagonal: that of the matrix, (N,).
 * scale: a vector.
 * cleared: so many numbers of left, what these stages leave, are cleared first; else it has what was left
 *     before; joined: what a second part has left.
 * peaks, windows: work space, the latter for two windows.
 * matrix: what is kept of each stage for products with the matrix: the scale of its rows, the diagonal of U,
 *     the entries in the order of the blocks.
 * size, most: numbers of most that are cleared first; where state[WATCHED], it is raised to the largest
 *     entries of rows, a vector.
 * factors, state: the results. */
API void chain_elimination_eliminate_run(
    int64_t stages, const int64_t *restrict table, const int32_t *restrict code, const int32_t *restrict index,
    int64_t stride, double growth, double suspect, const double *restrict masks, const int32_t *restrict source,
    const double *restrict given, const double *restrict diagonal, const double *restrict scale, int64_t cleared,
    const double *restrict joined, double *restrict left, double *restrict peaks, double *restrict matrix,
    int64_t size, double *restrict most, double *restrict windows, double *restrict factors,
    double *restrict state);

/* Eliminate all stages.
 *
 * calls, place: where eliminate_run of the parts of the chain is among the prepared calls, and behind it the
 *     run of what comes after them.
 * runs: 1, or 3 where there are two parts and something behind; states: of each run.
 * other_most: what is most to the second part.
 * size: N; places: where scale (N,) has that of each place of vectors; own_scale becomes the vector.
 * most: becomes the largest entries of all rows, a vector.
 * Returns:
 *     0, REFUSED when a pivot was not accepted, STALE_SCALE when the scale does not serve the matrix,
 *     DOUBTED_SCALE when it was not tested but perhaps does not; state[COUNTED] becomes the number of negative
 *     pivots, state[LARGEST] what the test was. */
API int64_t chain_elimination_eliminate(const int64_t *calls, int64_t place, int64_t runs, double *states,
                                        const double *other_most, int64_t size, const int32_t *places,
                                        const double *scale, double *own_scale, double *most, double *state);

/* How many of count each of some parts takes, but for the last ones. */
ALWAYS_INLINE int64_t chain_elimination_share_of(int64_t count, int64_t parts) {
    return floor_div(count + parts - 1, parts);
}

/* Where the entries are in what is kept of a stage: behind the scale and the diagonal. */
ALWAYS_INLINE int64_t chain_elimination_entries_at(const int32_t *restrict program) {
    return chain_elimination_padded(program[SIZE]) + chain_elimination_padded(program[INSIDE]);
}

/* Bring what a vector has for B and F to part. */
ALWAYS_INLINE void chain_elimination_gather_outer(const int64_t *restrict stage, const int32_t *restrict code,
                                                  const double *restrict x, double *restrict part) {
    const int32_t *program = code + stage[CODE];
    const int32_t *outer = code + stage[OUTER];
    const double *own = x + stage[BASE];
    int64_t border = program[CHAIN_ELIMINATION_BORDER];
    for (int64_t k = 0; k < border; k++) part[k] = x[code[k]];
    for (int64_t k = border; k < program[SIZE] - program[INSIDE]; k++) part[k] = own[outer[k - border]];
}

/* The same for U; up to seven numbers behind change as well. */
ALWAYS_INLINE void chain_elimination_take_own(const int64_t *restrict stage, const int32_t *restrict code,
                                              const double *restrict x, double *restrict part) {
    const int32_t *program = code + stage[CODE];
    int64_t inside = program[SIZE] - program[INSIDE];
    for (int64_t k = 0; k < program[INSIDE]; k += CHAIN_ELIMINATION_BLOCK)
        store8(part, inside + k, load8(x, stage[BASE] + k));
}

/* The opposite, where nothing else changes. */
ALWAYS_INLINE void chain_elimination_put_own(const int64_t *restrict stage, const int32_t *restrict code,
                                             const double *restrict part, double *restrict x) {
    const int32_t *program = code + stage[CODE];
    int64_t base = stage[BASE];
    int64_t count = program[INSIDE];
    int64_t inside = program[SIZE] - count;
    int64_t whole = floor_div(count, CHAIN_ELIMINATION_BLOCK) * CHAIN_ELIMINATION_BLOCK;
    for (int64_t k = 0; k < whole; k += CHAIN_ELIMINATION_BLOCK) store8(x, base + k, load8(part, inside + k));
    for (int64_t k = whole; k < count; k++) x[base + k] = part[inside + k];
}

/* Bring what a vector has for all rows of a window to part; up to seven numbers behind change as well. */
ALWAYS_INLINE void chain_elimination_gather_rows(const int64_t *restrict stage, const int32_t *restrict code,
                                                 const double *restrict x, double *restrict part) {
    chain_elimination_gather_outer(stage, code, x, part);
    chain_elimination_take_own(stage, code, x, part);
}

#endif
