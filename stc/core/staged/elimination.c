/* LDL^T of a sparse symmetric matrix in a window that slides over the stages, with threshold pivoting.
 *
 * At each stage the rows of its unknowns are added to the window, and the unknowns are taken out in the planned
 * order by 1x1 and 2x2 pivots:
 *
 *     1x1   d = a_pp                 accepted when  |d| >= u max_j |a_pj|
 *     2x2   D = [a_pp a_pq]          accepted when  |D^-1| [max_j |a_pj|] <= 1/u  (in each row)
 *               [a_pq a_qq]                                [max_j |a_qj|]
 *
 * (Duff and Reid 1983), so no factor exceeds 1/u.  What is not accepted is tried again after the others, then delayed
 * to the next stage; at the last one, pivots are chosen by size alone (Bunch and Parlett 1971).  The entries are
 * expected equilibrated, near 1.
 *
 * Columns are gathered along the planned lists of slots; what to do where not all goes to plan is found in
 * window.h. */
#include "../native.h"
#include "elimination.h"
#include "panel.h"
#include "pivots.h"
#include "window.h"

/* Results of factorize. */
enum {
    ELIMINATION_DONE = 0,
    FACTORS_FULL = 1,
    WINDOW_FULL = 2,
    HOPELESS = 3,
};
/* Rounds over the candidates of a stage before the rest is delayed. */
enum {
    ROUNDS = 3,
};
/* Thresholds below this are not tried. */
#define LOWEST_THRESHOLD 1e-10

/* Give the entering positions their slots. */
static void enter(int64_t first, int64_t last, const int32_t *restrict entering, const int32_t *restrict slot,
                  int32_t *restrict owner, double *restrict growth) {
    for (int64_t k = first; k < last; k++) {
        int64_t own = slot[entering[k]];
        owner[own] = entering[k];
        growth[own] = 1.0;
    }
}

/* Add the rows of the positions from first to last to the window. */
static void assemble(int64_t first, int64_t last, int64_t size, const int32_t *restrict pointers,
                     const int32_t *restrict targets, const double *restrict values, double *restrict window) {
    for (int64_t k = first; k < last; k++) window[targets[k]] += values[k];
    for (int64_t e = size + pointers[first]; e < size + pointers[last]; e++) window[targets[e]] += values[e];
}

/* Eliminate a position whose column is still as in the matrix; 0 when it is no good pivot. */
static int64_t take_leaf(int64_t p, double threshold, double tiny, int64_t begin, int64_t count,
                         const int32_t *restrict columns, double diagonal, const double *restrict upper,
                         const int32_t *restrict slot, double *restrict growth, int64_t stride,
                         double *restrict window, int32_t *restrict pivots, int32_t *restrict starts,
                         double *restrict inverse, int64_t *restrict counts) {
    double most = 0.0;
    for (int64_t e = 0; e < count; e++) most = dmax(most, fabs(upper[e]));
    if (fabs(diagonal) < threshold * most || fabs(diagonal) <= tiny) return 0;
    int64_t k = counts[PIVOTS];
    double reciprocal = 1.0 / diagonal;
    for (int64_t e = 0; e < count; e++) {
        int64_t own = slot[columns[e]];
        double factor = upper[e] * reciprocal;
        growth[own] = dmax(growth[own], fabs(factor) * most);
        for (int64_t before = 0; before < e + 1; before++) {
            int64_t other = slot[columns[before]];
            window[imax(own, other) * stride + imin(own, other)] -= factor * upper[before];
        }
    }
    pivots[2 * k] = (int32_t)p;
    pivots[2 * k + 1] = -1;
    starts[2 * k] = (int32_t)begin;
    starts[2 * k + 1] = (int32_t)(-1 - count);
    inverse[3 * k] = reciprocal;
    counts[diagonal > 0.0 ? POSITIVE : PIVOTS_NEGATIVE]++;
    counts[PIVOTS] = k + 1;
    return 1;
}

