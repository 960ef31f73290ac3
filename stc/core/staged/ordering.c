/* In which order to eliminate the unknowns of one stage, found by eliminating the sizes of its entries.
 *
 * Pivots of one and two unknowns (Duff and Reid 1983) are taken greedily: among those that should pass the threshold
 * test with a margin, the ones with few multiplications are compared by the entries that they add.  For a pivot on p and
 * q, whose columns have the patterns P and Q,
 *
 *     D^-1 = [ a_qq  -a_pq ] / det        fills  P x Q,   P x P if a_qq != 0,   Q x Q if a_pp != 0,
 *            [-a_pq   a_pp ]
 *
 * so that a row of the problem without diagonal, paired with a variable, costs little more than |P| |Q|.
 *
 * Sizes are entries of a stage like those to come in the window's slots, with their signs, zero where there is none: so
 * that pivots which always cancel, because fewer unknowns than these are behind them, are seen to.  An entry that cancels
 * is still an entry, if a tiny one. */
#include "../native.h"
#include "ordering.h"
#include "slot_sets.h"

enum {
    UNPLANNED = -1,
};
/* The thresholds that pivots are planned for are multiples of this. */
#define ORDERING_MARGIN 0.01
#define ORDERING_LARGEST 1e+30
/* Entries below this are no pivots at all. */
#define NEGLIGIBLE 1e-09
/* What may fail the test is planned only where nothing else is left: its cost is multiplied by this. */
#define PENALTY 1000000.0
/* Slots looked at in the search for one pivot, about. */
enum {
    EFFORT = 30000,
};

/* Slots coupled with p, without itself and left_out; their number. */
static int64_t column(int64_t p, int64_t left_out, int64_t top, const double *restrict sizes,
                      int32_t *restrict listed) {
    int64_t count = 0;
    const double *row = sizes + p * top;
    for (int64_t k = 0; k < top; k++) {
        listed[count] = (int32_t)k;
        count += row[k] != 0.0 && k != p && k != left_out;
    }
    return count;
}

/* Number of entries of a column, and the largest of them, both without the diagonal. */
static void measure(int64_t p, int64_t top, const double *restrict sizes, int32_t *restrict degree,
                    double *restrict most) {
    const double *row = sizes + p * top;
    int64_t count = 0;
    double high = 0.0;
    for (int64_t k = 0; k < top; k++) {
        double value = fabs(row[k]);
        count += value != 0.0;
        high = nanmax(high, value);
    }
    if (row[p] != 0.0) {
        count--;
        if (fabs(row[p]) >= high) {
            high = 0.0;
#pragma omp simd reduction(highest : high)
            for (int64_t k = 0; k < top; k++) high = nanmax(high, k != p ? fabs(row[k]) : 0.0);
        }
    }
    degree[p] = (int32_t)count;
    most[p] = high;
}

/* Largest entry of a column off the diagonal and outside left_out. */
static double largest(int64_t p, int64_t left_out, int64_t top, const double *restrict sizes,
                      const double *restrict most) {
    const double *row = sizes + p * top;
    double high = most[p];
    if (fabs(row[left_out]) == high) {
        high = 0.0;
#pragma omp simd reduction(highest : high)
        for (int64_t k = 0; k < top; k++) high = nanmax(high, k != p && k != left_out ? fabs(row[k]) : 0.0);
    }
    return high;
}

/* Multiplications of a 1x1 pivot, or -1. */
static double one_cost(int64_t p, double margin, int64_t top, const double *restrict sizes,
                       const int32_t *restrict degree, const double *restrict most) {
    double own = fabs(sizes[p * top + p]);
    double cost = -1.0;
    if (own > NEGLIGIBLE) {
        cost = 0.5 * degree[p] * (degree[p] + 1);
        if (own < margin * most[p]) cost = (cost + 1.0) * PENALTY;
    }
    return cost;
}

