/* Stages of a chain eliminated one after the other, in a window whose places are fixed before.
 *
 * Unknowns of a stage stand in the window in the opposite order of their elimination, behind those that it leaves to later
 * stages:
 *
 *     B   unknowns that couple with every stage
 *     F   unknowns of the next stage that couple with these
 *     U   unknowns of the stage, the first one to be eliminated last
 *
 * Of the window there is the lower triangle, row by row, stride numbers each.  So whatever a pivot couples with is to
 * the left of it in its own row, and rows are read and written in blocks of eight numbers.  Pivots are taken in panels
 * (see chain_panel.h).
 *
 * What is right of the diagonal is never read as a number that counts, but is finite where all else is.
 *
 * In vectors, too, the unknowns of U follow one another as in the window, stage by stage, and B comes last; there is room
 * for seven more numbers, which are read but do not count.
 *
 * Programs are lists of numbers, one for all stages of a kind.  They begin with PROGRAM numbers, places of lists being
 * counted from there.  Each stage has FIELDS numbers in a table. */
#include "../native.h"
#include "../vec8.h"
#include "chain_elimination.h"
#include "chain_panel.h"
#include "lane_state.h"
#include "segmented_passes.h"
#include "values.h"

/* Of a stage: where its program begins, and its unknowns in vectors, the sources of its entries, what is kept of its
 * matrix and its factors; where in the programs the places of F in vectors are, counted from BASE. */
enum {
    SOURCES = 2,
};
/* ... blocks without entries to be cleared first, by their places in the window; entries off the diagonal, with the
 * zeros between those of a block, and behind the last one up to whole vectors; blocks with entries, row by row: the
 * column where each begins, its row, which of its numbers are among these, bit by bit, and where its first number
 * would be; rows with blocks, each with how many; ... */
enum {
    CHAIN_ELIMINATION_CLEARED = 3,
    CLEARED_AT = 4,
    CHAIN_ELIMINATION_ENTRIES = 5,
    BLOCKS = 6,
};
/* ... how many rows the stage before has left, and where its triangle goes, entry by entry; ... */
enum {
    CARRIED = 10,
    CARRIED_TO = 11,
};
/* ... the same as CARRIED for a second part of the chain that has come to its end. */
enum {
    JOINED = 15,
    JOINED_TO = 16,
};

int64_t chain_elimination_padded(int64_t count) {
    return chain_elimination_share_of(count, CHAIN_ELIMINATION_BLOCK) * CHAIN_ELIMINATION_BLOCK;
}

/* Raise most to the largest magnitudes of the rows of a stage; peaks is room for nine times its rows. */
ALWAYS_INLINE void measure(const int64_t *restrict stage, const int32_t *restrict code, const double *restrict kept,
                           double *restrict peaks, double *restrict most) {
    const int32_t *program = code + stage[CODE];
    const int32_t *outer = code + stage[OUTER];
    int64_t base = stage[BASE];
    int64_t size = program[SIZE];
    int64_t border = program[CHAIN_ELIMINATION_BORDER];
    int64_t own = program[INSIDE];
    int64_t inside = size - own;
    double *by_row = peaks + chain_elimination_padded(size + 1);
    const double *diagonal = kept + chain_elimination_padded(size);
    const double *entries = kept + chain_elimination_entries_at(program);
    for (int64_t k = 0; k < size; k++) {
        peaks[k] = 0.0;
        store8(by_row, CHAIN_ELIMINATION_BLOCK * k, splat8(0.0));
    }
    for (int64_t k = 0; k < own; k++) peaks[inside + k] = fabs(diagonal[k]) * kept[inside + k] * kept[inside + k];
    const int32_t *blocks = program + program[BLOCKS_AT];
    const int32_t *rows = program + program[ROWS_AT];
    int64_t b = 0;
    for (int64_t r = 0; r < program[ROWS]; r++) {
        int64_t i = rows[2 * r];
        int64_t end = b + rows[2 * r + 1];
        double scale_i = kept[i];
        vec8 high = splat8(0.0);
        while (b < end) {
            int64_t j = blocks[RECORD * b];
            vec8 value = abs8(masked8(entries, blocks[RECORD * b + 3], blocks[RECORD * b + 2]));
            value = mul8(value, scaled8(scale_i, load8(kept, j)));
            store8(peaks, j, max8(value, load8(peaks, j)));
            high = max8(value, high);
            b++;
        }
        store8(by_row, CHAIN_ELIMINATION_BLOCK * i, high);
    }
    for (int64_t k = 0; k < border; k++) {
        double high_k = nanmax(peaks[k], largest8(load8(by_row, CHAIN_ELIMINATION_BLOCK * k)));
        most[code[k]] = nanmax(most[code[k]], high_k);
    }
    double *beyond = most + base;
    for (int64_t k = border; k < inside; k++) {
        int64_t to = outer[k - border];
        beyond[to] = nanmax(beyond[to], nanmax(peaks[k], largest8(load8(by_row, CHAIN_ELIMINATION_BLOCK * k))));
    }
    for (int64_t k = inside; k < size; k++) {
        int64_t to = base + k - inside;
        most[to] = nanmax(most[to], nanmax(peaks[k], largest8(load8(by_row, CHAIN_ELIMINATION_BLOCK * k))));
    }
}

