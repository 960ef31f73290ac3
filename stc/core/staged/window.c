/* The dense window of the elimination: reading a column, taking a pivot out.
 *
 * The window is a symmetric matrix of which only the lower triangle is kept, row after row:
 *
 *     entry of slots (i, j)  ->  window[max(i, j) * stride + min(i, j)]
 *
 * Slots that hold no unknown are zero throughout, so that loops may run over them without looking.
 * A column is gathered as a list of slots, in increasing order, and their values.
 *
 * Where the entries of the window are when pivots are not taken as planned.
 *
 * Pivots that fail their test are tried again after the others of their group and in other pairs.  What a group then
 * adds to the window depends on what is taken, but lies among the pairs of its rows.  So besides the planned patterns
 * there is a surplus: what could be there if all pairs of rows were coupled by each group, whatever its order.  Once a
 * group has strayed, columns are also searched there, for nonzeros, until none are left.
 *
 * An unknown that waits belongs to the next group that it is coupled with.  That one is among the rows of the unknown's
 * own group, all of which count as coupled, so the rows of the former hold those that are left of the latter: only the
 * waiting unknowns themselves are new (as with delayed pivots in the multifrontal method, Duff and Reid 1983). */
#include "../native.h"
#include "panel.h"
#include "window.h"

/* Larger than any slot. */
#define NO_SLOT 1099511627776
/* Rows are padded to whole vectors. */
enum {
    WINDOW_LANES = 8,
};
/* A row is updated as a whole rather than entry by entry when it has at most this many entries per listed one. */
enum {
    DENSE_RATIO = 6,
};

/* Entry at two slots. */
ALWAYS_INLINE double entry(int64_t i, int64_t j, int64_t stride, const double *restrict window) {
    return window[imax(i, j) * stride + imin(i, j)];
}

int64_t window_gather(int64_t slot, int64_t top, int64_t low, int64_t high, int64_t stride,
                      const double *restrict window, int32_t *restrict found, double *restrict values) {
    int64_t count = 0;
    const double *row = window + slot * stride;
    for (int64_t k = 0; k < imin(slot, top); k++) {
        double value = row[k];
        found[count] = (int32_t)k;
        values[count] = value;
        count += value != 0.0;
    }
    for (int64_t k = slot + 1; k < top; k++) {
        double value = window[k * stride + slot];
        found[count] = (int32_t)k;
        values[count] = value;
        count += value != 0.0;
    }
    for (int64_t k = low; k < imin(slot, high); k++) {
        double value = row[k];
        found[count] = (int32_t)k;
        values[count] = value;
        count += value != 0.0;
    }
    for (int64_t k = imax(slot + 1, low); k < high; k++) {
        double value = window[k * stride + slot];
        found[count] = (int32_t)k;
        values[count] = value;
        count += value != 0.0;
    }
    return count;
}

void window_gather_listed(int64_t slot, int64_t count, const int32_t *restrict listed, int64_t stride,
                          const double *restrict window, double *restrict values) {
    int64_t below = 0;
    const double *row = window + slot * stride;
    while (below < count && listed[below] < slot) {
        values[below] = row[listed[below]];
        below++;
    }
    for (int64_t k = below; k < count; k++) values[k] = window[listed[k] * stride + slot];
}

double window_largest(int64_t count, const double *restrict values) {
    double most = 0.0;
    for (int64_t k = 0; k < count; k++) most = dmax(most, fabs(values[k]));
    return most;
}

void window_clear(int64_t slot, int64_t count, const int32_t *restrict listed, int64_t stride,
                  double *restrict window) {
    int64_t row = slot * stride;
    window[row + slot] = 0.0;
    for (int64_t k = 0; k < count; k++) {
        int64_t other = listed[k];
        if (other < slot)
            window[row + other] = 0.0;
        else
            window[other * stride + slot] = 0.0;
    }
}

int64_t window_merge(int64_t count_1, const int32_t *restrict found_1, const double *restrict values_1,
                     int64_t skip_1, int64_t count_2, const int32_t *restrict found_2,
                     const double *restrict values_2, int64_t skip_2, int32_t *restrict found,
                     double *restrict first, double *restrict second) {
    int64_t count = 0;
    int64_t i = 0;
    int64_t j = 0;
    while (i < count_1 || j < count_2) {
        int64_t a = i < count_1 ? found_1[i] : NO_SLOT;
        int64_t b = j < count_2 ? found_2[j] : NO_SLOT;
        if (a == skip_1 && i < count_1) {
            i++;
            continue;
        }
        if (b == skip_2 && j < count_2) {
            j++;
            continue;
        }
        found[count] = (int32_t)imin(a, b);
        first[count] = 0.0;
        second[count] = 0.0;
        if (a <= b) {
            first[count] = values_1[i];
            i++;
        }
        if (b <= a) {
            second[count] = values_2[j];
            j++;
        }
        count++;
    }
    return count;
}

static void subtract_row(int64_t blocks, double factor, const double *restrict column, double *restrict row) {
    for (int64_t k = 0; k < blocks * WINDOW_LANES; k++) row[k] -= factor * column[k];
}

