/* Eight segments of the horizon eliminated at once, one in each lane of the vectors, stage by stage.
 *
 * All lanes take the same pivots in the same order, fixed before.  What is in work is a dense lower triangle of vectors,
 * row by row: entry (i, j), i >= j, of all eight lanes is at work[8 (i (i + 1) / 2 + j)].  Its rows are, in order,
 *
 *     U   unknowns of the stage, which are all eliminated
 *     F   unknowns of the next stage that couple with these
 *     L   states of the seam before the segment (see stc.solver.kkt.seams), which couple with its first stage
 *     B   unknowns that couple with every stage
 *
 * and F becomes part of the next step's U.  Pivots are taken in panels of unknowns that share their rows.
 *
 * In code, a panel is: how many members, how many rows; for each member 1, 2 for the first of a pair or 0 for the
 * second; the members; the rows, increasing; where C is in the triangle, member by member.
 *
 * What belongs to a group of eight segments is found by way of a table, FIELDS numbers for each group. */
#include "../native.h"
#include "../vec8.h"
#include "lane_panel.h"
#include "lane_runs.h"
#include "lane_state.h"
#include "lanes.h"

/* ... panels, and where they are in code; entries to be cleared before each step, before the first step, and those
 * that move (from, to); ... */
enum {
    LANES_CLEARED = 16,
    CLEARED_CODE = 17,
    EMPTY = 18,
    EMPTY_CODE = 19,
    LANES_MOVED = 20,
    MOVED_CODE = 21,
};
/* ... what is left at the end: how many entries, which, and where each lane's go (targets); ... */
enum {
    RESULTS = 22,
    RESULT_CODE = 23,
    RESULT_INDEX = 24,
};
/* ... where factors begin and how many vectors a step has; segments, the other lanes being copies of the first; where
 * the places of F in the next step's U, and the places of the panels in code, are listed in code; where the
 * scaled entries begin: those of L with the first stage, then the diagonal and the entries of each step; ... */
enum {
    ADDED = 31,
};
/* ... where index has the runs of the entries (see lane_runs.h), 0 where each step loads its own. */
enum {
    RUNS = 32,
};
/* Magnitudes below this are zeros. */
#define NOTHING 1e-300

/* Add or store scaled entries in the triangle, keep them, and note their magnitudes in both of their rows.
 *
 * And note in state whether they are finite: pivots need not tell.  They are in ring where they have been
 * brought. */
ALWAYS_INLINE void load_entries(int64_t distance, int64_t streamed, int64_t watched, int64_t added, int64_t brought,
                                int64_t count, const int32_t *restrict sources, const int32_t *restrict places,
                                const double *restrict given, const double *restrict ring,
                                const double *restrict scales, double *restrict matrix, double *restrict most,
                                double *restrict work, double *restrict state) {
    vec8 check = load8(state, LANE_STATE_CHECK);
    int64_t i = 0;
    vec8 scale_i = load8(scales, 0);
    vec8 most_i = load8(most, 0);
    for (int64_t k = 0; k < count; k++) {
        if (8 * (int64_t)places[3 * k + 1] != i) {
            if (watched != 0) store8(most, i, most_i);
            i = 8 * (int64_t)places[3 * k + 1];
            scale_i = load8(scales, i);
            if (watched != 0) most_i = load8(most, i);
        }
        int64_t j = 8 * (int64_t)places[3 * k + 2];
        vec8 value = splat8(0.0);
        if (brought != 0)
            value = load8(ring, 8 * k);
        else
            value = gather8(given, sources, 8 * k);
        value = mul8(mul8(value, scale_i), load8(scales, j));
        check = add_scaled8(check, 0.0, value);
        if (streamed != 0) {
            stream8(matrix, 8 * k, value);
        } else {
            store8(matrix, 8 * k, value);
            lane_state_ask_ahead(distance, 1, 0, 8 * k, matrix);
        }
        int64_t at = 8 * (int64_t)places[3 * k];
        if (added != 0)
            store8(work, at, add8(load8(work, at), value));
        else
            store8(work, at, value);
        if (watched != 0) {
            vec8 size = abs8(value);
            most_i = max8(size, most_i);
            store8(most, j, max8(size, load8(most, j)));
        }
    }
    if (watched != 0) store8(most, i, most_i);
    store8(state, LANE_STATE_CHECK, check);
}