/* Keep the scale and the diagonal of a stage. */
static void begin(const int64_t *restrict stage, const int32_t *restrict code, const int32_t *restrict index,
                  const double *restrict diagonal, const double *restrict scale, double *restrict kept) {
    const int32_t *program = code + stage[CODE];
    int64_t size = program[SIZE];
    chain_elimination_gather_rows(stage, code, scale, kept);
    for (int64_t k = size, end_k = chain_elimination_padded(size); k < end_k; k++) kept[k] = 0.0;
    double *own = kept + chain_elimination_padded(size);
    for (int64_t k = 0; k < program[INSIDE]; k += CHAIN_ELIMINATION_BLOCK)
        store8(own, k, gather8(diagonal, index, stage[BASE] + k));
}

/* Copy entries, whole blocks of them. */
static void copy(int64_t first, int64_t last, const int32_t *restrict sources, const double *restrict given,
                 double *restrict entries) {
    for (int64_t e = first; e < last; e += CHAIN_ELIMINATION_BLOCK) store8(entries, e, gather8(given, sources, e));
}

/* Clear blocks of the window. */
static void clear(int64_t first, int64_t last, const int32_t *restrict cleared, double *restrict window) {
    for (int64_t k = first; k < last; k++) store8(window, cleared[k], splat8(0.0));
}

/* Bring scaled entries to the window, block by block. */
static void place(int64_t first, int64_t last, const int32_t *restrict blocks, int64_t stride,
                  const double *restrict scales, const double *restrict entries, double *restrict window) {
    for (int64_t b = first; b < last; b++) {
        int64_t j = blocks[RECORD * b];
        int64_t i = blocks[RECORD * b + 1];
        vec8 value = masked8(entries, blocks[RECORD * b + 3], blocks[RECORD * b + 2]);
        store8(window, i * stride + j, mul8(value, scaled8(scales[i], load8(scales, j))));
    }
}

/* Bring the diagonal to the window, and what the stage before has left, and a second part that ends there. */
static void complete(const int32_t *restrict program, int64_t stride, const double *restrict kept,
                     const double *restrict left, const double *restrict joined, double *restrict window) {
    int64_t size = program[SIZE];
    const double *own = kept + chain_elimination_padded(size);
    int64_t inside = size - program[INSIDE];
    for (int64_t k = inside; k < size; k++) window[k * (stride + 1)] = own[k - inside] * kept[k] * kept[k];
    int64_t carried = program[CARRIED];
    const int32_t *target = program + program[CARRIED_TO];
    for (int64_t e = 0; e < (carried * (carried + 1)) >> 1; e++) window[target[e]] += left[e];
    int64_t second = program[JOINED];
    target = program + program[JOINED_TO];
    for (int64_t e = 0; e < (second * (second + 1)) >> 1; e++) window[target[e]] += joined[e];
}

