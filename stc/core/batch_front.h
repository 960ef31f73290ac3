/* A front of eight matrices at once: the elimination of its pivots, the same in all lanes.
 *
 * Rows and columns of a front are the unknowns of its segments, then those of the rest (ends).  Numbers are vectors of
 * eight.  Columns of ends are not part of it: what the elimination leaves there is subtracted from a corner that
 * all fronts have in common.  Fronts have many zeros, which the pattern alone does not tell: a pair [a b; b 0] of a variable and a row
 * has two columns of different patterns.  So which rows of a pivot's column are zeros is noted while it is brought up
 * to date, in a bit for each pivot of a panel, and only what is not is multiplied. */
#ifndef STC_BATCH_FRONT_H
#define STC_BATCH_FRONT_H

#include "vec8.h"

/* Pivots that are taken before what they leave is subtracted from all columns together. */
#define BATCH_PANEL 16
/* A pivot of two needs a determinant of at least this share of its larger product. */
#define BATCH_CANCELLATION 1e-3
/* Pivots no larger than this are none: see NOTHING in front.h. */
#define BATCH_NOTHING 3e-14

typedef struct {
    double *at;         /* columns of inner unknowns, rows below the diagonal; the rest is not read */
    int32_t stride;     /* rows */
    int32_t inner;      /* rows that are no ends, padded to an even number, as the ends are */
    int32_t summed, eliminated;
    int32_t *index;     /* position of each row, -1 for padding */
    double *corner;     /* the columns of all ends, */
    int32_t corner_stride, own; /* which are the positions from own on */
    double *l, *w;      /* columns of L and of L D of a panel */
    uint32_t *l_of, *w_of; /* for each row the pivots of the panel where these are not zero */
    double *column, *partner;
    double *inverse;    /* D^-1 of a panel, three vectors for each pivot */
    uint32_t pairs;     /* pivots of the panel that are the first of two */
    double threshold;
    vec8 largest, negative; /* of entries; how many pivots are negative */
    double smallest;    /* of pivots */
} batch_front;

#define AT8(k) (8 * (int64_t)(k))

/* Whether a number is not zero, in any lane; whether a >= b in all of them. */
ALWAYS_INLINE int any8(vec8 v) {
#if defined(__AVX512F__)
    return _mm512_cmp_pd_mask((__m512d)v.part[0], _mm512_setzero_pd(), _CMP_NEQ_UQ) != 0;
#elif defined(__AVX__)
    __m256d both = _mm256_or_pd((__m256d)v.part[0], (__m256d)v.part[1]);
    return !_mm256_testz_si256(_mm256_castpd_si256(both), _mm256_set1_epi64x(INT64_MAX));
#else
    int found = 0;
    for (int lane = 0; lane < 8; lane++) found |= v.part[lane / LANES][lane % LANES] != 0.0;
    return found;
#endif
}

ALWAYS_INLINE int all_at_least8(vec8 a, vec8 b) {
#if defined(__AVX512F__)
    return _mm512_cmp_pd_mask((__m512d)a.part[0], (__m512d)b.part[0], _CMP_GE_OQ) == 255;
#elif defined(__AVX__)
    __m256d low = _mm256_cmp_pd((__m256d)a.part[0], (__m256d)b.part[0], _CMP_GE_OQ);
    return _mm256_movemask_pd(_mm256_and_pd(low, _mm256_cmp_pd((__m256d)a.part[1], (__m256d)b.part[1], _CMP_GE_OQ))) == 15;
#else
    int found = 1;
    for (int lane = 0; lane < 8; lane++) found &= a.part[lane / LANES][lane % LANES] >= b.part[lane / LANES][lane % LANES];
    return found;
#endif
}

ALWAYS_INLINE double smallest8(vec8 v) { return -largest8(neg8(v)); }

/* Two rows of two columns: less the products of the pivots in `bits`. */
ALWAYS_INLINE void batch_tile(uint32_t bits, const double *restrict l, const double *restrict w, int64_t stride,
                              double *a, double *b, double *c, double *d) {
    vec8 p = load8(a, 0), q = load8(b, 0), r = load8(c, 0), s = load8(d, 0);
    for (; bits; bits &= bits - 1) {
        int64_t at = stride * __builtin_ctz(bits);
        vec8 one = load8(w, at), two = load8(w, at + 8), row = load8(l, at), next = load8(l, at + 8);
        p = sub_product8(p, row, one);
        q = sub_product8(q, next, one);
        r = sub_product8(r, row, two);
        s = sub_product8(s, next, two);
    }
    store8(a, 0, p);
    store8(b, 0, q);
    store8(c, 0, r);
    store8(d, 0, s);
}