/* Note how far the largest entries of a step's own rows are from 1, and carry over the others. */
ALWAYS_INLINE void watch_step(int64_t step, const int64_t *restrict group, const int32_t *restrict following,
                              double *restrict most, double *restrict spread) {
    int64_t own = group[OWN];
    vec8 high = load8(spread, 0);
    vec8 low = load8(spread, 8);
    for (int64_t k = 0; k < own; k++) {
        vec8 size = load8(most, 8 * k);
        size = add8(size, negative8(sub8(size, splat8(NOTHING))));
        high = max8(high, size);
        low = max8(low, neg8(size));
        store8(most, 8 * k, splat8(0.0));
    }
    store8(spread, 0, high);
    store8(spread, 8, low);
    if (step < group[LANES_STEPS] - 1) {
        for (int64_t k = 0; k < group[LANES_NEXT]; k++) {
            store8(most, 8 * (int64_t)following[k], load8(most, 8 * (own + k)));
            store8(most, 8 * (own + k), splat8(0.0));
        }
    }
}

/* Carry over what the step before has left, and add the scaled entries of the matrix. */
static void load_step(int64_t distance, int64_t streamed, int64_t fetched, int64_t watched, int64_t step,
                      const int64_t *restrict group, const int32_t *restrict index, const int32_t *restrict code,
                      const double *restrict diagonal, const double *restrict given, double *restrict ring,
                      const double *restrict scale, double *restrict work, double *restrict scales,
                      double *restrict matrix, double *restrict most, double *restrict spread,
                      double *restrict state) {
    int64_t own = group[OWN];
    int64_t near = own + group[LANES_NEXT];
    int64_t ends = group[LEFT] + group[LANES_BORDER];
    int64_t here = group[UNKNOWNS] + 8 * step * own;
    const int32_t *following = code + group[FOLLOWING];
    const int32_t *cleared = code + group[CLEARED_CODE];
    for (int64_t k = 0; k < group[LANES_CLEARED]; k++) store8(work, 8 * (int64_t)cleared[k], splat8(0.0));
    lanes_collect_own(step, group, scale, scales);
    lanes_collect_following(step, group, index, code, scale, scales);
    double *kept = matrix + 8 * group[LANES_MATRIX];
    if (step > 0) {
        const int32_t *moved = code + group[MOVED_CODE];
        for (int64_t k = 0; k < group[LANES_MOVED]; k++) {
            int64_t left = 8 * (int64_t)moved[2 * k];
            store8(work, 8 * (int64_t)moved[2 * k + 1], load8(work, left));
            store8(work, left, splat8(0.0));
        }
    } else {
        const int32_t *empty = code + group[EMPTY_CODE];
        for (int64_t k = 0; k < group[EMPTY]; k++) store8(work, 8 * (int64_t)empty[k], splat8(0.0));
        lanes_collect_ends(group, index, scale, scales);
        for (int64_t k = 0; k < near + ends; k++) store8(most, 8 * k, splat8(0.0));
        load_entries(distance, streamed, watched, 1, 0, group[LANES_FIRST], index + group[FIRST_INDEX],
                     code + group[FIRST_CODE], given, ring, scales, kept, most, work, state);
    }
    if (fetched != 0) lanes_ask_for_step(step, group, index, diagonal, given);
    int64_t count = group[LANES_ENTRIES];
    kept = kept + 8 * (group[LANES_FIRST] + step * (own + count));
    const int32_t *diagonals = index + here;
    for (int64_t k = 0; k < own; k++) {
        vec8 s = load8(scales, 8 * k);
        vec8 value = mul8(mul8(s, s), gather8(diagonal, diagonals, 8 * k));
        if (streamed != 0) {
            stream8(kept, 8 * k, value);
        } else {
            store8(kept, 8 * k, value);
            lane_state_ask_ahead(distance, 1, 0, 8 * k, kept);
        }
        int64_t at = 4 * k * (k + 3);
        store8(work, at, add8(load8(work, at), value));
        if (watched != 0) store8(most, 8 * k, max8(abs8(value), load8(most, 8 * k)));
    }
    int64_t added = group[ADDED];
    const int32_t *sources = index + group[ENTRY_INDEX] + 8 * step * count;
    const int32_t *places = code + group[ENTRY_CODE];
    kept = kept + 8 * own;
    if (group[RUNS] > 0) {
        lane_runs_bring_entries(step, group[LANES_STEPS], count, index + group[RUNS], index + group[ENTRY_INDEX],
                                given, ring);
        const double *own_ring = ring + 8 * count * floor_mod(step, RUN);
        load_entries(distance, streamed, watched, 1, 1, added, sources, places, given, own_ring, scales, kept, most,
                     work, state);
        load_entries(distance, streamed, watched, 0, 1, count - added, sources, places + 3 * added, given,
                     own_ring + 8 * added, scales, kept + 8 * added, most, work, state);
    } else {
        load_entries(distance, streamed, watched, 1, 0, added, sources, places, given, ring, scales, kept, most,
                     work, state);
        load_entries(distance, streamed, watched, 0, 0, count - added, sources + 8 * added, places + 3 * added,
                     given, ring, scales, kept + 8 * added, most, work, state);
    }
    if (watched != 0) watch_step(step, group, following, most, spread);
}

