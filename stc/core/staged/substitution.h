/* Refining a solution against the matrix itself. */
#ifndef STC_SUBSTITUTION_H
#define STC_SUBSTITUTION_H

#include "../native.h"

/* Residuals are relative to the right-hand side plus the solution, or this much of the right-hand side. */
#define LARGEST_GAIN 1000000.0

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
