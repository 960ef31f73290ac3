/* Entries of K in elimination order: loading, equilibration, products. */
#ifndef STC_VALUES_H
#define STC_VALUES_H

#include "../native.h"

/* Put the values of H, J, p and d at their places; returns 0, or 1 when a value is not finite. */
API int64_t values_load(int64_t n, int64_t m, int64_t hess_count, int64_t jac_count, const double *restrict hess,
                        const double *restrict jac, const double *restrict primal, const double *restrict dual,
                        const int32_t *restrict position, const int32_t *restrict hess_target,
                        const int32_t *restrict jac_target, double *restrict values);

/* How many of some values differ from zero. */
API int64_t values_count_nonzero(int64_t count, const int32_t *restrict places, const double *restrict values);

/* Make cells[at] tell whether all of some values are zero, as a plan takes them to be. */
API void values_choose_plan(int64_t count, const int32_t *restrict places, const double *restrict values,
                            int64_t at, int64_t *restrict cells);

/* Improve the scale by the largest entries of the rows; 0 when it is good, or is now.
 *
 * The largest entry m_i of row i is in no row j with a smaller m_j, so that one step leaves m_i / sqrt(m_i m_j)
 * of it at least: the largest ones are then between the root of min m / max m and 1. */
API int64_t values_find_scale(int64_t size, const double *restrict most, double *restrict scale);

/* Scale rows and columns alike until the largest entries of all rows are near 1 (Ruiz 2001).
 *
 * scale comes in as the diagonal of S for a matrix before, or ones; it is kept when it serves this matrix
 * too, the largest entries being within the factor stale of 1, and otherwise found from ones (starting from
 * what served another matrix would let rows and columns drift apart).  values becomes S K S. */
API void values_equilibrate(int64_t size, int64_t sweeps, double stale, const int32_t *restrict pointers,
                            const int32_t *restrict columns, double *restrict values, double *restrict scale,
                            double *restrict most);

/* remainder = rhs - K solution; returns its largest magnitude, nan when not finite. */
API double values_residual(int64_t size, const int32_t *restrict pointers, const int32_t *restrict columns,
                           const double *restrict values, const double *restrict rhs,
                           const double *restrict solution, double *restrict remainder_);

/* Bring a right-hand side to the order of a vector, scaled; its largest magnitude then. */
ALWAYS_INLINE double values_bring_scaled(int64_t size, const int32_t *restrict index, const double *restrict scale,
                                         const double *restrict rhs, double *restrict scaled_rhs) {
    double most = 0.0;
#pragma omp simd reduction(highest : most)
    for (int64_t k = 0; k < size; k++) {
        double value = rhs[index[k]] * scale[k];
        scaled_rhs[k] = value;
        most = nanmax(most, fabs(value));
    }
    return most;
}

/* The solution in the unknowns' own order. */
ALWAYS_INLINE void values_return_scaled(int64_t size, const int32_t *restrict index, const double *restrict scale,
                                        const double *restrict solution, double *restrict result) {
    for (int64_t k = 0; k < size; k++) result[index[k]] = solution[k] * scale[k];
}

/* Add one array to another. */
static inline void values_add_to(int64_t count, const double *restrict x, double *restrict y) {
    for (int64_t k = 0; k < count; k++) y[k] += x[k];
}

/* Raise the numbers of one array to those of another. */
static inline void values_raise_to(int64_t count, const double *restrict x, double *restrict y) {
    for (int64_t k = 0; k < count; k++) y[k] = nanmax(y[k], x[k]);
}

/* How far from 1 the largest entries are; rows of zeros do not count. */
static inline double values_spread_of(int64_t size, const double *restrict most) {
    double spread = 1.0;
#pragma omp simd reduction(highest : spread)
    for (int64_t k = 0; k < size; k++) {
        double value = most[k];
        value = value > 0.0 ? value : 1.0;
        spread = nanmax(spread, nanmax(value, 1.0 / value));
    }
    return spread;
}

#endif
