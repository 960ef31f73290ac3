/* Scales, and vectors in the order of an elimination. */
#ifndef STC_VALUES_H
#define STC_VALUES_H

#include "../native.h"

/* Improve the scale by the largest entries of the rows; 0 when it is good, or is now.
 *
 * The largest entry m_i of row i is in no row j with a smaller m_j, so that one step leaves m_i / sqrt(m_i m_j)
 * of it at least: the largest ones are then between the root of min m / max m and 1. */
API int64_t values_find_scale(int64_t size, const double *restrict most, double *restrict scale);

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