void window_subtract_one(int64_t count, const int32_t *restrict listed, const double *restrict values,
                         const double *restrict factors, int64_t stride, double *restrict spread,
                         double *restrict window) {
    if (listed[imax(count - 1, 0)] >= count * DENSE_RATIO) {
        for (int64_t k = 0; k < count; k++) {
            double factor = factors[k];
            double *row = window + listed[k] * stride;
            for (int64_t other = 0; other < k + 1; other++) row[listed[other]] -= factor * values[other];
        }
        return;
    }
    for (int64_t k = 0; k < count; k++) spread[listed[k]] = values[k];
    for (int64_t k = 0; k < count; k++) {
        int64_t slot = listed[k];
        subtract_row(floor_div(slot, WINDOW_LANES) + 1, factors[k], spread, window + slot * stride);
    }
    for (int64_t k = 0; k < count; k++) spread[listed[k]] = 0.0;
}

static void subtract_row_two(int64_t blocks, double factor_1, const double *restrict column_1, double factor_2,
                             const double *restrict column_2, double *restrict row) {
    for (int64_t k = 0; k < blocks * WINDOW_LANES; k++) row[k] -= factor_1 * column_1[k] + factor_2 * column_2[k];
}

void window_subtract_two(int64_t count, const int32_t *restrict listed, const double *restrict first,
                         const double *restrict second, const double *restrict factors_1,
                         const double *restrict factors_2, int64_t stride, double *restrict spread_1,
                         double *restrict spread_2, double *restrict window) {
    if (listed[imax(count - 1, 0)] >= count * DENSE_RATIO) {
        for (int64_t k = 0; k < count; k++) {
            double factor_1 = factors_1[k];
            double factor_2 = factors_2[k];
            double *row = window + listed[k] * stride;
            if (factor_1 == 0.0)
                for (int64_t other = 0; other < k + 1; other++) row[listed[other]] -= factor_2 * second[other];
            else
                for (int64_t other = 0; other < k + 1; other++)
                    row[listed[other]] -= factor_1 * first[other] + factor_2 * second[other];
        }
        return;
    }
    for (int64_t k = 0; k < count; k++) {
        spread_1[listed[k]] = first[k];
        spread_2[listed[k]] = second[k];
    }
    for (int64_t k = 0; k < count; k++) {
        int64_t slot = listed[k];
        double *row = window + slot * stride;
        if (factors_1[k] == 0.0) {
            subtract_row(floor_div(slot, WINDOW_LANES) + 1, factors_2[k], spread_2, row);
        } else {
            subtract_row_two(floor_div(slot, WINDOW_LANES) + 1, factors_1[k], spread_1, factors_2[k], spread_2,
                             row);
        }
    }
    for (int64_t k = 0; k < count; k++) {
        spread_1[listed[k]] = 0.0;
        spread_2[listed[k]] = 0.0;
    }
}

/* With how many of the members a slot is coupled. */
ALWAYS_INLINE int64_t coupled(int64_t own, int64_t members, const int32_t *restrict who,
                              const int32_t *restrict slot, int64_t stride, const double *restrict window) {
    int64_t found = 0;
    for (int64_t k = 0; k < members; k++) found += entry(own, slot[who[k]], stride, window) != 0.0;
    return found;
}

int64_t window_adopt(int64_t members, int32_t *restrict who, int64_t waiting, const int32_t *restrict queue,
                     const int32_t *restrict slot, int64_t stride, const double *restrict window) {
    int64_t total = members;
    for (int64_t place = 0; place < waiting; place++) {
        int64_t own = slot[queue[place]];
        if (own >= 0 && total < LARGEST_GROUP && coupled(own, members, who, slot, stride, window) > 0) {
            who[total] = queue[place];
            total++;
        }
    }
    return total;
}

/* Insert a slot into an increasing list. */
ALWAYS_INLINE void insert(int64_t total, int64_t own, int32_t *restrict rows) {
    int64_t k = total;
    while (k > 0 && rows[imax(k - 1, 0)] > own) {
        rows[k] = rows[k - 1];
        k--;
    }
    rows[k] = (int32_t)own;
}

int64_t window_list_rows(int64_t members, const int32_t *restrict who, int64_t waiting,
                         const int32_t *restrict queue, const int32_t *restrict slot, int64_t stride,
                         const double *restrict window, int64_t count, const int32_t *restrict listed,
                         int64_t surplus_count, const int32_t *restrict surplus, int32_t *restrict rows) {
    int64_t total = 0;
    int64_t taken = 0;
    for (int64_t e = 0; e < surplus_count; e++) {
        if (coupled(surplus[e], members, who, slot, stride, window) > 0) {
            while (taken < count && listed[taken] < surplus[e]) {
                rows[total] = listed[taken];
                taken++;
                total++;
            }
            rows[total] = surplus[e];
            total++;
        }
    }
    while (taken < count) {
        rows[total] = listed[taken];
        taken++;
        total++;
    }
    for (int64_t place = 0; place < waiting; place++) {
        int64_t own = slot[queue[place]];
        bool member = own < 0;
        for (int64_t k = 0; k < members; k++) member = member || who[k] == queue[place];
        if (!member && coupled(own, members, who, slot, stride, window) > 0) {
            insert(total, own, rows);
            total++;
        }
    }
    return total;
}
