/* Solving with the factors of elimination.h, and refining against the matrix itself. */
#ifndef STC_SUBSTITUTION_H
#define STC_SUBSTITUTION_H

#include "../native.h"

/* Residuals are relative to the right-hand side plus the solution, or this much of the right-hand side. */
#define LARGEST_GAIN 1000000.0

/* Overwrite x with the solution of L D L^T x = x; upper are the entries at columns.
 *
 * The same for other_x, in one pass over the factors, when both is not 0. Pivots of a panel share their rows:
 * where these are many, what belongs to them is copied to part and back once. There is room for a vector more in
 * factors and the parts. */
void substitution_substitute(int64_t both, int64_t count, const int32_t *restrict columns,
                             const double *restrict upper, const int32_t *restrict pivots,
                             const int32_t *restrict starts, const int32_t *restrict indices,
                             double *restrict factors, const double *restrict inverse, double *restrict x,
                             double *restrict other_x, double *restrict part, double *restrict other_part);

/* Solve K x = rhs with the factors of S K S; rhs and result (N,) in the unknowns' own order.
 *
 * The same for other_rhs, in common passes over the factors, when both is not 0: report then tells of the
 * one that is less accurate. Refinement stops at the relative residual accuracy[0], when it no longer falls by
 * half, or after refinements steps; the best solution is kept. */
API void substitution_solve(int64_t both, int64_t size, int64_t refinements, const double *restrict accuracy,
                            const int32_t *restrict pointers, const int32_t *restrict columns,
                            const double *restrict values, const double *restrict scale,
                            const int32_t *restrict order, const int64_t *restrict pivot_count,
                            const int32_t *restrict pivots, const int32_t *restrict starts,
                            const int32_t *restrict indices, double *restrict factors,
                            const double *restrict inverse, const double *restrict rhs, double *restrict scaled_rhs,
                            double *restrict solution, double *restrict change, double *restrict result,
                            double *restrict part, const double *restrict other_rhs,
                            double *restrict other_scaled_rhs, double *restrict other_solution,
                            double *restrict other_change, double *restrict other_result,
                            double *restrict other_part, double *restrict report, double *restrict other_report);

/* Whether to refine a solution once more, after it was changed; it is changed back where that made it worse.
 *
 * steps: refinements so far, of refinements.
 * accuracy: relative residual to reach.
 * remaining, length, highest: largest magnitudes of the residual, of the right-hand side, of the solution.
 * report: its first number is the relative residual before and afterwards, 1 at first.
 * change, solution: (size,). */
ALWAYS_INLINE int64_t substitution_improves(int64_t size, int64_t steps, int64_t refinements, double accuracy,
                                            double remaining, double length, double highest,
                                            double *restrict report, const double *restrict change,
                                            double *restrict solution) {
    double now = remaining / (length + nanmin(highest, LARGEST_GAIN * length));
    double before = report[0];
    if (!(now < before)) {
        if (steps > 0)
            for (int64_t k = 0; k < size; k++) solution[k] -= change[k];
        else
            report[0] = now;
        return 0;
    }
    report[0] = now;
    return now > 0.5 * before || now <= accuracy || steps >= refinements ? 0 : 1;
}

#endif
