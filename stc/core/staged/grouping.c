/* Consecutive pivots of a stage's order that are eliminated together, in panels (see panel.h).
 *
 * Together they have the rows that any of them has.  What that wastes on zeros is weighed against what every panel costs
 * besides: groups are the cheapest ones of an order (by dynamic programming over where they end), for costs in cycles as
 * measured. */
#include "../native.h"
#include "grouping.h"
#include "ordering.h"
#include "slot_sets.h"

/* Pivots of a group, in unknowns, at most. */
enum {
    MEMBERS = 16,
};
/* Cycles charged for a superfluous product, beyond those of the panel: it may be there for nothing later on, too. */
#define AVERSION 0.5

/* Cycles of a panel, about. */
ALWAYS_INLINE double cost(double members, double rows) {
    double length = members + rows;
    double moved = 2.0 * members * (0.5 * members + rows);
    double inside = 0.5 * members * members * (6.0 + 0.2 * length) + members * (60.0 + 0.8 * length);
    double update = 0.5 * rows * rows * (1.2 + members / 9.0) + rows * (8.0 + members);
    return 400.0 + moved + inside + update;
}

/* Where the group that ends before each place begins, in the cheapest sequence of groups. */
static void cut(int64_t count, int64_t top, const int32_t *restrict order, const int32_t *restrict kinds,
                const int32_t *restrict starts, const int32_t *restrict lists, const double *restrict work,
                int32_t *restrict mark, double *restrict best, int32_t *restrict cut) {
    int64_t stamp = 0;
    best[0] = 0.0;
    for (int64_t k = 0; k < top; k++) mark[k] = 0;
    for (int64_t end = 1; end < count + 1; end++) {
        best[end] = -1.0;
        if (end < count && kinds[end] == ORDERING_SECOND) continue;
        stamp++;
        int64_t rows = 0;
        double needed = 0.0;
        int64_t begin = end;
        while (begin > 0 && end - begin < MEMBERS) {
            begin--;
            needed += work[begin];
            for (int64_t k = starts[begin], end_k = starts[begin + 1]; k < end_k; k++) {
                int64_t slot = lists[k];
                if (mark[slot] != stamp) {
                    mark[slot] = (int32_t)stamp;
                    rows++;
                }
            }
            int64_t own = order[begin];
            if (mark[own] == stamp) rows--;
            mark[own] = (int32_t)stamp;
            if (kinds[begin] == ORDERING_SECOND) continue;
            double members = 1.0 * (end - begin);
            double total = best[begin] + cost(members, 1.0 * rows);
            /* Products of full columns, as if these were all there is to it, less those that are needed. */
            double length = rows + 0.5 * members;
            double full = 0.5 * members * (length * length + members * members / 12.0);
            total += AVERSION * dmax(full - needed, 0.0);
            if (best[end] < 0.0 || total < best[end]) {
                best[end] = total;
                cut[end] = (int32_t)begin;
            }
        }
    }
}

/* Eliminate a group from a pattern in its order: its rows; how many, or -1 less that where not all couple.
 *
 * sets and union_ are work space, (2 * words,) and (words,). */
static int64_t take_exactly(int64_t members, const int32_t *restrict order, const int32_t *restrict kinds,
                            int64_t words, int64_t *restrict bits, int64_t *restrict sets, int64_t *restrict union_,
                            int32_t *restrict rows) {
    for (int64_t w = 0; w < words; w++) union_[w] = 0;
    for (int64_t k = 0; k < members; k++) {
        if (kinds[k] != ORDERING_SECOND) {
            int64_t q = -1;
            if (kinds[k] == 2) q = order[k + 1];
            slot_sets_take_out(order[k], q, words, bits, sets);
            for (int64_t w = 0; w < words; w++) union_[w] |= sets[w] | sets[words + w];
        }
    }
    for (int64_t k = 0; k < members; k++) slot_sets_leave_out(order[k], union_);
    int64_t count = slot_sets_listed(words, union_, rows);
    for (int64_t k = 0; k < count; k++)
        if (slot_sets_missing(words, union_, bits + rows[k] * words) > 0) return -1 - count;
    return count;
}

/* Eliminate a group from a pattern and couple all its rows with each other; how many are surplus.
 *
 * Those are not among known (planned,). union_ is work space, (words,), and rows for all slots. */