/* Take the unknowns of a stage out of the window, while the following one comes to that beside.
 *
 * It does, but for its diagonal, where there is one more.  A slice of this goes between the corner of each panel
 * and its rows: in the first half of the panels entries are copied, in the second one they are brought to the window. */
ALWAYS_INLINE void take_panels(const int64_t *restrict stage, const int32_t *restrict code, int64_t stride,
                               const double *restrict masks, double *restrict window, double *restrict factors,
                               int64_t more, const int64_t *restrict following, const int32_t *restrict source,
                               const int32_t *restrict index, const double *restrict given,
                               const double *restrict diagonal, const double *restrict scale,
                               double *restrict ahead, double *restrict beside, double *restrict state) {
    const int32_t *program = code + stage[CODE];
    const int32_t *coming = code + following[CODE];
    double *entries = ahead + chain_elimination_entries_at(coming);
    const int32_t *sources = source + following[SOURCES];
    const int32_t *cleared = coming + coming[CLEARED_AT];
    const int32_t *blocks = coming + coming[BLOCKS_AT];
    int64_t last_clear = more * coming[CHAIN_ELIMINATION_CLEARED];
    int64_t last_copy = more * coming[CHAIN_ELIMINATION_ENTRIES];
    int64_t last_place = more * coming[BLOCKS];
    const int32_t *panels = program + program[PANELS_AT];
    const int32_t *places = program + program[PLACES_AT];
    int64_t count = program[CHAIN_ELIMINATION_PANELS];
    int64_t distance = (int64_t)state[DISTANCE];
    int64_t half = imax(count >> 1, 1);
    int64_t rest = imax(count - half, 1);
    int64_t clears = chain_elimination_share_of(last_clear, half);
    int64_t copies = chain_elimination_padded(chain_elimination_share_of(last_copy, half));
    int64_t placings = chain_elimination_share_of(last_place, rest);
    int64_t at_clear = 0;
    int64_t at_copy = 0;
    int64_t at_place = 0;
    for (int64_t p = 0; p < count; p++) {
        const int32_t *panel = panels + places[2 * p];
        double *own = factors + stage[CHAIN_ELIMINATION_FACTORS] + places[2 * p + 1];
        chain_panel_invert_corner(panel, stride, window, own, state);
        if (p == 0 && more != 0) begin(following, code, index, diagonal, scale, ahead);
        if (p < half) {
            int64_t to_clear = imin(at_clear + clears, last_clear);
            int64_t to_copy = imin(at_copy + copies, last_copy);
            clear(at_clear, to_clear, cleared, beside);
            copy(at_copy, to_copy, sources, given, entries);
            at_clear = to_clear;
            at_copy = to_copy;
        } else {
            int64_t to_place = imin(at_place + placings, last_place);
            place(at_place, to_place, blocks, stride, ahead, entries, beside);
            at_place = to_place;
        }
        chain_panel_take_panel(distance, panel, stride, masks, window, own, state);
    }
    if (count == 0 && more != 0) begin(following, code, index, diagonal, scale, ahead);
    clear(at_clear, last_clear, cleared, beside);
    copy(at_copy, last_copy, sources, given, entries);
    place(at_place, last_place, blocks, stride, ahead, entries, beside);
}

/* Take what a stage leaves out of the window. */
ALWAYS_INLINE void leave(const int32_t *restrict program, int64_t stride, const double *restrict window,
                         double *restrict left) {
    for (int64_t i = 0; i < program[SIZE] - program[INSIDE]; i++) {
        int64_t begin = (i * (i + 1)) >> 1;
        for (int64_t j = 0; j < i + 1; j += CHAIN_ELIMINATION_BLOCK)
            store8(left, begin + j, load8(window, i * stride + j));
    }
}