int64_t lanes_eliminate(int64_t groups, const int64_t *restrict table, const int32_t *restrict index,
                        const int32_t *restrict code, double growth, double suspect, const double *restrict given,
                        double *restrict ring, const double *restrict diagonal, const double *restrict scale,
                        double *restrict result, double *restrict work, double *restrict scales,
                        double *restrict known, double *restrict made, double *restrict matrix, int64_t watched,
                        double *restrict most, double *restrict outer_most, double *restrict spread,
                        double *restrict factors, double *restrict state) {
    double negative = 0.0;
    int64_t distance = (int64_t)state[DISTANCE];
    int64_t streamed = (int64_t)state[STREAMED];
    int64_t fetched = (int64_t)state[FETCHED];
    int64_t writing = streamed != 0 ? 0 : distance;
    state[LANE_STATE_LARGEST] = 0.0;
    store8(state, LANE_STATE_CHECK, splat8(0.0));
    for (int64_t g = 0; g < groups; g++) {
        const int64_t *group = table + g * LANES_FIELDS;
        for (int64_t k = 0; k < LANE_STATE_LARGEST; k++) state[k] = 0.0;
        int64_t at = 8 * group[LANES_FACTORS];
        for (int64_t step = 0; step < group[LANES_STEPS]; step++) {
            load_step(distance, streamed, fetched, watched, step, group, index, code, diagonal, given, ring, scale,
                      work, scales, matrix, most, spread, state);
            const int32_t *panel = code + group[PANEL_CODE];
            for (int64_t panel_ = 0; panel_ < group[LANES_PANELS]; panel_++) {
                int64_t members = panel[0];
                int64_t count = panel[1];
                const int32_t *rows = panel + 2 + 2 * members;
                double *kept = factors + at;
                if (streamed != 0) kept = made + 0;
                lane_panel_take_panel(writing, streamed, members, count, panel + 2, rows, rows + count, growth,
                                      suspect, work, known, kept, factors + at, state);
                panel = rows + count + members * (members + count);
                at += 8 * lane_panel_panel_vectors(members, count);
            }
            if (!(largest8(load8(state, WORST)) < 1.0)) return -1;
        }
        if (sum8(load8(state, LANE_STATE_CHECK)) != 0.0 || (watched != 0 && lane_state_spread_in(spread) > STALE))
            return -1; /* what is left would be in vain */
        state[LANE_STATE_LARGEST] = nanmax(state[LANE_STATE_LARGEST], largest8(load8(state, WORST)));
        for (int64_t lane = 0; lane < group[SEGMENTS]; lane++) {
            negative += state[LANE_STATE_NEGATIVE + lane];
            const int32_t *places = code + group[RESULT_CODE];
            const int32_t *targets = index + group[RESULT_INDEX];
            for (int64_t k = 0; k < group[RESULTS]; k++) {
                int64_t target = targets[8 * k + lane];
                double value = work[8 * (int64_t)places[k] + lane];
                if (target >= 0)
                    result[target] += value;
                else
                    result[-1 - target] -= value;
            }
        }
        if (watched != 0) lanes_note_outside(group, index, most, outer_most);
    }
    return (int64_t)negative;
}
