/* Small pivots under suspicion: is the matrix singular there?
 *
 * Rounding errors pass from pivot to pivot, so what is zero in exact arithmetic may be left as a number far above the
 * rounding unit.  The vector z with L^T z = e_k has
 *
 *     K z = L D e_k        z^T K z = d_k
 *
 * so a small pivot with a long z belongs to a tiny eigenvalue: d_k / |z|^2 estimates it, and |K z| / |z|, formed with K
 * itself and not with what elimination left of it, bounds it.
 *
 * A matrix may be singular to working precision, and its small pivots right in their leading digits all the same: what
 * elimination leaves is exact for entries that are off by some rounding units of |L| |D| |L|^T (N. J. Higham, Accuracy and
 * Stability of Numerical Algorithms, 2002, section 11.1), which moves d_k by as many units of |z|^T |L| |D| |L|^T |z|. */
#include "../native.h"
#include "pivots.h"
#include "singularity.h"
#include "values.h"

/* Pivots of the equilibrated matrix below this are suspected ... */
#define SUSPECT 1e-08
/* ... this many of them at most, */
enum {
    CHECKS = 24,
};
/* and zero when the estimate of the eigenvalue is no more than this ... */
#define NULL_SHARE 1e-13
/* ... and its bound no more than this. */
#define BOUND 1e-10
/* The rounding unit. */
#define UNIT 0x1.0000000000000p-53

/* Solve L^T z = e_p, or e_p + e_q where there is a q, of pivot k.
 *
 * Returns: |z|^T |L| |D| |L|^T |z|, summed over the pivots before k. */
static double find_null_vector(int64_t k, int64_t value_at, int64_t p, int64_t q, int64_t size,
                               const int32_t *restrict pivots, const int32_t *restrict starts,
                               const int32_t *restrict indices, const double *restrict factors,
                               const double *restrict inverse, const int32_t *restrict columns,
                               const double *restrict values, double *restrict z) {
    for (int64_t i = 0; i < size; i++) z[i] = 0.0;
    z[p] = 1.0;
    if (q >= 0) z[q] = 1.0;
    double noise = 0.0;
    const double *upper = values + size;
    for (int64_t back = 0; back < k; back++) {
        int64_t e = k - 1 - back;
        int64_t one = pivots[2 * e];
        int64_t other = pivots[2 * e + 1];
        int64_t length = starts[2 * e + 1];
        double total = 0.0;
        double terms = 0.0;
        double a = inverse[3 * e];
        if (length < 0) {
            const int32_t *own = columns + starts[2 * e];
            const double *column = upper + starts[2 * e];
            for (int64_t i = 0; i < -1 - length; i++) {
                double value = column[i] * z[own[i]];
                total -= value;
                terms += fabs(value);
            }
            total *= a;
            terms = terms * fabs(a) + fabs(total);
            z[one] = total;
            noise += terms * terms / fabs(a);
            continue;
        }
        value_at -= length;
        if (other >= 0) value_at -= length;
        const int32_t *own = indices + starts[2 * e];
        const double *column = factors + value_at;
        if (other < 0) {
            for (int64_t i = 0; i < length; i++) {
                double value = column[i] * z[own[i]];
                total -= value;
                terms += fabs(value);
            }
            terms += fabs(total);
            noise += terms * terms / fabs(a);
        } else {
            double total_other = 0.0;
            double terms_other = 0.0;
            for (int64_t i = 0; i < length; i++) {
                double value = column[i] * z[own[i]];
                double value_other = column[length + i] * z[own[i]];
                total -= value;
                terms += fabs(value);
                total_other -= value_other;
                terms_other += fabs(value_other);
            }
            terms += fabs(total);
            terms_other += fabs(total_other);
            double b = inverse[3 * e + 1];
            double c = inverse[3 * e + 2];
            double weighted =
                terms * (fabs(c) * terms + 2.0 * fabs(b) * terms_other) + fabs(a) * terms_other * terms_other;
            noise += weighted / fabs(a * c - b * b);
            z[other] = total_other;
        }
        z[one] = total;
    }
    return noise;
}