/* Multiplications per unknown of a 2x2 pivot, or -1; any number above limit when it is above. */
static double two_cost(int64_t p, int64_t q, double margin, int64_t top, const double *restrict sizes,
                       const int32_t *restrict degree, const double *restrict most, double limit) {
    double b = sizes[p * top + q];
    double a = sizes[p * top + p];
    double c = sizes[q * top + q];
    double determinant = fabs(a * c - b * b);
    if (fabs(b) <= NEGLIGIBLE || determinant < 0.5 * dmax(b * b, fabs(a * c))) return -1.0;
    double size_p = 1.0 * (degree[p] - 1);
    double size_q = 1.0 * (degree[q] - 1);
    double cost = size_p * size_q;
    if (a != 0.0) cost += 0.5 * size_q * (size_q + 1.0);
    if (c != 0.0) cost += 0.5 * size_p * (size_p + 1.0);
    cost *= 0.5;
    if (cost <= limit) {
        double most_p = largest(p, q, top, sizes, most);
        double most_q = largest(q, p, top, sizes, most);
        a = fabs(a);
        b = fabs(b);
        c = fabs(c);
        if (margin * dmax(c * most_p + b * most_q, b * most_p + a * most_q) > determinant)
            cost = (cost + 1.0) * PENALTY;
    }
    return cost;
}

/* Entries per unknown that the elimination of p, and of q when that is no less than 0, would add.
 *
 * bits: which entries each row has (see slot_sets.note_rows); sets: work space, (SETS * words,). */
static double added(int64_t p, int64_t q, int64_t words, int64_t top, const double *restrict sizes,
                    const int64_t *restrict bits, int64_t *restrict sets) {
    slot_sets_patterns(p, q, words, bits, sets);
    const int64_t *of_p = sets + 0;
    const int64_t *of_q = sets + words;
    int64_t *in_both = sets + 2 * words;
    int64_t *in_q_only = sets + 3 * words;
    bool full_p = q < 0;
    bool full_q = false;
    if (q >= 0) {
        full_p = sizes[q * top + q] != 0.0;
        full_q = sizes[p * top + p] != 0.0;
    }
    for (int64_t w = 0; w < words; w++) {
        in_both[w] = of_p[w] & of_q[w];
        in_q_only[w] = of_q[w] ^ in_both[w];
    }
    int64_t once = 0;
    int64_t twice = 0; /* pairs inside one set are met from either end, a diagonal once */
    for (int64_t w = 0; w < words; w++) {
        int64_t left = of_p[w] | of_q[w];
        while (left != 0) {
            int64_t one = slot_sets_lowest(left);
            left = left ^ one;
            int64_t i = slot_sets_slot_of(w, one);
            const int64_t *row = bits + i * words;
            int64_t own = sizes[i * top + i] == 0.0 ? 1 : 0;
            if ((of_p[w] & one) != 0) {
                if ((in_both[w] & one) != 0) {
                    once += slot_sets_missing(words, in_q_only, row);
                    if (!full_p) twice += slot_sets_missing(words, in_both, row) - own;
                } else {
                    /* With full_p, pairs of P and of both are counted again, which is too much by little. */
                    once += slot_sets_missing(words, of_q, row);
                }
                if (full_p) twice += slot_sets_missing(words, of_p, row) - own;
            } else if (full_q) {
                twice += slot_sets_missing(words, in_q_only, row) - own;
            }
        }
    }
    double added = once + 0.5 * twice;
    return q < 0 ? added : 0.5 * added;
}

/* The next pivot as p * (top + 1) + q + 1, q being -1 for a single one; -1 when there is none. */
static int64_t choose(int64_t done, int64_t count, const int32_t *restrict waiting, double margin, double compared,
                      int64_t top, const double *restrict sizes, const int32_t *restrict degree,
                      const double *restrict most, int32_t *restrict weak, int64_t words, int64_t *restrict bits,
                      int64_t candidates, int32_t *restrict first, int32_t *restrict second,
                      double *restrict costs) {
    double least = -1.0;
    int64_t found = 0;
    int64_t effort = 0;
    int64_t weak_count = 0; /* of those before, which may have to be paired */
    for (int64_t k = done; k < count; k++) {
        int64_t one = waiting[k];
        bool strong = fabs(sizes[one * top + one]) >= margin * most[one];
        double cost = one_cost(one, margin, top, sizes, degree, most);
        if (cost >= 0.0 && (least < 0.0 || cost <= compared * least + 2.0)) {
            least = least < 0.0 ? cost : dmin(least, cost);
            if (found < candidates) {
                first[found] = (int32_t)one;
                second[found] = -1;
                costs[found] = cost;
                found++;
            }
        }
        /* Two strong ones will do alone. */
        const int32_t *others = waiting + done;
        int64_t before = k - done;
        if (strong) {
            others = weak + 0;
            before = weak_count;
        }
        for (int64_t e = 0; e < before; e++) {
            int64_t other = others[e];
            if (effort > EFFORT) break;
            if (sizes[one * top + other] == 0.0) continue;
            double limit = least >= 0.0 ? compared * least + 2.0 : PENALTY;
            cost = two_cost(one, other, margin, top, sizes, degree, most, limit);
            if (cost >= 0.0 && (least < 0.0 || cost <= limit)) {
                effort += 2 * top;
                least = least < 0.0 ? cost : dmin(least, cost);
                if (found < candidates) {
                    first[found] = (int32_t)one;
                    second[found] = (int32_t)other;
                    costs[found] = cost;
                    found++;
                }
            }
        }
        if (!strong) {
            weak[weak_count] = (int32_t)one;
            weak_count++;
        }
    }
    double best = -1.0;
    int64_t chosen = -1;
    effort = 0;
    for (int64_t k = 0; k < found; k++) {
        if (costs[k] <= compared * least + 2.0 && effort <= EFFORT) {
            int64_t p = first[k];
            int64_t q = second[k];
            effort += ((int64_t)degree[p] * degree[p]) >> 1;
            if (q >= 0) effort += (int64_t)degree[p] * degree[q];
            double cost = added(p, q, words, top, sizes, bits, bits + top * words) + 0.001 * costs[k];
            if (best < 0.0 || cost < best) {
                best = cost;
                chosen = p * (top + 1) + q + 1;
            }
        }
    }
    return chosen;
}

