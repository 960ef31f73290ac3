/* A panel: the columns of several pivots out of the window at once, and one update of the window by all of them.
 *
 *     group       k1 k2 k3 | rows r1 r2 r3 ...         row t of panel is the column of pivot t: what is left of it
 *                                                      when the pivots before have been taken out; row t of
 *                 ( d . .  |  .  .  .  )               lower is the same times D^-1, the factors.
 *                 ( . d .  |  .  .  .  )
 *                 ( . . d  |  .  .  .  )               window[rows, rows] -= lower[:, rows]^T panel[:, rows]
 *
 * Inside the group, pivots that fail the threshold test are tried again after the others and with other partners: where
 * the plan has all of rows x rows filled, the order inside a group is free.  Rows are padded to whole vectors. */
#include "../native.h"
#include "../vec8.h"
#include "panel.h"
#include "pivots.h"

/* Numbers of a vector. */
enum {
    VECTOR = 8,
};

/* Move the members' columns to the panel, leaving zeros. */
static void gather(int64_t members, const int32_t *restrict slots, int64_t count, const int32_t *restrict rows,
                   int64_t length, int64_t stride, double *restrict window, double *restrict panel) {
    for (int64_t k = 0; k < members; k++) {
        int64_t own = slots[k];
        store8(panel, (k + 1) * length - VECTOR, splat8(0.0));
        for (int64_t j = 0; j < k + 1; j++) {
            int64_t other = slots[j];
            int64_t at = imax(own, other) * stride + imin(own, other);
            double value = window[at];
            window[at] = 0.0;
            panel[k * length + j] = value;
            panel[j * length + k] = value;
        }
        double *out = panel + k * length + members;
        double *row = window + own * stride;
        double *column = window + own;
        int64_t below = 0;
        while (below < count && rows[below] < own) {
            int64_t other = rows[below];
            out[below] = row[other];
            row[other] = 0.0;
            below++;
        }
        for (int64_t e = below; e < count; e++) {
            int64_t other = rows[e] * stride;
            out[e] = column[other];
            column[other] = 0.0;
        }
    }
}

/* Return the columns of the members from first to the window. */
static void put_back(int64_t first, int64_t members, const int32_t *restrict slots, int64_t count,
                     const int32_t *restrict rows, int64_t length, int64_t stride, double *restrict window,
                     const double *restrict panel) {
    for (int64_t k = first; k < members; k++) {
        int64_t own = slots[k];
        const double *out = panel + k * length;
        for (int64_t j = first; j < k + 1; j++) {
            int64_t other = slots[j];
            window[imax(own, other) * stride + imin(own, other)] = out[j];
        }
        for (int64_t e = 0; e < count; e++) {
            int64_t other = rows[e];
            window[imax(own, other) * stride + imin(own, other)] = out[members + e];
        }
    }
}

/* Largest magnitude in some vectors of a row, of which the first is multiplied with mask. */
static double largest(int64_t begin, int64_t end, const double *restrict mask, double *restrict row) {
    vec8 first = mul8(load8(row, begin), load8(mask, 0));
    store8(row, begin, first);
    vec8 most = abs8(first);
    for (int64_t at = begin + VECTOR; at < end; at += VECTOR) most = max8(most, abs8(load8(row, at)));
    return largest8(most);
}

/* Subtract from the row at place what the pivots taken leave there; from column begin on. */
static void bring(int64_t taken, int64_t place, int64_t begin, int64_t length, const double *restrict lower,
                  const double *restrict panel, double *restrict row) {
    for (int64_t at = begin; at < length; at += VECTOR) {
        vec8 total = load8(row, at);
        vec8 other = splat8(0.0);
        for (int64_t t = 0; t < (taken - 1) * length; t += 2 * length) {
            total = sub_scaled8(total, lower[t + place], load8(panel, t + at));
            other = sub_scaled8(other, lower[t + length + place], load8(panel, t + length + at));
        }
        if ((taken & 1) != 0) {
            int64_t t = (taken - 1) * length;
            total = sub_scaled8(total, lower[t + place], load8(panel, t + at));
        }
        store8(row, at, add8(total, other));
    }
}

