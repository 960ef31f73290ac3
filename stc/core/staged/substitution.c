/* Solving with the factors of elimination.h, and refining against the matrix itself. */
#include "../native.h"
#include "../vec8.h"
#include "substitution.h"
#include "values.h"

/* Columns of fewer entries are gone through one by one. */
enum {
    LONG = 20,
};

/* Whether pivot k's rows are those of the one before less k's own unknowns, which come first among these. */
static int64_t linked(int64_t k, const int32_t *restrict pivots, const int32_t *restrict starts,
                      const int32_t *restrict indices) {
    int64_t begin = starts[2 * k - 2];
    int64_t size = pivots[2 * k + 1] >= 0 ? 2 : 1;
    int64_t length = starts[2 * k + 1];
    if (length < 0 || starts[2 * k] != begin + size || length != starts[2 * k - 1] - size) return 0;
    return indices[begin] == pivots[2 * k] && (size == 1 || indices[begin + 1] == pivots[2 * k + 1]);
}

/* Copy what belongs to pivot k and its rows to part; how many numbers that is. */
static int64_t collect(int64_t k, const int32_t *restrict pivots, const int32_t *restrict starts,
                       const int32_t *restrict indices, const double *restrict x, double *restrict part) {
    int64_t size = 1;
    part[0] = x[pivots[2 * k]];
    if (pivots[2 * k + 1] >= 0) {
        size = 2;
        part[1] = x[pivots[2 * k + 1]];
    }
    int64_t length = starts[2 * k + 1];
    const int32_t *own = indices + starts[2 * k];
    double *rows = part + size;
    for (int64_t e = 0; e < length; e++) rows[e] = x[own[e]];
    return size + length;
}

/* Copy what belongs to pivot k and its rows back. */
static void return_(int64_t k, const int32_t *restrict pivots, const int32_t *restrict starts,
                    const int32_t *restrict indices, const double *restrict part, double *restrict x) {
    int64_t size = 1;
    x[pivots[2 * k]] = part[0];
    if (pivots[2 * k + 1] >= 0) {
        size = 2;
        x[pivots[2 * k + 1]] = part[1];
    }
    const int32_t *own = indices + starts[2 * k];
    const double *rows = part + size;
    for (int64_t e = 0; e < starts[2 * k + 1]; e++) x[own[e]] = rows[e];
}

/* Divide what is at p, and at q when that is no less than 0, by pivot k. */
ALWAYS_INLINE void divide(int64_t k, int64_t p, int64_t q, const double *restrict inverse, double *restrict x) {
    double value_p = x[p];
    if (q < 0) {
        x[p] = inverse[3 * k] * value_p;
    } else {
        double value_q = x[q];
        x[p] = inverse[3 * k] * value_p + inverse[3 * k + 1] * value_q;
        x[q] = inverse[3 * k + 1] * value_p + inverse[3 * k + 2] * value_q;
    }
}

