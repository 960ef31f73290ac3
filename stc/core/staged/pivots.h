/* Pivots of one and two unknowns: which are acceptable, and taking them out of the window. */
#ifndef STC_PIVOTS_H
#define STC_PIVOTS_H

#include "../native.h"

/* Places in counts: pivots taken, entries of indices and of factors used, eigenvalues by sign, unknowns delayed
 * to another stage, candidates rejected, stages that left the plan. */
enum {
    PIVOTS = 0,
    INDICES = 1,
    PIVOTS_FACTORS = 2,
    POSITIVE = 3,
    PIVOTS_NEGATIVE = 4,
    ZERO = 5,
    DELAYED = 6,
    REJECTED = 7,
    STRAYED = 8,
    COUNTS = 9,
};
/* A 2x2 pivot needs a determinant of at least this much of its larger product. */
#define CANCELLATION 0.001

/* Place in the list of the largest entry among positions before last, or -1. */
int64_t pivots_best_partner(int64_t count, const int32_t *restrict found, const double *restrict values,
                            const int32_t *restrict owner, int64_t last);

/* Bring the columns of two slots to a common list, and judge the pivot; the list's length, or -1.
 *
 * The column of row_p is already in found_1 and values_1. It is the second one when swapped: the
 * second of a pair should be the one without diagonal, whose zeros are kept. */
int64_t pivots_pair_up(int64_t row_p, int64_t row_q, double a, double b, double c, int64_t swapped,
                       double threshold, double noise, int64_t count, const int32_t *restrict found_1,
                       const double *restrict values_1, int64_t top, int64_t low, int64_t high, int64_t stride,
                       const double *restrict window, int32_t *restrict found_2, double *restrict values_2,
                       int32_t *restrict found, double *restrict first, double *restrict second);

/* Eliminate a 1x1 pivot, whose column is first at the slots listed; 0 when the factors are full. */
int64_t pivots_take_one(int64_t p, double d, double most, int64_t count, const int32_t *restrict listed,
                        const double *restrict first, int64_t capacity, const int32_t *restrict slot,
                        const int32_t *restrict owner, double *restrict growth, int64_t stride,
                        double *restrict window, double *restrict spread, int32_t *restrict pivots,
                        int32_t *restrict starts, int32_t *restrict indices, double *restrict factors,
                        double *restrict inverse, int64_t *restrict counts);

/* Eliminate the 2x2 pivot [[a, b], [b, c]] with b != 0; 0 when the factors are full. */
int64_t pivots_take_two(int64_t p, int64_t q, double a, double b, double c, int64_t count,
                        const int32_t *restrict listed, const double *restrict first, const double *restrict second,
                        int64_t capacity, const int32_t *restrict slot, const int32_t *restrict owner,
                        double *restrict growth, int64_t stride, double *restrict window, double *restrict spread_1,
                        double *restrict spread_2, int32_t *restrict pivots, int32_t *restrict starts,
                        int32_t *restrict indices, double *restrict factors, double *restrict inverse,
                        int64_t *restrict counts);

/* What to eliminate when all thresholds fail and nothing can be delayed (Bunch and Parlett 1971).
 *
 * Returns the position p with the largest diagonal entry, or -1 - p for a p in the row of the largest other
 * entry when that is larger by far. */
int64_t pivots_strongest(int64_t waiting, const int32_t *restrict queue, int64_t top, int64_t low, int64_t high,
                         int64_t stride, const int32_t *restrict slot, const double *restrict window,
                         int32_t *restrict found, double *restrict values);

/* Whether [[a, b], [b, c]] is a good pivot for columns with these largest other entries. */
ALWAYS_INLINE int64_t pivots_pair_accepted(double a, double b, double c, double most_p, double most_q,
                                           double threshold, double tiny) {
    double product = a * c;
    double square = b * b;
    double size = fabs(product - square);
    double largest_entry = dmax(dmax(fabs(a), fabs(c)), fabs(b));
    int64_t good = 1;
    if (b == 0.0 || size < CANCELLATION * dmax(fabs(product), square) || size <= tiny * largest_entry)
        good = 0;
    else if (threshold * (fabs(c) * most_p + fabs(b) * most_q) > size)
        good = 0;
    else if (threshold * (fabs(b) * most_p + fabs(a) * most_q) > size)
        good = 0;
    return good;
}

/* 1 / (a c - b^2), divided by the largest entry first: it must not overflow nor vanish on the way. */
ALWAYS_INLINE double pivots_reciprocal_determinant(double a, double b, double c) {
    double scale = 1.0 / dmax(dmax(fabs(a), fabs(c)), fabs(b));
    return scale / (a * scale * c - b * scale * b);
}

/* Place of a slot in a list, or -1. */
static inline int64_t pivots_place_of(int64_t slot, int64_t count, const int32_t *restrict found) {
    int64_t place = -1;
    for (int64_t k = 0; k < count; k++)
        if (found[k] == slot) place = k;
    return place;
}

#endif