static void subtract(int64_t begin, int64_t end, double factor, const double *restrict column,
                     double *restrict row) {
    for (int64_t at = begin; at < end; at += VECTOR)
        store8(row, at, sub_scaled8(load8(row, at), factor, load8(column, at)));
}

static void subtract_pair(int64_t begin, int64_t end, double factor_1, const double *restrict column_1,
                          double factor_2, const double *restrict column_2, double *restrict row) {
    for (int64_t at = begin; at < end; at += VECTOR) {
        store8(
            row, at,
            sub_scaled8(sub_scaled8(load8(row, at), factor_1, load8(column_1, at)), factor_2, load8(column_2, at)));
    }
}

static void scale(int64_t begin, int64_t end, double reciprocal, double most, const double *restrict column,
                  double *restrict factors, double *restrict growth) {
    for (int64_t at = begin; at < end; at += VECTOR) {
        vec8 factor = scaled8(reciprocal, load8(column, at));
        store8(factors, at, factor);
        store8(growth, at, max8(load8(growth, at), scaled8(most, abs8(factor))));
    }
}

static void scale_pair(int64_t begin, int64_t end, double inverse_pp, double inverse_pq, double inverse_qq,
                       double most_p, double most_q, const double *restrict column_1,
                       const double *restrict column_2, double *restrict factors_1, double *restrict factors_2,
                       double *restrict growth) {
    for (int64_t at = begin; at < end; at += VECTOR) {
        vec8 one = load8(column_1, at);
        vec8 other = load8(column_2, at);
        vec8 factor_1 = add_scaled8(scaled8(inverse_pp, one), inverse_pq, other);
        vec8 factor_2 = add_scaled8(scaled8(inverse_pq, one), inverse_qq, other);
        store8(factors_1, at, factor_1);
        store8(factors_2, at, factor_2);
        store8(growth, at,
               max8(load8(growth, at), add_scaled8(scaled8(most_p, abs8(factor_1)), most_q, abs8(factor_2))));
    }
}

/* Exchange two members that are not taken yet, also in the factors of those that are. */
static void swap(int64_t i, int64_t j, int64_t members, int64_t length, int32_t *restrict slots,
                 double *restrict growth, double *restrict panel, double *restrict lower) {
    if (i == j) return;
    int64_t slot = slots[i];
    slots[i] = slots[j];
    slots[j] = (int32_t)slot;
    double value = growth[i];
    growth[i] = growth[j];
    growth[j] = value;
    for (int64_t k = 0; k < length; k++) {
        value = panel[i * length + k];
        panel[i * length + k] = panel[j * length + k];
        panel[j * length + k] = value;
    }
    for (int64_t k = 0; k < members; k++) {
        value = panel[k * length + i];
        panel[k * length + i] = panel[k * length + j];
        panel[k * length + j] = value;
    }
    for (int64_t k = 0; k < i; k++) {
        value = lower[k * length + i];
        lower[k * length + i] = lower[k * length + j];
        lower[k * length + j] = value;
    }
}

/* Largest magnitude of a row from first, without two places. */
static double most_but(int64_t first, int64_t last, int64_t p, int64_t q, const double *restrict row) {
    double most = 0.0;
    for (int64_t k = first; k < last; k++)
        if (k != p && k != q) most = dmax(most, fabs(row[k]));
    return most;
}

