/* A front of eight matrices at once: the elimination of its pivots, the same in all lanes.
 *
 * Rows and columns of a front are the unknowns of its segments, then those of the rest (ends).  Numbers are vectors of
 * eight.  Columns of ends are not part of it: what the elimination leaves there is subtracted from a corner that
 * all fronts have in common.  Fronts have rows of zeros that the pattern alone does not tell.  So rows that are zero in all
 * pivots of a panel and all lanes are left out before what the panel leaves is subtracted: the others are packed. */
#ifndef STC_BATCH_FRONT_H
#define STC_BATCH_FRONT_H

#include "native.h"
#include "vec8.h"

/* Pivots that are taken before what they leave is subtracted from all columns together: so few that packed rows stay in
 * the first cache. */
#define BATCH_PANEL 5
/* A pivot of two needs a determinant of at least this share of its larger product. */
#define BATCH_CANCELLATION 1e-3
/* An entry of at least this share of the largest of its column is a good partner. */
#define BATCH_GOOD_PARTNER 0.01
/* Pivots no larger than this are none: see NOTHING in front.h. */
#define BATCH_NOTHING 3e-14
/* Rows and columns of a tile of products that is held in registers. */
#if defined(__AVX512F__) || defined(__aarch64__)
#define BATCH_ROWS 4
#elif defined(__AVX__)
#define BATCH_ROWS 3
#else
#define BATCH_ROWS 2
#endif
#define BATCH_COLUMNS 4

