/* Vectors of eight lanes that are asked for before they are needed, or written past the caches.
 *
 * What an elimination in lanes is told and what it tells of itself, and when it tests the scale.
 *
 * All are numbers in one array, state, which compiled functions hand on to each other: whether pivots are to be
 * watched, the largest test of a pivot, how many pivots were negative, how far ahead memory is asked for.  Where several
 * parts of a matrix are eliminated side by side, each has a state of its own; put_together makes them one.
 *
 * The values that pivots of segments are planned from: one size for each entry of all stages of a kind. */
#include "../native.h"
#include "lane_state.h"

/* Smaller magnitudes count as this much, and a geometric mean near it as nothing. */
#define LANE_STATE_TINY 1e-12

int64_t lane_state_put_together(int64_t parts, const double *restrict states, double *restrict state) {
    state[COUNTED] = 0.0;
    state[LANE_STATE_LARGEST] = 0.0;
    for (int64_t part = 0; part < parts; part++) {
        const double *own = states + part * STATE;
        if (own[COUNTED] < 0.0) return 1;
        state[COUNTED] += own[COUNTED];
        state[LANE_STATE_LARGEST] = dmax(state[LANE_STATE_LARGEST], own[LANE_STATE_LARGEST]);
    }
    return 0;
}

/* Where in increasing codes one of them is. */
static int64_t place(int64_t code, int64_t begin, int64_t end, const int64_t *restrict codes) {
    int64_t low = begin;
    int64_t high = end;
    while (high - low > 1) {
        int64_t middle = (low + high) >> 1;
        if (codes[middle] <= code)
            low = middle;
        else
            high = middle;
    }
    return low;
}

void lane_state_note_entries(int64_t edges, const int32_t *restrict stage, const int64_t *restrict code,
                             const int32_t *restrict kind, const int32_t *restrict chosen,
                             const int64_t *restrict begins, const int64_t *restrict codes,
                             const int32_t *restrict source, const int32_t *restrict first,
                             const int32_t *restrict second, const double *restrict given,
                             const double *restrict scale, double *restrict least, double *restrict logs,
                             double *restrict signs, double *restrict many) {
    for (int64_t e = 0; e < edges; e++) {
        int64_t own = stage[e];
        if (own >= 0 && kind[imax(own, 0)] >= 0) {
            int64_t k = place(code[e], begins[kind[own]], begins[kind[own] + 1], codes);
            double value = given[source[e]] * (scale[first[e]] * scale[second[e]]);
            least[k] = dmin(least[k], fabs(value));
            if (chosen[own] != 0) {
                logs[k] += log(dmax(fabs(value), LANE_STATE_TINY));
                many[k] += 1.0;
                if (value > 0.0)
                    signs[k] += 1.0;
                else if (value < 0.0)
                    signs[k] -= 1.0;
            }
        }
    }
}