/* The same where every order costs the same: single pivots as long as there are strong ones, the strongest first
 * where all are taken as they come. */
static int64_t choose_any(int64_t all_taken, int64_t done, int64_t count, const int32_t *restrict waiting,
                          double margin, int64_t top, const double *restrict sizes, const double *restrict most) {
    double best = margin;
    int64_t chosen = -1;
    for (int64_t k = done; k < count; k++) {
        int64_t p = waiting[k];
        double own = fabs(sizes[p * top + p]);
        if (own > NEGLIGIBLE && own >= best * most[p] && (all_taken != 0 || chosen < 0)) {
            best = own / dmax(most[p], SMALLEST);
            chosen = p;
        }
    }
    if (chosen >= 0) return chosen * (top + 1);
    for (int64_t k = done; k < count; k++) {
        int64_t p = waiting[k];
        int64_t q = -1;
        double size = NEGLIGIBLE;
        for (int64_t e = done; e < count; e++) {
            int64_t other = waiting[e];
            if (other != p && fabs(sizes[p * top + other]) > size) {
                size = fabs(sizes[p * top + other]);
                q = other;
            }
        }
        if (q >= 0) return p * (top + 1) + q + 1;
    }
    return -1;
}

/* An entry within the limits, and not zero. */
static double kept(double value) {
    return copysign(dmin(dmax(fabs(value), SMALLEST), ORDERING_LARGEST), value);
}

/* Subtract what the elimination of p, and of q when that is no less than 0, leaves behind. */
static void fill_pivot(int64_t p, int64_t q, double margin, int64_t top, double *restrict sizes,
                       const double *restrict most, int32_t *restrict row_p, int32_t *restrict row_q) {
    int64_t count = column(p, q, top, sizes, row_p);
    double a = sizes[p * top + p];
    if (q < 0) {
        double reciprocal = 1.0 / copysign(dmax(dmax(fabs(a), margin * most[p]), SMALLEST), a);
        for (int64_t k = 0; k < count; k++) {
            int64_t i = row_p[k];
            double by_row = sizes[i * top + p] * reciprocal;
            for (int64_t e = 0; e < k + 1; e++) {
                int64_t j = row_p[e];
                double value = kept(sizes[i * top + j] - by_row * sizes[j * top + p]);
                sizes[i * top + j] = value;
                sizes[j * top + i] = value;
            }
        }
        return;
    }
    /* The columns' common list. */
    for (int64_t k = 0, end_k = column(q, p, top, sizes, row_q); k < end_k; k++) {
        if (sizes[p * top + row_q[k]] == 0.0) {
            row_p[count] = row_q[k];
            count++;
        }
    }
    double b = sizes[p * top + q];
    double c = sizes[q * top + q];
    double determinant = a * (c / b) - b;
    for (int64_t k = 0; k < count; k++) {
        int64_t i = row_p[k];
        double of_p = (c / b * sizes[i * top + p] - sizes[i * top + q]) / determinant;
        double of_q = (a / b * sizes[i * top + q] - sizes[i * top + p]) / determinant;
        for (int64_t e = 0; e < k + 1; e++) {
            int64_t j = row_p[e];
            double product = of_p * sizes[j * top + p] + of_q * sizes[j * top + q];
            if (product != 0.0) {
                double value = kept(sizes[i * top + j] - product);
                sizes[i * top + j] = value;
                sizes[j * top + i] = value;
            }
        }
    }
}