/* Bring a pivot of one or two unknowns that passes the test to place done; its size, or 0. */
static int64_t search(int64_t done, int64_t members, int64_t last, int64_t length, double threshold, double tiny,
                      int32_t *restrict slots, double *restrict growth, double *restrict panel,
                      double *restrict lower) {
    for (int64_t p = done; p < members; p++) {
        const double *row = panel + p * length;
        double most = most_but(done, last, p, p, row);
        if (fabs(row[p]) >= threshold * most && fabs(row[p]) > tiny * growth[p]) {
            swap(done, p, members, length, slots, growth, panel, lower);
            return 1;
        }
    }
    for (int64_t p = done; p < members; p++) {
        const double *row = panel + p * length;
        int64_t q = -1;
        double most = 0.0;
        for (int64_t k = done; k < members; k++) {
            if (k != p && fabs(row[k]) > most) {
                most = fabs(row[k]);
                q = k;
            }
        }
        if (q >= 0) {
            const double *other = panel + q * length;
            double most_p = most_but(done, last, p, q, row);
            double most_q = most_but(done, last, p, q, other);
            double noise = tiny * dmax(growth[p], growth[q]);
            if (pivots_pair_accepted(row[p], row[q], other[q], most_p, most_q, threshold, noise) != 0) {
                /* The one without diagonal comes second: its zeros stay zeros. */
                int64_t second = q;
                int64_t first = p;
                if (row[p] == 0.0 && other[q] != 0.0) {
                    second = p;
                    first = q;
                }
                swap(done, first, members, length, slots, growth, panel, lower);
                if (second == done) second = first;
                swap(done + 1, second, members, length, slots, growth, panel, lower);
                return 2;
            }
        }
    }
    return 0;
}

/* Eight by eight of the products: sums[k * length:] for rows k of lower at the given columns. */
ALWAYS_INLINE void tile(int64_t taken, int64_t length, const double *restrict lower, const double *restrict panel,
                        double *restrict sums) {
    vec8 sum_0 = splat8(0.0);
    vec8 sum_1 = splat8(0.0);
    vec8 sum_2 = splat8(0.0);
    vec8 sum_3 = splat8(0.0);
    vec8 sum_4 = splat8(0.0);
    vec8 sum_5 = splat8(0.0);
    vec8 sum_6 = splat8(0.0);
    vec8 sum_7 = splat8(0.0);
    for (int64_t at = 0; at < taken * length; at += length) {
        vec8 row = load8(panel, at);
        sum_0 = add_scaled8(sum_0, lower[at], row);
        sum_1 = add_scaled8(sum_1, lower[at + 1], row);
        sum_2 = add_scaled8(sum_2, lower[at + 2], row);
        sum_3 = add_scaled8(sum_3, lower[at + 3], row);
        sum_4 = add_scaled8(sum_4, lower[at + 4], row);
        sum_5 = add_scaled8(sum_5, lower[at + 5], row);
        sum_6 = add_scaled8(sum_6, lower[at + 6], row);
        sum_7 = add_scaled8(sum_7, lower[at + 7], row);
    }
    store8(sums, 0, sum_0);
    store8(sums, length, sum_1);
    store8(sums, 2 * length, sum_2);
    store8(sums, 3 * length, sum_3);
    store8(sums, 4 * length, sum_4);
    store8(sums, 5 * length, sum_5);
    store8(sums, 6 * length, sum_6);
    store8(sums, 7 * length, sum_7);
}

/* Four by eight of the products. */
ALWAYS_INLINE void half_tile(int64_t taken, int64_t length, const double *restrict lower,
                             const double *restrict panel, double *restrict sums) {
    vec8 sum_0 = splat8(0.0);
    vec8 sum_1 = splat8(0.0);
    vec8 sum_2 = splat8(0.0);
    vec8 sum_3 = splat8(0.0);
    for (int64_t at = 0; at < taken * length; at += length) {
        vec8 row = load8(panel, at);
        sum_0 = add_scaled8(sum_0, lower[at], row);
        sum_1 = add_scaled8(sum_1, lower[at + 1], row);
        sum_2 = add_scaled8(sum_2, lower[at + 2], row);
        sum_3 = add_scaled8(sum_3, lower[at + 3], row);
    }
    store8(sums, 0, sum_0);
    store8(sums, length, sum_1);
    store8(sums, 2 * length, sum_2);
    store8(sums, 3 * length, sum_3);
}

