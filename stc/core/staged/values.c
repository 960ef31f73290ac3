/* Entries of K in elimination order: loading, equilibration, products.
 *
 * values (N + E,) holds the N diagonal entries, then those above the diagonal row by row: row i has the columns
 * columns[pointers[i]:pointers[i + 1]], all larger than i, at values[N + e]. */
#include "../native.h"
#include "values.h"

/* A scale is good when the largest entries of all rows are within this factor of 1. */
#define GOOD 2.0
/* Scales stay between these. */
#define SMALLEST_SCALE 1e-100
#define VALUES_LARGEST_SCALE 1e+100

int64_t values_load(int64_t n, int64_t m, int64_t hess_count, int64_t jac_count, const double *restrict hess,
                    const double *restrict jac, const double *restrict primal, const double *restrict dual,
                    const int32_t *restrict position, const int32_t *restrict hess_target,
                    const int32_t *restrict jac_target, double *restrict values) {
    double check = 0.0;
    for (int64_t k = 0; k < n; k++) {
        double value = primal[k];
        check += value * 0.0;
        values[position[k]] = value;
    }
    for (int64_t k = 0; k < m; k++) {
        double value = dual[k];
        check += value * 0.0;
        values[position[n + k]] = -value;
    }
    for (int64_t k = 0; k < hess_count; k++) {
        double value = hess[k];
        check += value * 0.0;
        int64_t target = hess_target[k];
        if (target < n + m)
            values[target] += value;
        else
            values[target] = value;
    }
    for (int64_t k = 0; k < jac_count; k++) {
        double value = jac[k];
        check += value * 0.0;
        values[jac_target[k]] = value;
    }
    return check == 0.0 ? 0 : 1;
}

int64_t values_count_nonzero(int64_t count, const int32_t *restrict places, const double *restrict values) {
    int64_t found = 0;
    for (int64_t k = 0; k < count; k++) found += values[places[k]] != 0.0;
    return found;
}

void values_choose_plan(int64_t count, const int32_t *restrict places, const double *restrict values, int64_t at,
                        int64_t *restrict cells) {
    cells[at] = values_count_nonzero(count, places, values) == 0 ? 1 : 0;
}

/* Divide each scale by the root of its row's largest entry. */
static void refine(int64_t size, const double *restrict most, double *restrict scale) {
    for (int64_t k = 0; k < size; k++) {
        double value = most[k];
        value = value > 0.0 ? value : 1.0;
        scale[k] = nanmin(nanmax(scale[k] / sqrt(value), SMALLEST_SCALE), VALUES_LARGEST_SCALE);
    }
}

int64_t values_find_scale(int64_t size, const double *restrict most, double *restrict scale) {
    double low = VALUES_LARGEST_SCALE;
    double high = 0.0;
#pragma omp simd reduction(highest : high) reduction(lowest : low)
    for (int64_t k = 0; k < size; k++) {
        double value = most[k];
        high = nanmax(high, value);
        low = nanmin(low, value > 0.0 ? value : 1.0);
    }
    if (high < GOOD && low * GOOD > 1.0) return 0;
    refine(size, most, scale);
    return high < GOOD * GOOD * low ? 0 : 1;
}

/* Largest entry of each row of S K S. */
static void largest_of_rows(int64_t size, const int32_t *restrict pointers, const int32_t *restrict columns,
                            const double *restrict values, const double *restrict scale, double *restrict most) {
    const double *upper = values + size;
    for (int64_t k = 0; k < size; k++) most[k] = fabs(values[k]) * scale[k] * scale[k];
    for (int64_t k = 0; k < size; k++) {
        double own = scale[k];
        double highest = most[k];
        for (int64_t e = pointers[k]; e < pointers[k + 1]; e++) {
            int64_t other = columns[e];
            double value = fabs(upper[e]) * own * scale[other];
            highest = dmax(highest, value);
            most[other] = dmax(most[other], value);
        }
        most[k] = highest;
    }
}

void values_equilibrate(int64_t size, int64_t sweeps, double stale, const int32_t *restrict pointers,
                        const int32_t *restrict columns, double *restrict values, double *restrict scale,
                        double *restrict most) {
    largest_of_rows(size, pointers, columns, values, scale, most);
    if (values_spread_of(size, most) > stale) {
        for (int64_t k = 0; k < size; k++) scale[k] = 1.0;
        for (int64_t sweep = 0; sweep < sweeps; sweep++) {
            largest_of_rows(size, pointers, columns, values, scale, most);
            if (values_find_scale(size, most, scale) == 0) break;
        }
    }
    double *upper = values + size;
    for (int64_t k = 0; k < size; k++) {
        double own = scale[k];
        values[k] = values[k] * own * own;
        for (int64_t e = pointers[k]; e < pointers[k + 1]; e++) upper[e] = upper[e] * own * scale[columns[e]];
    }
}

double values_residual(int64_t size, const int32_t *restrict pointers, const int32_t *restrict columns,
                       const double *restrict values, const double *restrict rhs, const double *restrict solution,
                       double *restrict remainder_) {
    const double *upper = values + size;
    for (int64_t k = 0; k < size; k++) remainder_[k] = rhs[k] - values[k] * solution[k];
    double most = 0.0;
    double check = 0.0;
    for (int64_t k = 0; k < size; k++) {
        double own = solution[k];
        double total = remainder_[k];
        for (int64_t e = pointers[k]; e < pointers[k + 1]; e++) {
            int64_t other = columns[e];
            double value = upper[e];
            total -= value * solution[other];
            remainder_[other] -= value * own;
        }
        remainder_[k] = total;
        check += total * 0.0;
        most = nanmax(most, fabs(total));
    }
    return most + check;
}