void chain_elimination_eliminate_run(int64_t stages, const int64_t *restrict table, const int32_t *restrict code,
                                     const int32_t *restrict index, int64_t stride, double growth, double suspect,
                                     const double *restrict masks, const int32_t *restrict source,
                                     const double *restrict given, const double *restrict diagonal,
                                     const double *restrict scale, int64_t cleared, const double *restrict joined,
                                     double *restrict left, double *restrict peaks, double *restrict matrix,
                                     int64_t size, double *restrict most, double *restrict windows,
                                     double *restrict factors, double *restrict state) {
    chain_panel_begin_tests(state);
    int64_t watched = (int64_t)state[LANE_STATE_WATCHED];
    if (watched != 0)
        for (int64_t k = 0; k < size; k++) most[k] = 0.0;
    for (int64_t k = 0; k < cleared; k++) left[k] = 0.0;
    const int32_t *first = code + table[CODE];
    double *kept = matrix + table[CHAIN_ELIMINATION_MATRIX];
    double *entries = kept + chain_elimination_entries_at(first);
    begin(table, code, index, diagonal, scale, kept);
    clear(0, first[CHAIN_ELIMINATION_CLEARED], first + first[CLEARED_AT], windows);
    copy(0, first[CHAIN_ELIMINATION_ENTRIES], source + table[SOURCES], given, entries);
    place(0, first[BLOCKS], first + first[BLOCKS_AT], stride, kept, entries, windows);
    for (int64_t s = 0; s < stages; s++) {
        const int64_t *stage = table + s * CHAIN_ELIMINATION_FIELDS;
        const int32_t *program = code + stage[CODE];
        kept = matrix + stage[CHAIN_ELIMINATION_MATRIX];
        double *window = windows + (s & 1) * stride * stride;
        complete(program, stride, kept, left, joined, window);
        int64_t more = s + 1 < stages ? 1 : 0;
        const int64_t *following = table + (s + more) * CHAIN_ELIMINATION_FIELDS;
        take_panels(stage, code, stride, masks, window, factors, more, following, source, index, given, diagonal,
                    scale, matrix + following[CHAIN_ELIMINATION_MATRIX], windows + ((s + 1) & 1) * stride * stride,
                    state);
        if (watched != 0) measure(stage, code, kept, peaks, most);
        double worst = chain_panel_worst_test(growth, suspect, state);
        if (!(worst < 1.0)) {
            state[COUNTED] = -1.0;
            return;
        }
        state[LANE_STATE_LARGEST] = worst;
        leave(program, stride, window, left);
    }
    state[COUNTED] = state[CHAIN_PANEL_NEGATIVE];
}

/* The scale in the order of vectors. */
static void take_scale(int64_t size, const int32_t *restrict places, const double *restrict scale,
                       double *restrict own_scale) {
    for (int64_t k = 0; k < size; k++) own_scale[k] = scale[places[k]];
}

int64_t chain_elimination_eliminate(const int64_t *calls, int64_t place, int64_t runs, double *states,
                                    const double *other_most, int64_t size, const int32_t *places,
                                    const double *scale, double *own_scale, double *most, double *state) {
    take_scale(size, places, scale, own_scale);
    int64_t watched = lane_state_is_watched(state);
    for (int64_t run = 0; run < runs; run++) {
        states[run * STATE + LANE_STATE_WATCHED] = 1.0 * watched;
        states[run * STATE + COUNTED] = 0.0;
    }
    invoke(calls, place);
    if (runs > 1) {
        if (states[COUNTED] < 0.0 || states[STATE + COUNTED] < 0.0) return SEGMENTED_PASSES_REFUSED;
        if (watched != 0) values_raise_to(size, other_most, most);
        invoke(calls, place + 1);
    }
    if (lane_state_put_together(runs, states, state) != 0) return SEGMENTED_PASSES_REFUSED;
    if (watched != 0) {
        double spread = values_spread_of(size, most);
        lane_state_note_watched(spread, state);
        return spread > STALE ? STALE_SCALE : 0;
    }
    return lane_state_is_doubtful(state) != 0 ? DOUBTED_SCALE : 0;
}