/* Subtract L D L^T of a panel from the columns from `from` on. */
static void batch_subtract(batch_front *f, int32_t from) {
    int64_t stride = AT8(f->stride);
    for (int32_t j = from & ~1; j < f->inner; j += 2) {
        uint32_t pivots = f->w_of[j] | f->w_of[j + 1];
        if (!pivots) continue;
        double *first = f->at + j * stride, *second = first + stride;
        for (int32_t i = j; i < f->stride; i += 2) {
            uint32_t bits = pivots & (f->l_of[i] | f->l_of[i + 1]);
            if (bits)
                batch_tile(bits, f->l + AT8(i), f->w + AT8(j), stride, first + AT8(i), first + AT8(i + 1), second + AT8(i),
                           second + AT8(i + 1));
        }
    }
    for (int32_t j = f->inner; j < f->stride; j += 2) {
        uint32_t pivots = f->w_of[j] | f->w_of[j + 1];
        if (!pivots) continue;
        /* Behind the last end there is room for padding. */
        int32_t last = f->corner_stride - 1;
        int32_t one = f->index[j] - f->own, two = f->index[j + 1] < 0 ? last : f->index[j + 1] - f->own;
        double *first = f->corner + AT8(one * (int64_t)f->corner_stride);
        double *second = f->corner + AT8(two * (int64_t)f->corner_stride);
        for (int32_t i = j; i < f->stride; i += 2) {
            uint32_t bits = pivots & (f->l_of[i] | f->l_of[i + 1]);
            int32_t row = f->index[i] - f->own, next = f->index[i + 1] < 0 ? last : f->index[i + 1] - f->own;
            if (bits)
                batch_tile(bits, f->l + AT8(i), f->w + AT8(j), stride, first + AT8(row), first + AT8(next),
                           second + AT8(row), second + AT8(next));
        }
    }
}

/* Column c as it is after the pivots of the panel, from row `from` on: into `column`; the largest magnitudes below row `from`. */
static vec8 batch_bring(const batch_front *f, int32_t from, int32_t c, double *restrict column) {
    int64_t stride = AT8(f->stride);
    const double *given = f->at + c * stride;
    uint32_t of = f->w_of[c];
    vec8 most = splat8(0.0);
    for (int32_t i = from; i < c; i++) { /* rows above the diagonal are in the columns of theirs */
        vec8 a = load8(f->at, i * stride + AT8(c));
        for (uint32_t bits = of & f->l_of[i]; bits; bits &= bits - 1) {
            int64_t at = stride * __builtin_ctz(bits);
            a = sub_product8(a, load8(f->l, at + AT8(i)), load8(f->w, at + AT8(c)));
        }
        store8(column, AT8(i), a);
        if (i > from) most = max8(abs8(a), most);
    }
    int32_t i = c;
    if (i % 2) {
        vec8 a = load8(given, AT8(i));
        for (uint32_t bits = of & f->l_of[i]; bits; bits &= bits - 1) {
            int64_t at = stride * __builtin_ctz(bits);
            a = sub_product8(a, load8(f->l, at + AT8(i)), load8(f->w, at + AT8(c)));
        }
        store8(column, AT8(i), a);
        if (i > from) most = max8(abs8(a), most);
        i++;
    }
    for (; i < f->stride; i += 2) {
        vec8 a = load8(given, AT8(i)), b = load8(given, AT8(i + 1));
        for (uint32_t bits = of & (f->l_of[i] | f->l_of[i + 1]); bits; bits &= bits - 1) {
            int64_t at = stride * __builtin_ctz(bits);
            vec8 factor = load8(f->w, at + AT8(c));
            a = sub_product8(a, load8(f->l, at + AT8(i)), factor);
            b = sub_product8(b, load8(f->l, at + AT8(i + 1)), factor);
        }
        store8(column, AT8(i), a);
        store8(column, AT8(i + 1), b);
        if (i > from) most = max8(abs8(a), most);
        most = max8(abs8(b), most);
    }
    return most;
}

static void batch_swap(double *a, double *b) {
    vec8 kept = load8(a, 0);
    store8(a, 0, load8(b, 0));
    store8(b, 0, kept);
}

