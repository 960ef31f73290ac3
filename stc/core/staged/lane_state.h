/* Vectors of eight lanes that are asked for before they are needed, or written past the caches. */
#ifndef STC_LANE_STATE_H
#define STC_LANE_STATE_H

#include "../native.h"
#include "../vec8.h"

/* Places in state: what tests a pivot, the largest so far in each lane, should be below 1; pivots that are
 * negative; the largest test of all groups; negative pivots of all together; the largest test up to which factors are
 * trusted; how far ahead memory is asked for, 0 where it is near; matrices until the scale is tested again; whether
 * factors are written past the caches; whether the scale is tested with the matrix at hand; whether the entries of the
 * matrix are asked for ahead; 0 in each lane as long as all these are finite, else nan. */
enum {
    WORST = 0,
    LANE_STATE_NEGATIVE = 8,
    LANE_STATE_LARGEST = 16,
    COUNTED = 17,
    TRUSTED = 18,
    DISTANCE = 24,
    UNWATCHED = 25,
    STREAMED = 26,
    LANE_STATE_WATCHED = 27,
    FETCHED = 28,
    LANE_STATE_CHECK = 32,
    STATE = 40,
};
/* The scale is tested with one matrix in so many and one more, or, where it was far from not serving, with fewer. */
#define SELDOM 3.0
#define RARELY 11.0
/* A scale serves as long as the largest entries of all rows are within this factor of 1; that far they are not far
 * from where it does not. */
#define STALE 1024.0
#define UNEASY 32.0

/* The pivots and tests of all parts of an elimination, of which each has its own state; 1 where one was refused. */
int64_t lane_state_put_together(int64_t parts, const double *restrict states, double *restrict state);

/* For each code the least magnitude anywhere, and in chosen stages the sum of logarithms, that of signs, how many.
 *
 * Coupling e is given[source[e]], scaled, between first[e] and second[e]; stages are of a kind, or -1. */
API void lane_state_note_entries(int64_t edges, const int32_t *restrict stage, const int64_t *restrict code,
                                 const int32_t *restrict kind, const int32_t *restrict chosen,
                                 const int64_t *restrict begins, const int64_t *restrict codes,
                                 const int32_t *restrict source, const int32_t *restrict first,
                                 const int32_t *restrict second, const double *restrict given,
                                 const double *restrict scale, double *restrict least, double *restrict logs,
                                 double *restrict signs, double *restrict many);

/* Whether the scale is to be tested with the matrix at hand. */
ALWAYS_INLINE int64_t lane_state_is_watched(double *restrict state) {
    state[UNWATCHED] -= 1.0;
    return state[UNWATCHED] < 0.0 ? 1 : 0;
}

/* How far from 1 the largest entries of rows in segments are, from what eliminate has noted of them. */
ALWAYS_INLINE double lane_state_spread_in(const double *restrict noted) {
    return dmax(largest8(load8(noted, 0)), -1.0 / largest8(load8(noted, 8)));
}

/* Note how far from 1 the largest entries of rows were when the scale was tested. */
ALWAYS_INLINE void lane_state_note_watched(double spread, double *restrict state) {
    state[UNWATCHED] = spread < UNEASY ? RARELY : SELDOM;
}

/* Whether factors that were not watched are not to be trusted, so that the scale has to be tested after all. */
ALWAYS_INLINE int64_t lane_state_is_doubtful(double *restrict state) {
    if (state[LANE_STATE_LARGEST] <= state[TRUSTED]) return 0;
    state[UNWATCHED] = 0.0;
    return 1;
}

/* Ask for what is so far ahead of some vectors of x, which are far numbers apart. */
ALWAYS_INLINE void lane_state_ask_ahead(int64_t distance, int64_t vectors, int64_t far, int64_t at,
                                        const double *restrict x) {
    if (distance > 0)
        for (int64_t k = 0; k < vectors; k++) prefetch8(x, at + distance + k * far);
}

/* Ask for what is so far behind some vectors of x, the last one first: processors foresee a steady descent. */
ALWAYS_INLINE void lane_state_ask_behind(int64_t distance, int64_t vectors, int64_t at, const double *restrict x) {
    if (distance > 0)
        for (int64_t k = 0; k < vectors; k++) prefetch8(x, at - distance + 8 * (vectors - 1 - k));
}

/* Copy some vectors of part to x from at on, past the caches when streamed. */
ALWAYS_INLINE void lane_state_put_vectors(int64_t streamed, int64_t vectors, const double *restrict part,
                                          int64_t at, double *restrict x) {
    if (streamed != 0)
        for (int64_t k = 0; k < vectors; k++) stream8(x, at + 8 * k, load8(part, 8 * k));
    else
        for (int64_t k = 0; k < vectors; k++) store8(x, at + 8 * k, load8(part, 8 * k));
}

#endif