/* window[rows, rows] -= lower^T panel, the first taken rows of these. */
static void update(int64_t taken, int64_t members, int64_t count, const int32_t *restrict rows, int64_t length,
                   int64_t stride, const double *restrict panel, const double *restrict lower,
                   double *restrict sums, double *restrict window) {
    int64_t first = floor_div(members, VECTOR) * VECTOR;
    for (int64_t begin = first; begin < members + count; begin += VECTOR) {
        for (int64_t at = first; at < begin + VECTOR; at += VECTOR) {
            if (LANES == VECTOR) {
                tile(taken, length, lower + begin, panel + at, sums + at);
            } else {
                half_tile(taken, length, lower + begin, panel + at, sums + at);
                half_tile(taken, length, lower + begin + 4, panel + at, sums + at + 4 * length);
            }
        }
        for (int64_t k = imax(begin, members); k < imin(begin + VECTOR, members + count); k++) {
            double *row = window + rows[k - members] * stride;
            const double *own = sums + (k - begin) * length + members;
            for (int64_t j = 0; j < k - members + 1; j++) row[rows[j]] -= own[j];
        }
    }
}

int64_t panel_take_group(int64_t planned, int64_t members, const int32_t *restrict who, int64_t count,
                         const int32_t *restrict rows, const int32_t *restrict kinds, int64_t stage,
                         double threshold, double tiny, int64_t capacity, int64_t stride, double *restrict window,
                         int32_t *restrict slot, const int32_t *restrict owner, double *restrict growth,
                         int32_t *restrict slots, double *restrict panel, double *restrict lower,
                         double *restrict rise, double *restrict sums, const double *restrict masks,
                         int32_t *restrict pivots, int32_t *restrict starts, int32_t *restrict indices,
                         double *restrict factors, double *restrict inverse, int64_t *restrict counts) {
    int64_t last = members + count;
    int64_t length = floor_div(last + VECTOR - 1, VECTOR) * VECTOR;
    if (counts[INDICES] + last > capacity || counts[PIVOTS_FACTORS] + members * last + VECTOR > capacity) return -1;
    for (int64_t k = 0; k < members; k++) {
        slots[k] = slot[who[k]];
        rise[k] = growth[slots[k]];
    }
    for (int64_t e = 0; e < count; e++) rise[members + e] = growth[rows[e]];
    for (int64_t k = last; k < length; k++) rise[k] = 1.0;
    gather(members, slots, count, rows, length, stride, window, panel);
    int64_t done = 0;
    bool as_planned = true;
    bool lazy = true;
    int64_t number = counts[PIVOTS];
    int64_t value_at = counts[PIVOTS_FACTORS];
    int64_t index_at = counts[INDICES];
    while (done < members) {
        int64_t kind = 0;
        int64_t begin = floor_div(done, VECTOR) * VECTOR;
        double *row = panel + done * length;
        double a = row[done];
        double b = 0.0;
        double c = 0.0;
        double most = 0.0;
        double most_q = 0.0;
        if (done >= planned || kinds[imin(done, planned - 1)] < 1) as_planned = false;
        if (as_planned) {
            kind = kinds[done];
            bring(done, done, begin, length, lower, panel, row);
            a = row[done];
            if (kind == 1) {
                most = largest(begin, length, masks + (done - begin) * VECTOR, row);
                if (fabs(a) < threshold * most || fabs(a) <= tiny * rise[done]) kind = 0;
            } else {
                double *other = panel + (done + 1) * length;
                bring(done, done + 1, begin, length, lower, panel, other);
                b = row[done + 1];
                c = other[done + 1];
                if (done + 1 == begin + VECTOR) {
                    row[done + 1] = 0.0;
                    other[done + 1] = 0.0;
                }
                const double *mask = masks + imin(done + 1 - begin, VECTOR - 1) * VECTOR;
                most = largest(begin, length, mask, row);
                most_q = largest(begin, length, mask, other);
                double noise = tiny * dmax(rise[done], rise[done + 1]);
                if (pivots_pair_accepted(a, b, c, most, most_q, threshold, noise) == 0) {
                    kind = 0;
                    row[done + 1] = b;
                    other[done] = b;
                    other[done + 1] = c;
                }
            }
            if (kind == 0) row[done] = a;
        }
        if (kind == 0 && lazy) {
            /* From here on all the rows are kept up to date. */
            int64_t first = done;
            if (as_planned) first = done + imax(kinds[done], 1);
            for (int64_t k = first; k < members; k++)
                bring(done, k, begin, length, lower, panel, panel + k * length);
            lazy = false;
            as_planned = false;
        }
        if (kind == 0) {
            kind = search(done, members, last, length, threshold, tiny, slots, rise, panel, lower);
            if (kind == 0) break;
            a = row[done];
            for (int64_t k = begin; k < done + 1; k++) row[k] = 0.0;
            if (kind == 2) {
                double *other = panel + (done + 1) * length;
                b = row[done + 1];
                c = other[done + 1];
                row[done + 1] = 0.0;
                for (int64_t k = begin; k < done + 2; k++) other[k] = 0.0;
                most_q = largest(begin, length, masks + VECTOR * VECTOR, other);
            }
            most = largest(begin, length, masks + VECTOR * VECTOR, row);
        }
        double *factors_1 = lower + done * length;
        if (kind == 1) {
            double reciprocal = 1.0 / a;
            scale(begin, length, reciprocal, most, row, factors_1, rise);
            for (int64_t k = lazy ? members : done + 1; k < members; k++) {
                double factor = factors_1[k];
                if (factor != 0.0) subtract(begin, length, factor, row, panel + k * length);
            }
            inverse[3 * number] = reciprocal;
            counts[a > 0.0 ? POSITIVE : PIVOTS_NEGATIVE]++;
        } else {
            double *other = panel + (done + 1) * length;
            double *factors_2 = lower + (done + 1) * length;
            double ratio = pivots_reciprocal_determinant(a, b, c);
            double inverse_pp = c * ratio;
            double inverse_pq = -b * ratio;
            double inverse_qq = a * ratio;
            scale_pair(begin, length, inverse_pp, inverse_pq, inverse_qq, most, most_q, row, other, factors_1,
                       factors_2, rise);
            for (int64_t k = lazy ? members : done + 2; k < members; k++) {
                double factor = factors_1[k];
                double factor_q = factors_2[k];
                if (factor != 0.0 || factor_q != 0.0)
                    subtract_pair(begin, length, factor, row, factor_q, other, panel + k * length);
            }
            inverse[3 * number] = inverse_pp;
            inverse[3 * number + 1] = inverse_pq;
            inverse[3 * number + 2] = inverse_qq;
            if (a * c < b * b) {
                counts[POSITIVE]++;
                counts[PIVOTS_NEGATIVE]++;
            } else {
                counts[a > 0.0 ? POSITIVE : PIVOTS_NEGATIVE] += 2;
            }
        }
        /* Whether the pivot has one or two unknowns is kept here until all are known. */
        pivots[2 * number + 1] = (int32_t)kind;
        number++;
        done += kind;
    }
    if (done > 0) update(done, members, count, rows, length, stride, panel, lower, sums, window);
    int32_t *own = indices + index_at;
    for (int64_t k = 0; k < members; k++) own[k] = owner[slots[k]];
    for (int64_t e = 0; e < count; e++) {
        own[members + e] = owner[rows[e]];
        growth[rows[e]] = rise[members + e];
    }
    int64_t at = 0;
    for (int64_t k = counts[PIVOTS]; k < number; k++) {
        int64_t size = pivots[2 * k + 1];
        int64_t rest = last - at - size;
        pivots[2 * k] = own[at];
        pivots[2 * k + 1] = size == 2 ? own[at + 1] : -1;
        starts[2 * k] = (int32_t)(index_at + at + size);
        starts[2 * k + 1] = (int32_t)rest;
        for (int64_t part = 0; part < size; part++) {
            int64_t source = (at + part) * length + at + size;
            for (int64_t e = 0; e < rest; e += VECTOR) store8(factors, value_at + e, load8(lower, source + e));
            value_at += rest;
            slot[own[at + part]] = (int32_t)(-1 - stage);
        }
        at += size;
    }
    if (done < members) {
        for (int64_t k = done; k < members; k++) growth[slots[k]] = rise[k];
        put_back(done, members, slots, count, rows, length, stride, window, panel);
    }
    counts[PIVOTS] = number;
    counts[INDICES] = index_at + last;
    counts[PIVOTS_FACTORS] = value_at;
    return as_planned ? done : PANEL_CHANGED + done;
}