/* Exchange unknowns a < b of the front, none eliminated yet; the panel has `count` pivots. */
static void batch_exchange(batch_front *f, int32_t a, int32_t b, int32_t count) {
    if (a == b) return;
    int64_t stride = AT8(f->stride);
    double *one = f->at + a * stride, *two = f->at + b * stride;
    for (int32_t j = f->eliminated; j < a; j++) batch_swap(f->at + j * stride + AT8(a), f->at + j * stride + AT8(b));
    batch_swap(one + AT8(a), two + AT8(b));
    for (int32_t j = a + 1; j < b; j++) batch_swap(one + AT8(j), f->at + j * stride + AT8(b));
    for (int32_t i = b + 1; i < f->stride; i++) batch_swap(one + AT8(i), two + AT8(i));
    for (int32_t p = 0; p < count; p++) {
        batch_swap(f->l + p * stride + AT8(a), f->l + p * stride + AT8(b));
        batch_swap(f->w + p * stride + AT8(a), f->w + p * stride + AT8(b));
    }
    uint32_t bits = f->l_of[a];
    f->l_of[a] = f->l_of[b];
    f->l_of[b] = bits;
    bits = f->w_of[a];
    f->w_of[a] = f->w_of[b];
    f->w_of[b] = bits;
    /* A row of zeros has been left out where the one beside it is zero, too: not any more. */
    for (int32_t p = 0; p < count; p++)
        for (int k = 0; k < 4; k++) {
            int32_t i = ((k < 2 ? a : b) & ~1) + k % 2;
            if (!(f->l_of[i] >> p & 1)) store8(f->l, p * stride + AT8(i), splat8(0.0));
            if (!(f->w_of[i] >> p & 1)) store8(f->w, p * stride + AT8(i), splat8(0.0));
        }
    int32_t kept = f->index[a];
    f->index[a] = f->index[b];
    f->index[b] = kept;
}

/* Take unknown k of the front as pivot p of the panel; `column` is its column. */
static void batch_take_one(batch_front *f, int32_t k, int32_t p, const double *restrict column) {
    vec8 pivot = load8(column, AT8(k)), inverse = div8(splat8(1.0), pivot);
    double *l = f->l + p * AT8(f->stride), *w = f->w + p * AT8(f->stride);
    uint32_t bit = 1u << p;
    for (int32_t i = (k + 1) & ~1; i < f->stride; i += 2) {
        vec8 a = i > k ? load8(column, AT8(i)) : splat8(0.0), b = load8(column, AT8(i + 1));
        uint32_t one = any8(a) ? bit : 0, two = any8(b) ? bit : 0;
        if (!(one | two)) continue; /* what is there is not read */
        f->l_of[i] |= one;
        f->w_of[i] |= one;
        f->l_of[i + 1] |= two;
        f->w_of[i + 1] |= two;
        store8(w, AT8(i), a);
        store8(w, AT8(i + 1), b);
        store8(l, AT8(i), mul8(a, inverse));
        store8(l, AT8(i + 1), mul8(b, inverse));
    }
    store8(f->inverse, AT8(3 * p), inverse);
    f->negative = add8(f->negative, negative8(pivot));
    double size = smallest8(abs8(pivot));
    f->smallest = size < f->smallest ? size : f->smallest;
    f->eliminated = k + 1;
}

/* Take unknowns k and k + 1 together; D = [a b; b c]. */
static void batch_take_two(batch_front *f, int32_t k, int32_t p, const double *restrict first, const double *restrict second) {
    vec8 a = load8(first, AT8(k)), b = load8(first, AT8(k + 1)), c = load8(second, AT8(k + 1));
    vec8 over = div8(splat8(1.0), sub8(mul8(a, c), mul8(b, b)));
    vec8 x = mul8(c, over), y = neg8(mul8(b, over)), z = mul8(a, over);
    int64_t stride = AT8(f->stride);
    double *l = f->l + p * stride, *w = f->w + p * stride;
    uint32_t bit = 1u << p, next = 2u << p;
    uint32_t of_first = any8(x) ? bit : 0, of_second = any8(z) ? next : 0;
    for (int32_t i = (k + 2) & ~1; i < f->stride; i++) {
        vec8 u = load8(first, AT8(i)), v = load8(second, AT8(i));
        int one = any8(u) && i > k + 1, two = any8(v) && i > k + 1;
        f->w_of[i] |= (one ? bit : 0) | (two ? next : 0);
        f->l_of[i] |= (one ? of_first | next : 0) | (two ? of_second | bit : 0);
        store8(w, AT8(i), u);
        store8(w, stride + AT8(i), v);
        store8(l, AT8(i), add_product8(mul8(u, x), v, y));
        store8(l, stride + AT8(i), add_product8(mul8(u, y), v, z));
    }
    store8(f->inverse, AT8(3 * p), x);
    store8(f->inverse, AT8(3 * p + 1), y);
    store8(f->inverse, AT8(3 * p + 2), z);
    f->pairs |= bit;
    /* One of each sign where the determinant is negative, else two of that of a + c. */
    vec8 opposite = negative8(over), both = negative8(add8(a, c));
    f->negative = add8(f->negative, add8(opposite, scaled8(2.0, mul8(both, sub8(splat8(1.0), opposite)))));
    double size = 1.0 / largest8(max8(abs8(x), max8(abs8(y), abs8(z))));
    f->smallest = size < f->smallest ? size : f->smallest;
    f->eliminated = k + 2;
}