static int64_t take_in_any_order(int64_t members, const int32_t *restrict order, int64_t words,
                                 int64_t *restrict bits, int64_t *restrict union_, int32_t *restrict rows,
                                 int64_t planned, const int32_t *restrict known, int32_t *restrict surplus) {
    for (int64_t w = 0; w < words; w++) union_[w] = 0;
    for (int64_t k = 0; k < members; k++) {
        int64_t *own = bits + order[k] * words;
        for (int64_t w = 0; w < words; w++) {
            union_[w] |= own[w];
            own[w] = 0;
        }
    }
    for (int64_t k = 0; k < members; k++) slot_sets_leave_out(order[k], union_);
    for (int64_t k = 0, end_k = slot_sets_listed(words, union_, rows); k < end_k; k++) {
        int64_t *row = bits + rows[k] * words;
        for (int64_t w = 0; w < words; w++) row[w] |= union_[w];
        for (int64_t e = 0; e < members; e++) slot_sets_leave_out(order[e], row);
    }
    for (int64_t k = 0; k < planned; k++) slot_sets_leave_out(known[k], union_);
    return slot_sets_listed(words, union_, surplus);
}

/* How many products each pivot needs when only what is there is multiplied; the pattern is lost. */
static void exact_work(int64_t count, const int32_t *restrict order, const int32_t *restrict kinds, int64_t words,
                       int64_t *restrict bits, int64_t *restrict sets, double *restrict work) {
    for (int64_t k = 0; k < count; k++) {
        work[k] = 0.0;
        if (kinds[k] == ORDERING_SECOND) continue;
        int64_t p = order[k];
        int64_t q = -1;
        if (kinds[k] == 2) q = order[k + 1];
        int64_t full_p = slot_sets_fills_own(q, words, bits);
        int64_t full_q = slot_sets_fills_own(p, words, bits);
        slot_sets_take_out(p, q, words, bits, sets);
        double size_p = 1.0 * slot_sets_size_of(words, sets);
        double size_q = 1.0 * slot_sets_size_of(words, sets + words);
        work[k] = size_p * size_q + 0.5 * full_p * size_p * size_p + 0.5 * full_q * size_q * size_q;
    }
}

int64_t grouping_group_stage(int64_t top, int64_t count, const int32_t *restrict order,
                             const int32_t *restrict kinds, const int32_t *restrict starts,
                             const int32_t *restrict lists, const double *restrict before, int64_t *restrict bits,
                             double *restrict sizes, double *restrict cover, int32_t *restrict mark,
                             int32_t *restrict found, double *restrict work, double *restrict best,
                             int32_t *restrict cut_, int32_t *restrict group, int32_t *restrict fixed,
                             int32_t *restrict group_starts, int32_t *restrict surplus_starts,
                             int32_t *restrict group_rows) {
    int64_t words = slot_sets_words_of(top);
    int64_t *sets = bits + top * words;
    int64_t *union_ = sets + 2 * words;
    slot_sets_note_rows(top, words, before, bits);
    exact_work(count, order, kinds, words, bits, sets, work);
    cut(count, top, order, kinds, starts, lists, work, mark, best, cut_);
    int64_t end = count;
    for (int64_t k = 0; k < count; k++) group[k] = 0;
    while (end > 0) {
        int64_t begin = cut_[end];
        group[begin] = (int32_t)(end - begin);
        end = begin;
    }
    int64_t used = 0;
    group_starts[0] = 0;
    slot_sets_note_rows(top, words, before, bits);
    for (int64_t k = 0; k < count; k++) {
        int64_t members = group[k];
        if (members > 0) {
            int64_t rows =
                take_exactly(members, order + k, kinds + k, words, bits, sets, union_, group_rows + used);
            fixed[k] = rows < 0;
            used += imax(rows, -1 - rows);
        }
        group_starts[k + 1] = (int32_t)used;
    }
    for (int64_t k = 0; k < top; k++) {
        for (int64_t e = 0, end_e = slot_sets_listed(words, bits + k * words, found); e < end_e; e++)
            if (sizes[k * top + found[e]] == 0.0) sizes[k * top + found[e]] = SMALLEST;
    }
    surplus_starts[0] = (int32_t)used;
    slot_sets_note_rows(top, words, cover, bits);
    for (int64_t k = 0; k < count; k++) {
        if (group[k] > 0) {
            int64_t begin = group_starts[k];
            used += take_in_any_order(group[k], order + k, words, bits, union_, found, group_starts[k + 1] - begin,
                                      group_rows + begin, group_rows + used);
        }
        surplus_starts[k + 1] = (int32_t)used;
    }
    for (int64_t k = 0; k < top; k++) {
        for (int64_t e = 0; e < top; e++) cover[k * top + e] = 0.0;
        for (int64_t e = 0, end_e = slot_sets_listed(words, bits + k * words, found); e < end_e; e++)
            cover[k * top + found[e]] = 1.0;
    }
    return used;
}