/* See substitute; both is a constant here. */
ALWAYS_INLINE void substitute(int64_t both, int64_t count, const int32_t *restrict columns,
                              const double *restrict upper, const int32_t *restrict pivots,
                              const int32_t *restrict starts, const int32_t *restrict indices,
                              double *restrict factors, const double *restrict inverse, double *restrict x,
                              double *restrict other_x, double *restrict part, double *restrict other_part) {
    int64_t value_at = 0;
    int64_t k = 0;
    while (k < count) {
        int64_t length = starts[2 * k + 1];
        if (length < 0) {
            const int32_t *own = columns + starts[2 * k];
            const double *column = upper + starts[2 * k];
            int64_t p = pivots[2 * k];
            double scaled = x[p] * inverse[3 * k];
            double other_scaled = 0.0;
            if (both != 0) other_scaled = other_x[p] * inverse[3 * k];
            for (int64_t e = 0; e < -1 - length; e++) {
                x[own[e]] -= column[e] * scaled;
                if (both != 0) other_x[own[e]] -= column[e] * other_scaled;
            }
            x[p] = scaled;
            if (both != 0) other_x[p] = other_scaled;
            k++;
            continue;
        }
        if (length < LONG) {
            const int32_t *own = indices + starts[2 * k];
            const double *column = factors + value_at;
            int64_t p = pivots[2 * k];
            int64_t q = pivots[2 * k + 1];
            double value_p = x[p];
            double other_p = other_x[p];
            value_at += length;
            if (q < 0) {
                for (int64_t e = 0; e < length; e++) {
                    x[own[e]] -= column[e] * value_p;
                    if (both != 0) other_x[own[e]] -= column[e] * other_p;
                }
            } else {
                value_at += length;
                double value_q = x[q];
                double other_q = other_x[q];
                const double *second = column + length;
                for (int64_t e = 0; e < length; e++) {
                    x[own[e]] -= column[e] * value_p + second[e] * value_q;
                    if (both != 0) other_x[own[e]] -= column[e] * other_p + second[e] * other_q;
                }
            }
            divide(k, p, q, inverse, x);
            if (both != 0) divide(k, p, q, inverse, other_x);
            k++;
            continue;
        }
        int64_t first = k;
        collect(k, pivots, starts, indices, x, part);
        if (both != 0) collect(k, pivots, starts, indices, other_x, other_part);
        int64_t at = 0;
        while (k < count && (k == first || linked(k, pivots, starts, indices) != 0)) {
            length = starts[2 * k + 1];
            double value_p = part[at];
            double other_p = other_part[at];
            int64_t size = 1;
            if (pivots[2 * k + 1] < 0) {
                at++;
                for (int64_t e = 0; e < length; e += 8) {
                    vec8 f = load8(factors, value_at + e);
                    store8(part, at + e, sub_scaled8(load8(part, at + e), value_p, f));
                    if (both != 0) store8(other_part, at + e, sub_scaled8(load8(other_part, at + e), other_p, f));
                }
            } else {
                size = 2;
                double value_q = part[at + 1];
                double other_q = other_part[at + 1];
                at += 2;
                const double *second = factors + value_at + length;
                for (int64_t e = 0; e < length; e += 8) {
                    vec8 f = load8(factors, value_at + e);
                    vec8 g = load8(second, e);
                    store8(part, at + e, sub8(load8(part, at + e), add_scaled8(scaled8(value_p, f), value_q, g)));
                    if (both != 0) {
                        store8(other_part, at + e,
                               sub8(load8(other_part, at + e), add_scaled8(scaled8(other_p, f), other_q, g)));
                    }
                }
                value_at += length;
            }
            divide(k, at - size, size == 2 ? at - 1 : -1, inverse, part);
            if (both != 0) divide(k, at - size, size == 2 ? at - 1 : -1, inverse, other_part);
            value_at += length;
            k++;
        }
        return_(first, pivots, starts, indices, part, x);
        if (both != 0) return_(first, pivots, starts, indices, other_part, other_x);
    }
    store8(factors, value_at, splat8(0.0));
    k = count - 1;
    while (k >= 0) {
        int64_t length = starts[2 * k + 1];
        if (length < 0) {
            const int32_t *own = columns + starts[2 * k];
            const double *column = upper + starts[2 * k];
            double total = 0.0;
            double other_total = 0.0;
#pragma omp simd reduction(+ : total, other_total)
            for (int64_t e = 0; e < -1 - length; e++) {
                total += column[e] * x[own[e]];
                if (both != 0) other_total += column[e] * other_x[own[e]];
            }
            x[pivots[2 * k]] -= inverse[3 * k] * total;
            if (both != 0) other_x[pivots[2 * k]] -= inverse[3 * k] * other_total;
            k--;
            continue;
        }
        if (length < LONG) {
            const int32_t *own = indices + starts[2 * k];
            int64_t members = pivots[2 * k + 1] < 0 ? 1 : 2;
            for (int64_t member = 0; member < members; member++) {
                int64_t p = pivots[2 * k + members - 1 - member];
                value_at -= length;
                double total = x[p];
                double other_total = other_x[p];
                const double *column = factors + value_at;
#pragma omp simd reduction(+ : total, other_total)
                for (int64_t e = 0; e < length; e++) {
                    total -= column[e] * x[own[e]];
                    if (both != 0) other_total -= column[e] * other_x[own[e]];
                }
                x[p] = total;
                if (both != 0) other_x[p] = other_total;
            }
            k--;
            continue;
        }
        int64_t first = k;
        while (first > 0 && starts[2 * first - 1] >= 0 && linked(first, pivots, starts, indices) != 0) first--;
        int64_t end = collect(first, pivots, starts, indices, x, part);
        store8(part, end, splat8(0.0));
        if (both != 0) {
            collect(first, pivots, starts, indices, other_x, other_part);
            store8(other_part, end, splat8(0.0));
        }
        while (k >= first) {
            length = starts[2 * k + 1];
            int64_t at = end - length;
            int64_t place = at - 1;
            for (int64_t member = 0; member < (pivots[2 * k + 1] < 0 ? 1 : 2); member++) {
                value_at -= length;
                vec8 sums = splat8(0.0);
                vec8 other_sums = splat8(0.0);
                for (int64_t e = 0; e < length; e += 8) {
                    vec8 f = load8(factors, value_at + e);
                    sums = add_product8(sums, load8(part, at + e), f);
                    if (both != 0) other_sums = add_product8(other_sums, load8(other_part, at + e), f);
                }
                place = at - 1 - member;
                part[place] -= sum8(sums);
                if (both != 0) other_part[place] -= sum8(other_sums);
            }
            x[pivots[2 * k]] = part[place];
            if (both != 0) other_x[pivots[2 * k]] = other_part[place];
            if (pivots[2 * k + 1] >= 0) {
                x[pivots[2 * k + 1]] = part[at - 1];
                if (both != 0) other_x[pivots[2 * k + 1]] = other_part[at - 1];
            }
            k--;
        }
    }
}

