/* Pivots of one and two unknowns: which are acceptable, and taking them out of the window.
 *
 * Factors: pivot k takes out the positions pivots[2 k] and, when 2x2, pivots[2 k + 1] (otherwise -1).  Its
 * rows, starts[2 k + 1] of them, begin at indices[starts[2 k]]; their factors follow those of the pivot before:
 * when 2x2 those of the first unknown, then those of the second.  inverse[3 k:3 k + 3] is D^-1 as (pp, pq, qq).
 *
 * Leaves are unknowns whose columns are still as in the matrix when they are eliminated.  Nothing is stored for them:
 * starts[2 k + 1] is -1 less their rows, which are columns[starts[2 k]] and on, and their factors the values there
 * times D^-1.
 *
 * growth of a slot is the largest product subtracted from its column so far, at least 1: what remains of a column
 * after cancellation is worth no more than rounding errors of that size. */
#include "../native.h"
#include "pivots.h"
#include "window.h"

/* The larger share of the diagonal for which Bunch and Parlett prefer a 1x1 pivot. */
#define BUNCH_PARLETT 0.64

int64_t pivots_best_partner(int64_t count, const int32_t *restrict found, const double *restrict values,
                            const int32_t *restrict owner, int64_t last) {
    int64_t best = -1;
    double most = 0.0;
    for (int64_t k = 0; k < count; k++) {
        double value = fabs(values[k]);
        if (value > most && owner[found[k]] < last) {
            most = value;
            best = k;
        }
    }
    return best;
}

int64_t pivots_pair_up(int64_t row_p, int64_t row_q, double a, double b, double c, int64_t swapped,
                       double threshold, double noise, int64_t count, const int32_t *restrict found_1,
                       const double *restrict values_1, int64_t top, int64_t low, int64_t high, int64_t stride,
                       const double *restrict window, int32_t *restrict found_2, double *restrict values_2,
                       int32_t *restrict found, double *restrict first, double *restrict second) {
    int64_t others = window_gather(row_q, top, low, high, stride, window, found_2, values_2);
    int64_t union_ = 0;
    if (swapped != 0) {
        union_ =
            window_merge(others, found_2, values_2, row_p, count, found_1, values_1, row_q, found, first, second);
    } else {
        union_ =
            window_merge(count, found_1, values_1, row_q, others, found_2, values_2, row_p, found, first, second);
    }
    double most_p = window_largest(union_, first);
    double most_q = window_largest(union_, second);
    int64_t good = 0;
    if (swapped != 0)
        good = pivots_pair_accepted(c, b, a, most_p, most_q, threshold, noise);
    else
        good = pivots_pair_accepted(a, b, c, most_p, most_q, threshold, noise);
    return good != 0 ? union_ : -1;
}

int64_t pivots_take_one(int64_t p, double d, double most, int64_t count, const int32_t *restrict listed,
                        const double *restrict first, int64_t capacity, const int32_t *restrict slot,
                        const int32_t *restrict owner, double *restrict growth, int64_t stride,
                        double *restrict window, double *restrict spread, int32_t *restrict pivots,
                        int32_t *restrict starts, int32_t *restrict indices, double *restrict factors,
                        double *restrict inverse, int64_t *restrict counts) {
    int64_t k = counts[PIVOTS];
    int64_t at = counts[INDICES];
    int64_t value_at = counts[PIVOTS_FACTORS];
    if (at + count > capacity || value_at + count > capacity) return 0;
    double reciprocal = 1.0 / d;
    int32_t *own = indices + at;
    double *column = factors + value_at;
    for (int64_t e = 0; e < count; e++) {
        int64_t other = listed[e];
        double factor = first[e] * reciprocal;
        own[e] = owner[other];
        column[e] = factor;
        growth[other] = dmax(growth[other], fabs(factor) * most);
    }
    window_clear(slot[p], count, listed, stride, window);
    window_subtract_one(count, listed, first, column, stride, spread, window);
    pivots[2 * k] = (int32_t)p;
    pivots[2 * k + 1] = -1;
    inverse[3 * k] = reciprocal;
    starts[2 * k] = (int32_t)at;
    starts[2 * k + 1] = (int32_t)count;
    counts[d > 0.0 ? POSITIVE : PIVOTS_NEGATIVE]++;
    counts[PIVOTS] = k + 1;
    counts[INDICES] = at + count;
    counts[PIVOTS_FACTORS] = value_at + count;
    return 1;
}