/* Take a pivot's rows and columns out and append its column's slots to lists; their new length. */
static int64_t drop(int64_t p, int64_t q, int64_t top, double *restrict sizes, int64_t used,
                    int32_t *restrict lists) {
    for (int64_t k = 0; k < top; k++) {
        if (k != p && k != q) {
            bool touched = sizes[p * top + k] != 0.0;
            if (q >= 0) touched = touched || sizes[q * top + k] != 0.0;
            if (touched) {
                lists[used] = (int32_t)k;
                used++;
            }
        }
    }
    for (int64_t k = 0; k < top; k++) {
        sizes[p * top + k] = 0.0;
        sizes[k * top + p] = 0.0;
        if (q >= 0) {
            sizes[q * top + k] = 0.0;
            sizes[k * top + q] = 0.0;
        }
    }
    return used;
}

int64_t ordering_order_stage(int64_t top, int64_t count, int32_t *restrict waiting, double margin, double compared,
                             int64_t all_taken, double *restrict sizes, int32_t *restrict degree,
                             double *restrict most, int32_t *restrict row_p, int32_t *restrict row_q,
                             int64_t *restrict bits, int64_t candidates, int32_t *restrict first,
                             int32_t *restrict second, double *restrict costs, int32_t *restrict order,
                             int32_t *restrict kinds, int32_t *restrict starts, int64_t capacity,
                             int32_t *restrict lists) {
    int64_t words = slot_sets_words_of(top);
    slot_sets_note_rows(top, words, sizes, bits);
    for (int64_t k = 0; k < top; k++) measure(k, top, sizes, degree, most);
    int64_t done = 0;
    int64_t used = 0;
    bool full = false;
    starts[0] = 0;
    while (done < count) {
        if (used + top > capacity) return -1;
        int64_t chosen;
        if (full) {
            chosen = choose_any(all_taken, done, count, waiting, margin, top, sizes, most);
        } else {
            chosen = choose(done, count, waiting, margin, compared, top, sizes, degree, most, row_p, words, bits,
                            candidates, first, second, costs);
        }
        int64_t kind = 1;
        int64_t p = waiting[done];
        int64_t q = -1;
        if (chosen < 0) {
            kind = UNPLANNED;
        } else {
            p = floor_div(chosen, top + 1);
            q = floor_mod(chosen, top + 1) - 1;
            if (q >= 0) {
                kind = 2;
                /* The one without diagonal comes second: its zeros stay zeros. */
                if (fabs(sizes[p * top + p]) < fabs(sizes[q * top + q])) {
                    const int64_t old_p = p;
                    p = q;
                    q = old_p;
                }
            }
        }
        if (all_taken != 0 || !full) fill_pivot(p, q, margin, top, sizes, most, row_p, row_q);
        if (!full) {
            int64_t full_p = 1;
            int64_t full_q = 0;
            if (q >= 0) {
                full_p = sizes[q * top + q] != 0.0 ? 1 : 0;
                full_q = sizes[p * top + p] != 0.0 ? 1 : 0;
            }
            slot_sets_fill(p, q, full_p, full_q, words, bits, bits + top * words);
            /* Once a single pivot has coupled all that is left, nothing can be filled any more. */
            int64_t coupled = 0;
            for (int64_t k = 0; k < top; k++) coupled += degree[k] > 0;
            full = kind != 2 && degree[p] == coupled - 1;
        }
        degree[p] = 0;
        if (q >= 0) degree[q] = 0;
        used = drop(p, q, top, sizes, used, lists);
        if (all_taken != 0 || !full)
            for (int64_t k = starts[done]; k < used; k++) measure(lists[k], top, sizes, degree, most);
        for (int64_t member = 0; member < (kind == 2 ? 2 : 1); member++) {
            int64_t slot = member == 0 ? p : q;
            for (int64_t k = done; k < count; k++) {
                if (waiting[k] == slot) {
                    waiting[k] = waiting[done];
                    waiting[done] = (int32_t)slot;
                }
            }
            order[done] = (int32_t)slot;
            kinds[done] = (int32_t)(member == 0 ? kind : ORDERING_SECOND);
            done++;
            starts[done] = (int32_t)used;
        }
    }
    return used;
}