void substitution_substitute(int64_t both, int64_t count, const int32_t *restrict columns,
                             const double *restrict upper, const int32_t *restrict pivots,
                             const int32_t *restrict starts, const int32_t *restrict indices,
                             double *restrict factors, const double *restrict inverse, double *restrict x,
                             double *restrict other_x, double *restrict part, double *restrict other_part) {
    if (both != 0) {
        substitute(1, count, columns, upper, pivots, starts, indices, factors, inverse, x, other_x, part,
                   other_part);
    } else {
        substitute(0, count, columns, upper, pivots, starts, indices, factors, inverse, x, other_x, part,
                   other_part);
    }
}

/* Largest magnitude. */
ALWAYS_INLINE double norm(int64_t size, const double *restrict x) {
    double most = 0.0;
#pragma omp simd reduction(highest : most)
    for (int64_t k = 0; k < size; k++) most = nanmax(most, fabs(x[k]));
    return most;
}

/* Scale a right-hand side; its largest magnitude then. */
ALWAYS_INLINE double begin(int64_t size, const int32_t *restrict order, const double *restrict scale,
                           const double *restrict rhs, double *restrict scaled_rhs, double *restrict change,
                           double *restrict solution) {
    for (int64_t k = 0; k < size; k++) {
        double value = rhs[order[k]] * scale[k];
        scaled_rhs[k] = value;
        change[k] = value;
        solution[k] = 0.0;
    }
    return norm(size, scaled_rhs);
}

