/* Eight segments of the horizon eliminated at once, one in each lane of the vectors, stage by stage. */
#ifndef STC_LANES_H
#define STC_LANES_H

#include "../native.h"
#include "../vec8.h"

/* The numbers of a group: how many steps; unknowns of U, of F, L and B; ... */
enum {
    LANES_STEPS = 0,
    OWN = 1,
    LANES_NEXT = 2,
    LEFT = 3,
    LANES_BORDER = 4,
};
/* ... where the unknowns of U begin in vectors, step by step, eight for each place; where in vectors those of the last
 * step's F are, as listed in index, and, right behind them there, of L and B; ... */
enum {
    UNKNOWNS = 5,
    LASTS = 6,
    ENDS = 7,
};
/* ... entries of a stage: how many (of which the first ADDED are added to what is carried over, the others stored
 * there), where the sources of each step are listed in index, and where the places of
 * one step, three numbers each (entry, and its row and column in any order, the first the same for many entries in a
 * row), in code; the same for those of L with the first stage; ... */
enum {
    LANES_ENTRIES = 8,
    ENTRY_INDEX = 9,
    ENTRY_CODE = 10,
    LANES_FIRST = 11,
    FIRST_INDEX = 12,
    FIRST_CODE = 13,
};
/* ... panels, and where they are in code; entries to be cleared before each step, before the first step, and those
 * that move (from, to); ... */
enum {
    LANES_PANELS = 14,
    PANEL_CODE = 15,
};
/* ... where factors begin and how many vectors a step has; segments, the other lanes being copies of the first; where
 * the places of F in the next step's U, and the places of the panels in code, are listed in code; where the
 * scaled entries begin: those of L with the first stage, then the diagonal and the entries of each step; ... */
enum {
    LANES_FACTORS = 25,
    FACTOR_STEP = 26,
    SEGMENTS = 27,
    FOLLOWING = 28,
    PANEL_STARTS = 29,
    LANES_MATRIX = 30,
    LANES_FIELDS = 33,
};
/* Entries of the matrix are asked for so many steps ahead; a line of memory has those of a lane for so many or more. */
enum {
    STEPS_AHEAD = 8,
    STEPS_OF_LINE = 4,
};

/* Eliminate all segments.
 *
 * groups, table: how many groups of segments, FIELDS numbers for each.
 * index, code: what the table refers to; code is shared by groups of one kind.
 * growth, suspect: pivots are accepted as long as no product that is subtracted exceeds 1 / growth, and no
 *     entry of D^-1 1 / suspect, in the scaled matrix.
 * given: entries of the matrix: H, J, p and d; diagonal: that of the matrix, (N,).
 * scale: of the unknowns, a vector in the order of the segments, and so is outer_most: largest entries so
 *     far of the rows outside of segments, which are updated.
 * result: where the entries are added that are left, as index tells.
 * work, scales, known, most: work space; made: the same, for the factors of a panel; ring: the same, for the
 *     entries of RUN steps.
 * matrix: the scaled entries, for products with the matrix.
 * watched: 1 where outer_most and spread are asked for.
 * spread: largest entry of the row that has the largest one, and the negative of the least, of the rows in
 *     segments: the maximum with what is there, eight of each.
 * factors: the factors; state: see lane_state.h.
 * Returns:
 *     How many pivots are negative, -1 when one was not accepted, an entry is not finite or scale has turned out
 *     not to serve. */
int64_t lanes_eliminate(int64_t groups, const int64_t *restrict table, const int32_t *restrict index,
                        const int32_t *restrict code, double growth, double suspect, const double *restrict given,
                        double *restrict ring, const double *restrict diagonal, const double *restrict scale,
                        double *restrict result, double *restrict work, double *restrict scales,
                        double *restrict known, double *restrict made, double *restrict matrix, int64_t watched,
                        double *restrict most, double *restrict outer_most, double *restrict spread,
                        double *restrict factors, double *restrict state);

/* Copy what a vector has for a step's U to part. */
ALWAYS_INLINE void lanes_collect_own(int64_t step, const int64_t *restrict group, const double *restrict x,
                                     double *restrict part) {
    int64_t own = group[OWN];
    int64_t here = group[UNKNOWNS] + 8 * step * own;
    for (int64_t k = 0; k < own; k++) store8(part, 8 * k, load8(x, here + 8 * k));
}

/* Copy what a vector has for a step's F to part. */
ALWAYS_INLINE void lanes_collect_following(int64_t step, const int64_t *restrict group,
                                           const int32_t *restrict index, const int32_t *restrict code,
                                           const double *restrict x, double *restrict part) {
    int64_t own = group[OWN];
    if (step < group[LANES_STEPS] - 1) {
        int64_t after = group[UNKNOWNS] + 8 * (step + 1) * own;
        const int32_t *following = code + group[FOLLOWING];
        for (int64_t k = 0; k < group[LANES_NEXT]; k++)
            store8(part, 8 * (own + k), load8(x, after + 8 * (int64_t)following[k]));
    } else {
        const int32_t *lasts = index + group[LASTS];
        for (int64_t k = 0; k < group[LANES_NEXT]; k++) store8(part, 8 * (own + k), gather8(x, lasts, 8 * k));
    }
}

/* Copy what a vector has for L and B to part. */
ALWAYS_INLINE void lanes_collect_ends(const int64_t *restrict group, const int32_t *restrict index,
                                      const double *restrict x, double *restrict part) {
    int64_t near = group[OWN] + group[LANES_NEXT];
    const int32_t *outer = index + group[ENDS];
    for (int64_t k = 0; k < group[LEFT] + group[LANES_BORDER]; k++)
        store8(part, 8 * (near + k), gather8(x, outer, 8 * k));
}

/* Raise what a vector has for the last F, L and B to what is in part. */
ALWAYS_INLINE void lanes_note_outside(const int64_t *restrict group, const int32_t *restrict index,
                                      const double *restrict part, double *restrict most) {
    int64_t own = group[OWN];
    const int32_t *outside = index + group[LASTS];
    for (int64_t lane = 0; lane < group[SEGMENTS]; lane++) {
        for (int64_t k = 0; k < group[LANES_NEXT] + group[LEFT] + group[LANES_BORDER]; k++) {
            int64_t at = outside[8 * k + lane];
            most[at] = nanmax(most[at], part[8 * (own + k) + lane]);
        }
    }
}

/* Ask for the entries of a later step; some lanes take their turn with each step, since lines last for several. */
ALWAYS_INLINE void lanes_ask_for_step(int64_t step, const int64_t *restrict group, const int32_t *restrict index,
                                      const double *restrict diagonal, const double *restrict given) {
    if (step + STEPS_AHEAD < group[LANES_STEPS]) {
        int64_t own = group[OWN];
        int64_t count = group[LANES_ENTRIES];
        int64_t lane = floor_div(8, STEPS_OF_LINE) * floor_mod(step, STEPS_OF_LINE);
        const int32_t *sources = index + group[ENTRY_INDEX] + 8 * (step + STEPS_AHEAD) * count + lane;
        const int32_t *diagonals = index + group[UNKNOWNS] + 8 * (step + STEPS_AHEAD) * own + lane;
        for (int64_t turn = 0; turn < floor_div(8, STEPS_OF_LINE); turn++) {
            for (int64_t k = 0; k < count; k++) prefetch8(given, sources[8 * k + turn]);
            for (int64_t k = 0; k < own; k++) prefetch8(diagonal, diagonals[8 * k + turn]);
        }
    }
}

#endif
