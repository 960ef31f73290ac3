/* Which small pivots stand for an eigenvalue zero.
 *
 * Elimination leaves a singular matrix with pivots of the size of rounding errors times its growth, so what is zero in
 * exact arithmetic may be left as a number far above the rounding unit.  The vector z with L^T z = e_k has
 *
 *     K z = L D e_k,      z^T K z = d_k
 *
 * so a small pivot with a long z belongs to a tiny eigenvalue: d_k / |z|^2 estimates it, and |K z| / |z|, formed with K
 * itself and not with what elimination left of it, bounds it. */
#ifndef STC_SINGULAR_H
#define STC_SINGULAR_H

#include "substitute.h"

/* The smallest pivots below SUSPECT are looked at, so many at most and until FUTILE of them have turned out to be none, or one
 * if the next is not below SMALL.
 * One that has been none is looked at again, with the same plan, where it is AGAIN times smaller than it was then.
 * They are zero when the estimate of the eigenvalue is no more than NULL_ESTIMATE, and its bound no more than NULL_BOUND. */
#define SUSPECT 1e-4
#define SMALL 1e-6
#define SUSPECTS 24
#define FUTILE 2
#define AGAIN 10.0
#define NULL_ESTIMATE 1e-13
#define NULL_BOUND 1e-10
#define INVERSE_STEPS 2

/* Solve L^T z = e_p, p counted in front `at`. */
static void find_vector(kkt_state *s, int32_t at, int32_t p, double *z) {
    double *y = s->work;
    memset(z, 0, sizeof(double) * (size_t)s->size);
    z[s->index[s->fronts[at].index_at + p]] = 1.0;
    for (int32_t f = at; f >= 0; f--) {
        const factored *g = &s->fronts[f];
        const int32_t *index = s->index + g->index_at;
        int32_t taken = f == at ? p : g->eliminated;
        double any = 0.0;
        for (int32_t k = 0; k < g->size; k++) any += fabs(y[k] = z[index[k]]);
        if (any == 0.0) continue;
        backward_front(s->factors.at + g->factor_at, g->stride, taken, g->size, y);
        for (int32_t k = 0; k < taken; k++) z[index[k]] = y[k];
    }
}

static int is_null(kkt_state *s, int32_t at, int32_t p, double d, double *z, double *image) {
    double square = 0.0;
    find_vector(s, at, p, z);
    for (int32_t i = 0; i < s->size; i++) square += z[i] * z[i];
    if (fabs(d) > NULL_ESTIMATE * square) return 0;
    memset(s->vector[2], 0, sizeof(double) * (size_t)s->size);
    for (int step = 0; step <= INVERSE_STEPS; step++) {
        if (residual(s, s->left, s->filled, s->vector[2], z, image) / sqrt(square) <= NULL_BOUND) return 1;
        substitute(s, z, NULL); /* with factors that are off, z is, too: inverse iteration mends that */
        double largest = largest_of(z, s->size);
        square = 0.0;
        for (int32_t i = 0; i < s->size; i++) {
            z[i] /= largest;
            square += z[i] * z[i];
        }
    }
    return 0;
}

typedef struct {
    int32_t front, place;
    double size;
} suspect;

/* The smallest pivots, in order; how many. */
static int find_suspects(kkt_state *s, suspect *found) {
    int count = 0;
    int64_t *inertia = s->k->inertia;
    for (int32_t at = 0; at < s->plan->fronts; at++) {
        const factored *f = &s->fronts[at];
        for (int32_t k = 0; k < f->eliminated; k++) {
            uint8_t kind = s->kind[f->first + k];
            const double *inverse = s->inverse + 3 * (int64_t)(f->first + k);
            double a = inverse[0], b = inverse[1], c = inverse[2], total = fabs(a) + fabs(b) + fabs(c);
            if (kind == SECOND) continue;
            if (!(total - total == 0.0)) { /* overflowed */
                inertia[inertia[1] > 0 ? 1 : 0]--;
                inertia[2]++;
                continue;
            }
            double largest = fabs(a) > fabs(b) ? fabs(a) : fabs(b);
            largest = fabs(c) > largest ? fabs(c) : largest;
            double size = kind == ONE ? 1.0 / fabs(a) : largest / fabs(a * c - b * b);
            double regular = s->regular[s->index[f->index_at + k]];
            if (!(size < SUSPECT && AGAIN * size < regular) || fabs(a) == 1.0 / REPLACEMENT) continue;
            if (count == SUSPECTS && size >= found[count - 1].size) continue;
            int put = count < SUSPECTS ? count++ : count - 1;
            for (; put > 0 && found[put - 1].size > size; put--) found[put] = found[put - 1];
            found[put] = (suspect){at, k, size};
        }
    }
    return count;
}

/* Count pivots as zero, and replace them, where the matrix is singular to working precision. */
static void confirm_zeros(kkt_state *s) {
    double *z = s->vector[0], *image = s->vector[1];
    int64_t *inertia = s->k->inertia;
    suspect suspects[SUSPECTS];
    int count = find_suspects(s, suspects), futile = 0;
    for (int which = 0; which < count && futile < FUTILE; which++) {
        if (futile && suspects[which].size > SMALL) break;
        int32_t at = suspects[which].front, k = suspects[which].place;
        const factored *f = &s->fronts[at];
        const int32_t *index = s->index + f->index_at;
        double *inverse = s->inverse + 3 * (int64_t)(f->first + k), a = inverse[0], b = inverse[1], c = inverse[2];
        int32_t q = s->kind[f->first + k] == FIRST ? k + 1 : -1;
        double d = suspects[which].size;
        if (!is_null(s, at, k, d, z, image) || (q >= 0 && !is_null(s, at, q, d, z, image))) {
            s->regular[index[k]] = d;
            futile++;
            continue;
        }
        inverse[0] = (index[k] < s->variables ? 1.0 : -1.0) / REPLACEMENT;
        if (q < 0) {
            inertia[a > 0.0 ? 0 : 1]--;
            inertia[2]++;
        } else {
            if (a * c < b * b) {
                inertia[0]--;
                inertia[1]--;
            } else {
                inertia[a > 0.0 ? 0 : 1] -= 2;
            }
            inertia[2] += 2;
            inverse[1] = 0.0;
            inverse[2] = (index[q] < s->variables ? 1.0 : -1.0) / REPLACEMENT;
        }
    }
}

#endif