/* See solve; both is a constant here. */
ALWAYS_INLINE void solve(int64_t both, int64_t size, int64_t refinements, const double *restrict accuracy,
                         const int32_t *restrict pointers, const int32_t *restrict columns,
                         const double *restrict values, const double *restrict scale, const int32_t *restrict order,
                         const int64_t *restrict pivot_count, const int32_t *restrict pivots,
                         const int32_t *restrict starts, const int32_t *restrict indices, double *restrict factors,
                         const double *restrict inverse, const double *restrict rhs, double *restrict scaled_rhs,
                         double *restrict solution, double *restrict change, double *restrict result,
                         double *restrict part, const double *restrict other_rhs, double *restrict other_scaled_rhs,
                         double *restrict other_solution, double *restrict other_change,
                         double *restrict other_result, double *restrict other_part, double *restrict report,
                         double *restrict other_report) {
    int64_t count = pivot_count[0];
    double length = begin(size, order, scale, rhs, scaled_rhs, change, solution);
    double other_length = 0.0;
    if (both != 0)
        other_length = begin(size, order, scale, other_rhs, other_scaled_rhs, other_change, other_solution);
    int64_t active = length > 0.0 ? 1 : 0;
    int64_t other_active = other_length > 0.0 ? 1 : 0;
    report[0] = 1.0 * active;
    report[1] = 0.0;
    other_report[0] = 1.0 * other_active;
    int64_t steps = 0;
    while (active + other_active > 0) {
        substitution_substitute(both, count, columns, values + size, pivots, starts, indices, factors, inverse,
                                change, other_change, part, other_part);
        report[1] = 1.0 * steps;
        if (active != 0) {
            for (int64_t k = 0; k < size; k++) solution[k] += change[k];
            double remaining = values_residual(size, pointers, columns, values, scaled_rhs, solution, result);
            active = substitution_improves(size, steps, refinements, accuracy[0], remaining, length,
                                           norm(size, solution), report, change, solution);
            if (active != 0)
                for (int64_t k = 0; k < size; k++) change[k] = result[k];
        }
        if (other_active != 0) {
            for (int64_t k = 0; k < size; k++) other_solution[k] += other_change[k];
            double remaining =
                values_residual(size, pointers, columns, values, other_scaled_rhs, other_solution, other_result);
            other_active =
                substitution_improves(size, steps, refinements, accuracy[0], remaining, other_length,
                                      norm(size, other_solution), other_report, other_change, other_solution);
            if (other_active != 0)
                for (int64_t k = 0; k < size; k++) other_change[k] = other_result[k];
        }
        steps++;
    }
    for (int64_t k = 0; k < size; k++) result[order[k]] = solution[k] * scale[k];
    if (both != 0) {
        for (int64_t k = 0; k < size; k++) other_result[order[k]] = other_solution[k] * scale[k];
        report[0] = dmax(report[0], other_report[0]);
    }
}

void substitution_solve(int64_t both, int64_t size, int64_t refinements, const double *restrict accuracy,
                        const int32_t *restrict pointers, const int32_t *restrict columns,
                        const double *restrict values, const double *restrict scale, const int32_t *restrict order,
                        const int64_t *restrict pivot_count, const int32_t *restrict pivots,
                        const int32_t *restrict starts, const int32_t *restrict indices, double *restrict factors,
                        const double *restrict inverse, const double *restrict rhs, double *restrict scaled_rhs,
                        double *restrict solution, double *restrict change, double *restrict result,
                        double *restrict part, const double *restrict other_rhs, double *restrict other_scaled_rhs,
                        double *restrict other_solution, double *restrict other_change,
                        double *restrict other_result, double *restrict other_part, double *restrict report,
                        double *restrict other_report) {
    if (both != 0) {
        solve(1, size, refinements, accuracy, pointers, columns, values, scale, order, pivot_count, pivots, starts,
              indices, factors, inverse, rhs, scaled_rhs, solution, change, result, part, other_rhs,
              other_scaled_rhs, other_solution, other_change, other_result, other_part, report, other_report);
    } else {
        solve(0, size, refinements, accuracy, pointers, columns, values, scale, order, pivot_count, pivots, starts,
              indices, factors, inverse, rhs, scaled_rhs, solution, change, result, part, other_rhs,
              other_scaled_rhs, other_solution, other_change, other_result, other_part, report, other_report);
    }
}