/* The summed unknown after k whose entry in the column of k is the largest where it is smallest, or -1. */
static int32_t batch_partner(const batch_front *f, int32_t k, const double *column) {
    int32_t found = -1;
    double most = 0.0;
    for (int32_t r = k + 1; r < f->summed; r++) {
        vec8 a = load8(column, AT8(r));
        if (!any8(a)) continue;
        double size = smallest8(abs8(a));
        if (size > most) {
            most = size;
            found = r;
        }
    }
    return found;
}

/* Whether unknowns k and r are good pivots together; `column` and `partner` are theirs. */
static int batch_are_pair(const batch_front *f, int32_t k, int32_t r, const double *column, const double *partner) {
    vec8 d = load8(column, AT8(k)), b = load8(column, AT8(r)), c = load8(partner, AT8(r));
    vec8 determinant = abs8(sub8(mul8(d, c), mul8(b, b))), products = max8(abs8(mul8(d, c)), mul8(b, b));
    if (!all_at_least8(determinant, scaled8(BATCH_CANCELLATION, products))) return 0;
    vec8 most = splat8(0.0), other = splat8(0.0);
    for (int32_t i = k + 1; i < f->stride; i++) {
        if (i == r) continue;
        most = max8(abs8(load8(column, AT8(i))), most);
        other = max8(abs8(load8(partner, AT8(i))), other);
    }
    vec8 one = add8(mul8(abs8(c), most), mul8(abs8(b), other)), two = add8(mul8(abs8(b), most), mul8(abs8(d), other));
    return all_at_least8(determinant, scaled8(f->threshold, max8(one, two)));
}

/* Whether a number is a pivot for a column whose largest other magnitudes are those. */
static int batch_is_pivot(const batch_front *f, vec8 d, vec8 beside) {
    return all_at_least8(abs8(d), max8(scaled8(f->threshold, beside), splat8(BATCH_NOTHING)));
}

/* Take pivots until a panel is full or there are no more; how many it has.  `limit`: unknowns from there on have been refused. */
static int32_t batch_take_panel(batch_front *f, int32_t *limit) {
    int32_t begin = f->eliminated;
    double *column = f->column, *partner = f->partner;
    f->pairs = 0;
    for (int32_t i = begin & ~1; i < f->stride; i++) f->l_of[i] = f->w_of[i] = 0;
    for (;;) {
        int32_t k = f->eliminated, count = k - begin;
        if (count >= BATCH_PANEL - 1 || k >= *limit) return count;
        vec8 beside = batch_bring(f, k, k, column), d = load8(column, AT8(k));
        f->largest = max8(beside, f->largest);
        if (batch_is_pivot(f, d, beside)) {
            batch_take_one(f, k, count, column);
            continue;
        }
        int32_t r = batch_partner(f, k, column);
        if (r >= 0) {
            batch_bring(f, k, r, partner);
            if (batch_are_pair(f, k, r, column, partner)) {
                batch_exchange(f, k + 1, r, count);
                batch_swap(column + AT8(k + 1), column + AT8(r));
                batch_swap(partner + AT8(k + 1), partner + AT8(r));
                batch_take_two(f, k, count, column, partner);
                if (*limit < f->eliminated) *limit = f->eliminated; /* the partner was one that had been refused */
                continue;
            }
            vec8 others = splat8(0.0);
            for (int32_t i = k; i < f->stride; i++)
                if (i != r) others = max8(abs8(load8(partner, AT8(i))), others);
            if (batch_is_pivot(f, load8(partner, AT8(r)), others)) { /* the partner alone: it has to come first */
                batch_exchange(f, k, r, count);
                batch_swap(partner + AT8(k), partner + AT8(r));
                batch_take_one(f, k, count, partner);
                if (*limit < f->eliminated) *limit = f->eliminated;
                continue;
            }
        }
        batch_exchange(f, k, --*limit, count);
    }
}

#endif