/* Whether position p of pivot k, with diagonal entry d in D, stands for an eigenvalue zero. */
static int64_t is_null(int64_t k, int64_t value_at, int64_t p, double d, int64_t size,
                       const int32_t *restrict pivots, const int32_t *restrict starts,
                       const int32_t *restrict indices, const double *restrict factors,
                       const double *restrict inverse, const int32_t *restrict pointers,
                       const int32_t *restrict columns, const double *restrict values, const double *restrict zeros,
                       double *restrict z, double *restrict image) {
    find_null_vector(k, value_at, p, -1, size, pivots, starts, indices, factors, inverse, columns, values, z);
    double square = 0.0;
    for (int64_t i = 0; i < size; i++) square += z[i] * z[i];
    if (fabs(d) > NULL_SHARE * square) return 0;
    double bound = values_residual(size, pointers, columns, values, zeros, z, image) / sqrt(square);
    return bound <= BOUND;
}

void singularity_confirm_zeros(int64_t size, int64_t variables, double replacement, const double *restrict certain,
                               const int32_t *restrict order, const int32_t *restrict pointers,
                               const int32_t *restrict columns, const double *restrict values,
                               const int32_t *restrict pivots, const int32_t *restrict starts,
                               const int32_t *restrict indices, const double *restrict factors,
                               double *restrict inverse, const double *restrict zeros, double *restrict z,
                               double *restrict image, int64_t *restrict counts) {
    int64_t checks = 0;
    int64_t value_at = 0;
    for (int64_t k = 0, end_k = counts[PIVOTS]; k < end_k; k++) {
        int64_t p = pivots[2 * k];
        int64_t q = pivots[2 * k + 1];
        int64_t own_at = value_at;
        value_at += imax(starts[2 * k + 1], 0);
        if (q >= 0) value_at += starts[2 * k + 1];
        double a = inverse[3 * k];
        double b = q >= 0 ? inverse[3 * k + 1] : 0.0;
        double c = q >= 0 ? inverse[3 * k + 2] : 0.0;
        double total = fabs(a) + fabs(b) + fabs(c);
        if (total - total != 0.0) { /* overflowed */
            counts[PIVOTS_NEGATIVE]--;
            counts[ZERO]++;
            continue;
        }
        double largest = dmax(dmax(fabs(a), fabs(b)), fabs(c));
        if (q < 0) {
            if (largest * SUSPECT <= 1.0) continue;
        } else if (largest > SUSPECT * fabs(a * c - b * b)) { /* D = [[c, -b], [-b, a]] / (a c - b^2) */
            continue;
        }
        if (checks >= CHECKS) return;
        checks++;
        double d = q < 0 ? 1.0 / a : largest / (a * c - b * b);
        int64_t null = 1;
        for (int64_t which = 0; which < (q < 0 ? 1 : 2); which++) {
            if (null != 0) {
                null = is_null(k, own_at, which == 0 ? p : q, d, size, pivots, starts, indices, factors, inverse,
                               pointers, columns, values, zeros, z, image);
            }
        }
        if (null != 0) {
            double noise = find_null_vector(k, own_at, p, q, size, pivots, starts, indices, factors, inverse,
                                            columns, values, z);
            noise += q < 0 ? fabs(d) : 4.0 * fabs(d);
            null = fabs(d) <= certain[0] * UNIT * noise;
        }
        if (null == 0) continue;
        inverse[3 * k] = 1.0 / (order[p] < variables ? replacement : -replacement);
        if (q < 0) {
            counts[d > 0.0 ? POSITIVE : PIVOTS_NEGATIVE]--;
            counts[ZERO]++;
        } else {
            if (a * c < b * b) {
                counts[POSITIVE]--;
                counts[PIVOTS_NEGATIVE]--;
            } else {
                counts[a > 0.0 ? POSITIVE : PIVOTS_NEGATIVE] -= 2;
            }
            counts[ZERO] += 2;
            inverse[3 * k + 1] = 0.0;
            inverse[3 * k + 2] = 1.0 / (order[q] < variables ? replacement : -replacement);
        }
    }
}