/* Move a delayed unknown out of the planned slots to the first free one from low; new end, or -1. */
static int64_t hold(int64_t p, int64_t top, int64_t low, int64_t high, int64_t stride, int32_t *restrict slot,
                    int32_t *restrict owner, double *restrict growth, double *restrict window,
                    int32_t *restrict found, double *restrict values) {
    int64_t old = slot[p];
    if (old >= low) return high;
    int64_t new = low;
    while (new < high && owner[new] >= 0 && slot[owner[new]] == new) new++;
    if (new >= stride) return -1;
    double d = window[old * stride + old];
    int64_t count = window_gather(old, top, low, high, stride, window, found, values);
    window_clear(old, count, found, stride, window);
    for (int64_t k = 0; k < count; k++) {
        int64_t other = found[k];
        window[imax(other, new) * stride + imin(other, new)] = values[k];
    }
    window[new * stride + new] = d;
    slot[p] = (int32_t)new;
    owner[new] = (int32_t)p;
    growth[new] = growth[old];
    return imax(high, new + 1);
}

int64_t elimination_factorize(
    int64_t size, int64_t stages, int64_t variables, double threshold, double tiny, double replacement,
    int64_t delay_limit, int64_t most_held, int64_t capacity, int64_t stride, int64_t held_from, int64_t planned,
    const int32_t *restrict stage_pointers, const int32_t *restrict pointers, const int32_t *restrict columns,
    const double *restrict values, const int32_t *restrict order, const int32_t *restrict planned_slot,
    const int32_t *restrict targets, const int32_t *restrict enter_pointers, const int32_t *restrict entering,
    const int32_t *restrict inner_top, const int32_t *restrict top, const int32_t *restrict plan_kind,
    const int32_t *restrict plan_group, const int32_t *restrict plan_start, const int32_t *restrict plan_count,
    const int32_t *restrict surplus_start, const int32_t *restrict surplus_count,
    const int32_t *restrict plan_slots, const int32_t *restrict state, const int32_t *restrict state_starts,
    const int32_t *restrict state_rows, const int32_t *restrict state_columns, double *restrict window,
    double *restrict panel, double *restrict lower, double *restrict sums, const double *restrict masks,
    double *restrict spread_1, double *restrict spread_2, int32_t *restrict slot, int32_t *restrict owner,
    double *restrict growth, int32_t *restrict queue, int32_t *restrict found_1, int32_t *restrict found_2,
    int32_t *restrict found_12, double *restrict values_1, double *restrict values_2, double *restrict first_12,
    double *restrict second_12, int32_t *restrict pivots, int32_t *restrict starts, int32_t *restrict indices,
    double *restrict factors, double *restrict inverse, int64_t *restrict counts) {
    for (int64_t k = 0; k < COUNTS; k++) counts[k] = 0;
    for (int64_t k = 0; k < stride; k++) owner[k] = -1;
    for (int64_t k = 0; k < size; k++) slot[k] = planned_slot[k];
    int64_t held = 0;
    int64_t high = held_from;
    bool exact = planned != 0;
    for (int64_t stage = 0; stage < stages; stage++) {
        int64_t begin = stage_pointers[stage];
        int64_t end = stage_pointers[stage + 1];
        int64_t slots_top = inner_top[stage];
        bool last_stage = stage == stages - 1;
        if (!exact && planned != 0 && held == 0) {
            /* The column lists hold again as soon as nothing is in the window but what the plan expects. */
            int64_t others = state_starts[state[stage]];
            exact = 0 != window_only_planned(state_starts[state[stage] + 1] - others, state_rows + others,
                                             state_columns + others, stride, window);
        }
        enter(enter_pointers[stage], enter_pointers[stage + 1], entering, slot, owner, growth);
        int64_t waiting = held;
        int64_t position = begin;
        while (position < end && plan_group[position] < 0) {
            int64_t at = pointers[position];
            int64_t taken = take_leaf(position, threshold, tiny, at, pointers[position + 1] - at, columns + at,
                                      values[position], values + size + at, slot, growth, stride, window, pivots,
                                      starts, inverse, counts);
            if (taken != 0) {
                slot[position] = (int32_t)(-1 - stage);
            } else {
                exact = false;
                slots_top = top[stage];
                assemble(position, position + 1, size, pointers, targets, values, window);
                queue[waiting] = (int32_t)position;
                waiting++;
            }
            position++;
        }
        assemble(position, end, size, pointers, targets, values, window);
        while (position < end) {
            int64_t planned_here = plan_group[position];
            int64_t members = planned_here;
            for (int64_t k = 0; k < members; k++) found_1[k] = (int32_t)(position + k);
            int64_t count = imax(plan_count[position], -1 - plan_count[position]);
            const int32_t *listed = plan_slots + plan_start[position];
            if (!exact) {
                members = window_adopt(members, found_1, waiting, queue, slot, stride, window);
                count = window_list_rows(members, found_1, waiting, queue, slot, stride, window, count, listed,
                                         surplus_count[position], plan_slots + surplus_start[position], found_2);
                listed = found_2 + 0;
            }
            int64_t taken =
                panel_take_group(planned_here, members, found_1, count, listed, plan_kind + position, stage,
                                 threshold, tiny, capacity, stride, window, slot, owner, growth, found_12, panel,
                                 lower, values_1, sums, masks, pivots, starts, indices, factors, inverse, counts);
            if (taken < 0) return FACTORS_FULL;
            if (taken >= PANEL_CHANGED) {
                taken -= PANEL_CHANGED;
                if (plan_count[position] < 0) exact = false;
            }
            if (taken < members) {
                exact = false;
                for (int64_t k = 0; k < planned_here; k++) {
                    if (slot[position + k] >= 0) {
                        queue[waiting] = (int32_t)(position + k);
                        waiting++;
                    }
                }
            }
            position += planned_here;
        }
        double needed = threshold;
        int64_t forced = -1;
        bool forced_pair = false;
        bool hopeless = false;
        int64_t rounds = 0;
        while (waiting > 0) {
            int64_t kept = 0;
            bool progress = false;
            for (int64_t place = 0; place < waiting; place++) {
                int64_t p = queue[place];
                int64_t row_p = slot[p];
                if (row_p < 0) continue;
                double a = window[row_p * stride + row_p];
                double b = 0.0;
                double c = 0.0;
                double most = 0.0;
                double noise = tiny * growth[row_p];
                int64_t q = -1;
                int64_t size_of_pivot = 0;
                int64_t count = 0;
                const int32_t *listed = found_1 + 0;
                const double *first = values_1 + 0;
                const double *second = values_2 + 0;
                if (size_of_pivot == 0) {
                    double accepted = needed;
                    noise = tiny * growth[row_p];
                    listed = found_1 + 0;
                    count = window_gather(row_p, slots_top, held_from, high, stride, window, found_1, values_1);
                    most = window_largest(count, values_1);
                    if (p == forced) {
                        accepted = 0.0;
                        for (int64_t k = 0; k < count; k++) noise = dmax(noise, tiny * growth[found_1[k]]);
                    }
                    if (dmax(most, fabs(a)) <= noise || (p == forced && hopeless)) {
                        counts[ZERO]++;
                        window_clear(row_p, count, listed, stride, window);
                        count = 0;
                        most = 0.0;
                        /* Counted as zero, and not by the sign of what takes its place. */
                        a = order[p] < variables ? replacement : -replacement;
                        counts[a > 0.0 ? POSITIVE : PIVOTS_NEGATIVE]--;
                        size_of_pivot = 1;
                    }
                    /* The planned partner first, then alone, then with the strongest partner. */
                    int64_t planned_partner = -1;
                    if (plan_kind[p] == 2)
                        planned_partner = slot[p + 1];
                    else if (plan_kind[p] == 0)
                        planned_partner = slot[p - 1];
                    for (int64_t attempt = 0; attempt < 3; attempt++) {
                        if (size_of_pivot != 0 || (p == forced && attempt == 0)) continue;
                        if (attempt == 1) {
                            bool enough = fabs(a) >= accepted * most && fabs(a) > noise;
                            if (p != forced ? enough : !forced_pair) size_of_pivot = 1;
                            continue;
                        }
                        int64_t best = -1;
                        if (attempt == 2)
                            best = pivots_best_partner(count, found_1, values_1, owner, end);
                        else if (planned_partner >= 0)
                            best = pivots_place_of(planned_partner, count, found_1);
                        if (best >= 0) {
                            int64_t row_q = found_1[best];
                            b = values_1[best];
                            c = window[row_q * stride + row_q];
                            double least = p == forced ? 0.0 : dmax(noise, tiny * growth[row_q]);
                            bool swapped = a == 0.0 && c != 0.0;
                            int64_t union_ =
                                pivots_pair_up(row_p, row_q, a, b, c, swapped, accepted, least, count, found_1,
                                               values_1, slots_top, held_from, high, stride, window, found_2,
                                               values_2, found_12, first_12, second_12);
                            if (union_ >= 0) {
                                size_of_pivot = 2;
                                count = union_;
                                listed = found_12 + 0;
                                first = first_12 + 0;
                                second = second_12 + 0;
                                q = owner[row_q];
                                if (swapped) {
                                    const int64_t old_p = p;
                                    p = q;
                                    q = old_p;
                                    const double old_a = a;
                                    a = c;
                                    c = old_a;
                                }
                            }
                        }
                    }
                }
                if (size_of_pivot == 0) {
                    counts[REJECTED]++;
                    queue[kept] = queue[place];
                    kept++;
                    continue;
                }
                progress = true;
                int64_t room = 1;
                if (size_of_pivot == 2) {
                    room = pivots_take_two(p, q, a, b, c, count, listed, first, second, capacity, slot, owner,
                                           growth, stride, window, spread_1, spread_2, pivots, starts, indices,
                                           factors, inverse, counts);
                    slot[q] = (int32_t)(-1 - stage);
                } else {
                    room = pivots_take_one(p, a, most, count, listed, first, capacity, slot, owner, growth, stride,
                                           window, spread_1, pivots, starts, indices, factors, inverse, counts);
                }
                slot[p] = (int32_t)(-1 - stage);
                if (room == 0) return FACTORS_FULL;
            }
            waiting = kept;
            rounds++;
            /* What has overflowed is no pivot even when forced, and counts as zero. */
            hopeless = forced >= 0 && !progress;
            if (hopeless) continue;
            forced = -1;
            if (last_stage) {
                if (!progress && waiting > 0) {
                    exact = false;
                    forced = pivots_strongest(waiting, queue, slots_top, held_from, high, stride, slot, window,
                                              found_1, values_1);
                    forced_pair = forced < 0;
                    if (forced_pair) forced = -1 - forced;
                }
            } else if (!progress || rounds >= ROUNDS) {
                if (needed <= LOWEST_THRESHOLD && waiting > most_held) {
                    counts[ZERO] = size - counts[POSITIVE] - counts[PIVOTS_NEGATIVE];
                    return HOPELESS;
                }
                if (waiting <= delay_limit || needed <= LOWEST_THRESHOLD) break;
                needed *= progress ? 0.1 : 0.001;
            }
        }
        if (!exact) counts[STRAYED]++;
        held = 0;
        for (int64_t place = 0; place < waiting; place++) {
            int64_t p = queue[place];
            if (slot[p] < 0) continue;
            queue[held] = (int32_t)p;
            held++;
            if (slot[p] < held_from) {
                counts[DELAYED]++;
                high = hold(p, slots_top, held_from, high, stride, slot, owner, growth, window, found_1, values_1);
                if (high < 0) return WINDOW_FULL;
            }
        }
        if (held == 0)
            high = held_from;
        else
            exact = false;
    }
    return ELIMINATION_DONE;
}