typedef struct {
    double *at;         /* columns of inner unknowns, rows below the diagonal; the rest is not read */
    int32_t stride;     /* rows */
    int32_t inner;      /* rows that are no ends */
    int32_t summed, eliminated;
    int32_t *index;     /* position of each row */
    double *corner;     /* the columns of all ends, */
    int32_t corner_stride, own; /* which are the positions from own on */
    double *w;          /* columns of L D of a panel */
    double *l;          /* room for those of L */
    double *inverse;    /* D^-1 of a panel, three vectors for each pivot */
    uint32_t pairs;     /* pivots of the panel that are the first of two */
    int32_t *row;       /* packed rows, */
    int32_t packed, count; /* how many, and how many of them are no ends */
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

/* What is not zero where one of the two is not. */
ALWAYS_INLINE vec8 either8(vec8 a, vec8 b) {
    for (int part = 0; part < 8 / LANES; part++) a.part[part] = (lanes)((masks)a.part[part] | (masks)b.part[part]);
    return a;
}

ALWAYS_INLINE double smallest8(vec8 v) { return -largest8(neg8(v)); }

/* Rows by columns: less the products of `count` pivots.  Those of L are packed, `step` numbers apart. */
ALWAYS_INLINE void batch_tile(int rows, int columns, const batch_front *f, int32_t count, const double *restrict l, int64_t step,
                              const int32_t *own_row, double *const *column, const int64_t *row) {
    int64_t stride = AT8(f->stride), place[BATCH_COLUMNS];
#pragma GCC unroll 8
    for (int j = 0; j < columns; j++) place[j] = AT8(own_row[j]);
    for (int part = 0; part < 8; part += LANES) {
        lanes sum[BATCH_ROWS][BATCH_COLUMNS];
        const double *from = l + part, *of = f->w + part;
#pragma GCC unroll 8
        for (int j = 0; j < columns; j++)
#pragma GCC unroll 8
            for (int i = 0; i < rows; i++) sum[i][j] = loadw(column[j], row[i] + part);
        for (int32_t p = 0; p < count; p++, from += step, of += stride) {
            lanes own[BATCH_ROWS];
#pragma GCC unroll 8
            for (int i = 0; i < rows; i++) own[i] = loadw(from, 8 * i);
#pragma GCC unroll 8
            for (int j = 0; j < columns; j++) {
                lanes factor = loadw(of, place[j]);
#pragma GCC unroll 8
                for (int i = 0; i < rows; i++) sum[i][j] -= own[i] * factor;
            }
        }
#pragma GCC unroll 8
        for (int j = 0; j < columns; j++)
#pragma GCC unroll 8
            for (int i = 0; i < rows; i++) storew(column[j], row[i] + part, sum[i][j]);
    }
}

/* So many columns, which are the packed rows from j on, and the rows from there on. */
ALWAYS_INLINE void batch_tiles(int columns, const batch_front *f, const double *l, int32_t count, int32_t j, double *const *column,
                               const int64_t *row) {
    int64_t step = AT8(f->packed);
    const int32_t *own = f->row + j;
    int32_t i = j;
    for (; i + BATCH_ROWS <= f->packed; i += BATCH_ROWS)
        batch_tile(BATCH_ROWS, columns, f, count, l + AT8(i), step, own, column, row + i);
#if BATCH_ROWS > 3
    if (f->packed - i == 3) batch_tile(3, columns, f, count, l + AT8(i), step, own, column, row + i);
    else
#endif
    if (f->packed - i == 2) batch_tile(2, columns, f, count, l + AT8(i), step, own, column, row + i);
    else if (f->packed - i == 1) batch_tile(1, columns, f, count, l + AT8(i), step, own, column, row + i);
}

/* Subtract L D L^T of a packed panel of so many pivots; `place`: room for where the rows are. */
static void batch_subtract(const batch_front *f, const double *l, int32_t count, int64_t *place) {
    for (int32_t i = 0; i < f->packed; i++) place[i] = AT8(f->row[i]);
    for (int32_t j = 0, end = f->count, wide; j < f->packed; j += wide) {
        if (j == f->count) {
            end = f->packed;
            for (int32_t i = j; i < end; i++) place[i] = AT8(f->index[f->row[i]] - f->own);
        }
        double *column[BATCH_COLUMNS], *begin = j < f->count ? f->at : f->corner;
        int64_t stride = j < f->count ? f->stride : f->corner_stride;
        wide = end - j < BATCH_COLUMNS ? end - j : BATCH_COLUMNS;
        for (int32_t k = 0; k < wide; k++) column[k] = begin + stride * place[j + k];
        if (wide == 4) batch_tiles(4, f, l, count, j, column, place);
        else if (wide == 3) batch_tiles(3, f, l, count, j, column, place);
        else if (wide == 2) batch_tiles(2, f, l, count, j, column, place);
        else batch_tiles(1, f, l, count, j, column, place);
    }
}

/* Row i of columns p (and p + 1) of L, from those of L D. */
ALWAYS_INLINE int batch_divide_row(const batch_front *f, int32_t p, int64_t step, int32_t i, vec8 *one, vec8 *other) {
    vec8 u = load8(f->w, p * step + AT8(i)), x = load8(f->inverse, AT8(3 * p));
    if (!(f->pairs >> p & 1)) {
        *one = mul8(u, x);
        return 0;
    }
    vec8 v = load8(f->w, (p + 1) * step + AT8(i)), y = load8(f->inverse, AT8(3 * p + 1)), z = load8(f->inverse, AT8(3 * p + 2));
    *one = add_product8(mul8(u, x), v, y);
    *other = add_product8(mul8(u, y), v, z);
    return 1;
}

/* Column c as it is after the `count` pivots of the panel, from row `from` on: into `column`; the largest magnitudes below
 * row `from`. */
static vec8 batch_bring(const batch_front *f, int32_t from, int32_t c, int32_t count, double *restrict column) {
    int64_t stride = AT8(f->stride), at[BATCH_PANEL];
    _Alignas(64) double factor[8 * BATCH_PANEL];
    int32_t of = 0;
    for (int32_t p = 0; p < count; p++) {
        vec8 one, other = splat8(0.0);
        int pair = batch_divide_row(f, p, stride, c, &one, &other);
        if (any8(one)) {
            store8(factor, AT8(of), one);
            at[of++] = p * stride;
        }
        p += pair;
        if (pair && any8(other)) {
            store8(factor, AT8(of), other);
            at[of++] = p * stride;
        }
    }
    vec8 most = splat8(0.0);
    const double *given = f->at + c * stride, *w = f->w;
    for (int32_t i = from; i < c; i++) { /* rows above the diagonal are in the columns of theirs */
        vec8 a = load8(f->at, i * stride + AT8(c));
        for (int32_t q = 0; q < of; q++) a = sub_product8(a, load8(factor, AT8(q)), load8(w, at[q] + AT8(i)));
        store8(column, AT8(i), a);
        if (i > from) most = max8(abs8(a), most);
    }
    int32_t i = c;
    if (i == from) {
        vec8 a = load8(given, AT8(i));
        for (int32_t q = 0; q < of; q++) a = sub_product8(a, load8(factor, AT8(q)), load8(w, at[q] + AT8(i)));
        store8(column, AT8(i), a);
        i++;
    }
    for (; i + 2 <= f->stride; i += 2) {
        vec8 a = load8(given, AT8(i)), b = load8(given, AT8(i + 1));
        for (int32_t q = 0; q < of; q++) {
            vec8 own = load8(factor, AT8(q));
            a = sub_product8(a, own, load8(w, at[q] + AT8(i)));
            b = sub_product8(b, own, load8(w, at[q] + AT8(i + 1)));
        }
        store8(column, AT8(i), a);
        store8(column, AT8(i + 1), b);
        most = max8(abs8(a), max8(abs8(b), most));
    }
    if (i < f->stride) {
        vec8 a = load8(given, AT8(i));
        for (int32_t q = 0; q < of; q++) a = sub_product8(a, load8(factor, AT8(q)), load8(w, at[q] + AT8(i)));
        store8(column, AT8(i), a);
        most = max8(abs8(a), most);
    }
    return most;
}

static void batch_swap(double *a, double *b) {
    vec8 kept = load8(a, 0);
    store8(a, 0, load8(b, 0));
    store8(b, 0, kept);
}

/* Exchange unknowns a < b of the front, none eliminated yet; so many columns of the panel have these rows. */
static void batch_exchange(batch_front *f, int32_t a, int32_t b, int32_t count) {
    if (a == b) return;
    int64_t stride = AT8(f->stride);
    double *one = f->at + a * stride, *two = f->at + b * stride;
    for (int32_t j = f->eliminated; j < a; j++) batch_swap(f->at + j * stride + AT8(a), f->at + j * stride + AT8(b));
    batch_swap(one + AT8(a), two + AT8(b));
    for (int32_t j = a + 1; j < b; j++) batch_swap(one + AT8(j), f->at + j * stride + AT8(b));
    for (int32_t i = b + 1; i < f->stride; i++) batch_swap(one + AT8(i), two + AT8(i));
    for (int32_t p = 0; p < count; p++) batch_swap(f->w + p * stride + AT8(a), f->w + p * stride + AT8(b));
    int32_t kept = f->index[a];
    f->index[a] = f->index[b];
    f->index[b] = kept;
}

/* Take unknown k of the front as pivot p of the panel, where its column is already. */
static void batch_take_one(batch_front *f, int32_t k, int32_t p) {
    vec8 pivot = load8(f->w, p * AT8(f->stride) + AT8(k));
    store8(f->inverse, AT8(3 * p), div8(splat8(1.0), pivot));
    f->negative = add8(f->negative, negative8(pivot));
    double size = smallest8(abs8(pivot));
    f->smallest = size < f->smallest ? size : f->smallest;
    f->eliminated = k + 1;
}

/* Take unknowns k and k + 1 together; D = [a b; b c]. */
static void batch_take_two(batch_front *f, int32_t k, int32_t p) {
    const double *first = f->w + p * AT8(f->stride), *second = first + AT8(f->stride);
    vec8 a = load8(first, AT8(k)), b = load8(first, AT8(k + 1)), c = load8(second, AT8(k + 1));
    vec8 over = div8(splat8(1.0), sub8(mul8(a, c), mul8(b, b)));
    vec8 x = mul8(c, over), y = neg8(mul8(b, over)), z = mul8(a, over);
    store8(f->inverse, AT8(3 * p), x);
    store8(f->inverse, AT8(3 * p + 1), y);
    store8(f->inverse, AT8(3 * p + 2), z);
    f->pairs |= 1u << p;
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

/* Whether the unknown after k, which most are paired with as planned, is to be tried first. */
static int batch_next_suits(const batch_front *f, int32_t k, const double *column, vec8 beside) {
    return k + 1 < f->summed && all_at_least8(abs8(load8(column, AT8(k + 1))), scaled8(BATCH_GOOD_PARTNER, beside))
           && any8(beside);
}

/* Whether unknowns k and r are good pivots together; `column` and `partner` are theirs. */
static int batch_are_pair(const batch_front *f, int32_t k, int32_t r, const double *column, const double *partner) {
    vec8 d = load8(column, AT8(k)), b = load8(column, AT8(r)), c = load8(partner, AT8(r));
    vec8 determinant = abs8(sub8(mul8(d, c), mul8(b, b))), products = max8(abs8(mul8(d, c)), mul8(b, b));
    products = max8(scaled8(BATCH_CANCELLATION, products), splat8(BATCH_NOTHING * BATCH_NOTHING));
    if (!all_at_least8(determinant, products)) return 0;
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
    f->pairs = 0;
    for (;;) {
        int32_t k = f->eliminated, count = k - begin;
        if (count >= BATCH_PANEL - 1 || k >= *limit) return count;
        double *column = f->w + count * AT8(f->stride), *partner = column + AT8(f->stride);
        vec8 beside = batch_bring(f, k, k, count, column), d = load8(column, AT8(k));
        f->largest = max8(beside, f->largest);
        if (batch_is_pivot(f, d, beside)) {
            batch_take_one(f, k, count);
            continue;
        }
        int32_t r = batch_next_suits(f, k, column, beside) ? k + 1 : batch_partner(f, k, column);
        if (r >= 0) {
            batch_bring(f, k, r, count, partner);
            if (batch_are_pair(f, k, r, column, partner)) {
                batch_exchange(f, k + 1, r, count + 2);
                batch_take_two(f, k, count);
                if (*limit < f->eliminated) *limit = f->eliminated; /* the partner was one that had been refused */
                continue;
            }
            vec8 others = splat8(0.0);
            for (int32_t i = k; i < f->stride; i++)
                if (i != r) others = max8(abs8(load8(partner, AT8(i))), others);
            if (batch_is_pivot(f, load8(partner, AT8(r)), others)) { /* the partner alone: it has to come first */
                for (int32_t i = k; i < f->stride; i++) store8(column, AT8(i), load8(partner, AT8(i)));
                batch_exchange(f, k, r, count + 1);
                batch_take_one(f, k, count);
                if (*limit < f->eliminated) *limit = f->eliminated;
                continue;
            }
        }
        batch_exchange(f, k, --*limit, count);
    }
}

#endif
