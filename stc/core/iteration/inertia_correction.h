/* Inertia correction, compiled: which shift of the Hessian to try next. */
#ifndef STC_INERTIA_CORRECTION_H
#define STC_INERTIA_CORRECTION_H

#include "../native.h"

/* The median of the magnitudes that are not zero, 0 where all are; of two, the larger one.  Reorders values.
 *
 * Found by parting them again and again (C. A. R. Hoare, Algorithm 65: find, Commun. ACM 4, 1961). */
API double inertia_correction_median_magnitude(int64_t count, double *restrict values);

/* Prepare the factorisation at an iterate; factorize does it. */
API void inertia_correction_begin(const int64_t *calls, double *s);

/* The next shift to try, after another one or the last iterate's; more than LARGEST_SHIFT where there is none.
 *
 * Steps are the longer the nearer a shift is to the smallest that serves (J. J. More and D. C. Sorensen, SIAM J. Sci.
 * Stat. Comput. 4, 1983): where a smaller one than the last iterate's has failed, that is tried next, before larger
 * ones. Of a damped Hessian, whose shifts are small, a larger one costs less than a factorisation. */
API double inertia_correction_larger_shift(const double *restrict s);

/* Factorise, shifting until the inertia is right.
 *
 * Returns: What somebody else has to do before this goes on: REFACTOR the matrix and leave its inertia (3,), and so
 * on; s[ENDED_BY] keeps it. */
API int64_t inertia_correction_factorize(const int64_t *calls, int64_t n, int64_t m, int64_t count,
                                         const int64_t *diagonal, const double *bend, const double *hess,
                                         double *scratch, const int64_t *inertia, double *accuracy, double *s);

/* Let the stiffness go where a step is accepted nearly whole, and where none is (length 0). */
void inertia_correction_relax(double length, double *restrict s);

#endif