int64_t pivots_take_two(int64_t p, int64_t q, double a, double b, double c, int64_t count,
                        const int32_t *restrict listed, const double *restrict first, const double *restrict second,
                        int64_t capacity, const int32_t *restrict slot, const int32_t *restrict owner,
                        double *restrict growth, int64_t stride, double *restrict window, double *restrict spread_1,
                        double *restrict spread_2, int32_t *restrict pivots, int32_t *restrict starts,
                        int32_t *restrict indices, double *restrict factors, double *restrict inverse,
                        int64_t *restrict counts) {
    int64_t k = counts[PIVOTS];
    int64_t at = counts[INDICES];
    int64_t value_at = counts[PIVOTS_FACTORS];
    if (at + count > capacity || value_at + 2 * count > capacity) return 0;
    double ratio = pivots_reciprocal_determinant(a, b, c);
    double inverse_pp = c * ratio;
    double inverse_pq = -b * ratio;
    double inverse_qq = a * ratio;
    double most_p = window_largest(count, first);
    double most_q = window_largest(count, second);
    int32_t *own = indices + at;
    double *column = factors + value_at;
    for (int64_t e = 0; e < count; e++) {
        int64_t other = listed[e];
        double factor_1 = inverse_pp * first[e] + inverse_pq * second[e];
        double factor_2 = inverse_pq * first[e] + inverse_qq * second[e];
        own[e] = owner[other];
        column[e] = factor_1;
        column[count + e] = factor_2;
        growth[other] = dmax(growth[other], fabs(factor_1) * most_p + fabs(factor_2) * most_q);
    }
    int64_t row_p = slot[p];
    int64_t row_q = slot[q];
    window_clear(row_p, count, listed, stride, window);
    window_clear(row_q, count, listed, stride, window);
    window[imax(row_p, row_q) * stride + imin(row_p, row_q)] = 0.0;
    window_subtract_two(count, listed, first, second, column, column + count, stride, spread_1, spread_2, window);
    pivots[2 * k] = (int32_t)p;
    pivots[2 * k + 1] = (int32_t)q;
    inverse[3 * k] = inverse_pp;
    inverse[3 * k + 1] = inverse_pq;
    inverse[3 * k + 2] = inverse_qq;
    starts[2 * k] = (int32_t)at;
    starts[2 * k + 1] = (int32_t)count;
    if (a * c < b * b) {
        counts[POSITIVE]++;
        counts[PIVOTS_NEGATIVE]++;
    } else {
        counts[a > 0.0 ? POSITIVE : PIVOTS_NEGATIVE] += 2;
    }
    counts[PIVOTS] = k + 1;
    counts[INDICES] = at + count;
    counts[PIVOTS_FACTORS] = value_at + 2 * count;
    return 1;
}

int64_t pivots_strongest(int64_t waiting, const int32_t *restrict queue, int64_t top, int64_t low, int64_t high,
                         int64_t stride, const int32_t *restrict slot, const double *restrict window,
                         int32_t *restrict found, double *restrict values) {
    double diagonal = -1.0;
    double other = -1.0;
    int64_t p = queue[0];
    int64_t pair = queue[0];
    for (int64_t place = 0; place < waiting; place++) {
        int64_t row = slot[queue[place]];
        if (row < 0) continue;
        double value = fabs(window[row * stride + row]);
        if (value > diagonal) {
            diagonal = value;
            p = queue[place];
        }
        int64_t count = window_gather(row, top, low, high, stride, window, found, values);
        value = window_largest(count, values);
        if (value > other) {
            other = value;
            pair = queue[place];
        }
    }
    return diagonal >= BUNCH_PARLETT * other ? p : -1 - pair;
}
