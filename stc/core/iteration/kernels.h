/* Points of the iteration, compiled: each pass goes once over the vectors and leaves a few numbers. */
#ifndef STC_KERNELS_H
#define STC_KERNELS_H

#include "../native.h"

enum {
    EQUALITY = 0,
    INEQUALITY = 1,
    IGNORED = 2,
};

/* Sum of the logarithms of positive numbers, nan when one is not. */
API double kernels_log_sum(int64_t count, const double *restrict values);

/* What dual errors are divided by where multipliers are large, given the sum of their magnitudes.
 *
 * Bounded, because multipliers that grow without limit are no sign of optimality. */
API double kernels_multiplier_scale(double total, int64_t count);

/* Errors of the optimality conditions; residual becomes the gradient of the whole Lagrangian.
 *
 * unit is the scaled objective that is 1 in the user's terms. */
API void kernels_measure(int64_t size, int64_t m, int64_t gaps, double unit, const int64_t *restrict index,
                         const double *restrict sign, const double *restrict mu, const double *restrict w,
                         const double *restrict y, const double *restrict z, const double *restrict gap,
                         const double *restrict c, const double *restrict dual, double *restrict residual,
                         double *restrict s);

/* Largest (limit - value) * unit of rows and variables, at least 0; infinite where a row is no number. */
API void kernels_overstepped(int64_t row_count, const int64_t *restrict row_places,
                             const double *restrict row_limits, const double *restrict row_units,
                             const double *restrict r, int64_t x_count, const int64_t *restrict x_places,
                             const double *restrict x_limits, const double *restrict x_units,
                             const double *restrict x, double *restrict out);

/* Copy a vector. */
API void kernels_copy(int64_t count, const double *restrict source, double *restrict target);

/* The point at a fraction of the step, and its variables where the functions look for them. */
API void kernels_place(int64_t n, int64_t size, const double *restrict alpha, const double *restrict w,
                       const double *restrict dw, double *restrict trial, double *restrict x);

/* Gaps, residual of the rows and what the filter asks of a point whose rows have been evaluated. */
API void kernels_inspect(int64_t n, int64_t m, int64_t gaps, const int64_t *restrict index,
                         const double *restrict sign, const double *restrict bound, const int32_t *restrict kind,
                         const double *restrict w, const double *restrict r, double *restrict gap,
                         double *restrict c, double *restrict s);

/* Multipliers of the trial point.
 *
 * The rows' multipliers take that fraction of their step that leaves the smallest gradient of the Lagrangian, to
 * first order, when the primal and the dual variables take different fractions of theirs. A shift of the Hessian is
 * no part of the Lagrangian, and a large one shows in dy: it counts as well. */
API void kernels_blend(int64_t n, int64_t m, int64_t gaps, const int64_t *restrict index,
                       const double *restrict sign, const double *restrict shifts, const double *restrict moving,
                       const int32_t *restrict start, const int32_t *restrict order, const int32_t *restrict rows,
                       const double *restrict jac, const double *restrict alpha, const double *restrict shifted,
                       const double *restrict mu, const double *restrict residual, const double *restrict dw,
                       const double *restrict dy, const double *restrict dz, const double *restrict y,
                       const double *restrict z, const double *restrict trial_gap, double *restrict left,
                       double *restrict turn, double *restrict trial_y, double *restrict trial_z,
                       double *restrict evaluated_y, const double *restrict s);

/* Make the trial point the iterate, unless a derivative is not finite there. */
API void kernels_move(int64_t n, int64_t m, int64_t gaps, const double *restrict moving,
                      const int32_t *restrict start, const int32_t *restrict order, const int32_t *restrict rows,
                      const double *restrict gradient, const double *restrict jac, const double *restrict status,
                      const double *restrict trial_w, const double *restrict trial_y,
                      const double *restrict trial_z, const double *restrict trial_f,
                      const double *restrict trial_r, const double *restrict trial_gap,
                      const double *restrict trial_c, double *restrict trial_dual, double *restrict w,
                      double *restrict y, double *restrict z, double *restrict r, double *restrict gap,
                      double *restrict c, double *restrict dual, double *restrict s);

/* Complete an iterate that has been evaluated and inspected. */
API void kernels_adopt(int64_t n, int64_t m, const double *restrict moving, const int32_t *restrict start,
                       const int32_t *restrict order, const int32_t *restrict rows, const double *restrict y,
                       const double *restrict gradient, const double *restrict jac, const double *restrict status,
                       double *restrict dual, const double *restrict f, double *restrict s);

/* Move w inside its bounds by push, relative to the bound's size or the bounds' distance. */
API void kernels_push_inside(int64_t size, double push, const double *restrict lower, const double *restrict upper,
                             double *restrict w);

API void kernels_times(int64_t count, const int64_t *restrict rows, const int64_t *restrict cols,
                       const double *restrict values, const double *restrict v, double *restrict out);

API void kernels_symmetric_times(int64_t count, const int64_t *restrict rows, const int64_t *restrict cols,
                                 const double *restrict values, const double *restrict v, double *restrict out);

/* The barrier function phi plus the violations c (m,) times the multipliers that a step leads to. */
static inline double kernels_lagrangian_after(int64_t m, double phi, const double *restrict y,
                                              const double *restrict dy, const double *restrict c) {
    double total = phi;
#pragma omp simd reduction(+ : total)
    for (int64_t r = 0; r < m; r++) total += (y[r] + dy[r]) * c[r];
    return total;
}

#endif
