/* A front, and the elimination of its pivots: dense, by panels, with threshold pivoting among its summed columns. */
#ifndef STC_FRONT_H
#define STC_FRONT_H

#include "system.h"
#include "vectors.h"

/* Pivots that are taken before what they leave is subtracted from all columns together. */
#define PANEL 16
/* A pivot of two needs a determinant of at least this share of its larger product. */
#define CANCELLATION 1e-3
/* Columns of the scaled matrix no larger than this are zero, and what takes the place of such a pivot. */
#define NOTHING 3e-14
#define REPLACEMENT 1e-8

typedef struct {
    double *at;       /* the lower triangle by columns; the rest is not read */
    double *factor;   /* the columns of L of those that are eliminated */
    int32_t stride, size;
    int32_t end;      /* whole vectors that the rows are in */
    int32_t summed;   /* columns that may be eliminated, the first ones */
    int32_t eliminated;
    int32_t pending;  /* how many of them are still to be subtracted from what is left */
    int32_t *index;   /* which unknown each row is */
    double *inverse;  /* D^-1 of its pivots */
    uint8_t *kind;
    double *panel;    /* L D of a panel, by rows of so many numbers as the stride; then two columns */
    double threshold;
    int32_t variables;
    int64_t positive, negative, zero, pairs;
} front;

/* c - L D L^T of `count` pivots of the panel, in V vectors of rows and some columns: to columns that are `apart`. */
#define ACCUMULATE(V)                                                                                              \
    static inline void tile_##V(const double *restrict l, const double *restrict w, int32_t count, int32_t stride,  \
                                const double *c, double *to, int32_t apart) {                                      \
        lanes sum[V][TILE_COLUMNS];                                                                                \
        _Pragma("GCC unroll 8") for (int j = 0; j < TILE_COLUMNS; j++)                                             \
            _Pragma("GCC unroll 8") for (int v = 0; v < V; v++)                                                    \
                sum[v][j] = *(const lanes *)(c + (int64_t)j * stride + v * LANES);                                  \
        for (int32_t p = 0; p < count; p++) {                                                                      \
            lanes rows[V];                                                                                         \
            _Pragma("GCC unroll 8") for (int v = 0; v < V; v++) rows[v] = *(const lanes *)(l + v * LANES);          \
            _Pragma("GCC unroll 8") for (int j = 0; j < TILE_COLUMNS; j++) {                                       \
                lanes factor = all_of(w[j]);                                                                       \
                _Pragma("GCC unroll 8") for (int v = 0; v < V; v++) sum[v][j] -= rows[v] * factor;                  \
            }                                                                                                      \
            l += stride;                                                                                           \
            w += stride;                                                                                           \
        }                                                                                                          \
        _Pragma("GCC unroll 8") for (int j = 0; j < TILE_COLUMNS; j++)                                             \
            _Pragma("GCC unroll 8") for (int v = 0; v < V; v++)                                                    \
                *(lanes *)(to + (int64_t)j * apart + v * LANES) = sum[v][j];                                        \
    }
ACCUMULATE(1)
ACCUMULATE(2)
ACCUMULATE(3)
#if TILE_VECTORS > 3
ACCUMULATE(4)
#endif

/* The same for so many rows, or whole vectors of them. */
static inline void subtract_rows(const double *l, const double *w, int32_t count, int32_t stride, const double *c, double *to,
                                 int32_t apart, int32_t rows) {
    int32_t i = 0;
    for (; i + TILE_VECTORS * LANES <= rows; i += TILE_VECTORS * LANES) {
#if TILE_VECTORS == 4
        tile_4(l + i, w, count, stride, c + i, to + i, apart);
#elif TILE_VECTORS == 3
        tile_3(l + i, w, count, stride, c + i, to + i, apart);
#else
        tile_2(l + i, w, count, stride, c + i, to + i, apart);
#endif
    }
    for (; i + 2 * LANES <= rows; i += 2 * LANES) tile_2(l + i, w, count, stride, c + i, to + i, apart);
    for (; i < rows; i += LANES) tile_1(l + i, w, count, stride, c + i, to + i, apart);
}

/* Subtract the panel of the last `count` pivots from all columns that are left. */
static void subtract_panel(front *f, int32_t count) {
    int32_t stride = f->stride, from = f->eliminated, first = from - from % TILE_COLUMNS;
    const double *l = f->factor + (int64_t)(from - count) * stride;
    /* Columns before `from` in the first tile are factors already. */
    for (int32_t p = 0; p < count; p++)
        for (int32_t j = first; j < from; j++) f->panel[j + (int64_t)p * stride] = 0.0;
    for (int32_t j = first; j < f->size; j += TILE_COLUMNS) {
        int32_t i = j - j % LANES;
        double *c = f->at + (int64_t)j * stride + i;
        subtract_rows(l + i, f->panel + j, count, stride, c, c, stride, f->end - i);
    }
}

/* What the front leaves, after the last pivots, to columns that are `apart`: whole vectors and tiles are written. */
static void leave(const front *f, double *to, int32_t apart) {
    int32_t stride = f->stride, taken = f->eliminated, count = f->pending, size = f->size - taken;
    const double *l = f->factor + (int64_t)(taken - count) * stride + taken;
    for (int32_t j = 0; j < size; j += TILE_COLUMNS) {
        int32_t i = j - j % LANES;
        const double *c = f->at + (int64_t)(taken + j) * stride + taken + i;
        subtract_rows(l + i, f->panel + taken + j, count, stride, c, to + (int64_t)j * apart + i, apart, size - i);
    }
}

/* Column c as it is after the pivots of the panel, from row `from` to the end of the front: into `column`.  The largest
 * magnitude below row `from`. */
static double bring_column(const front *f, int32_t begin, int32_t from, int32_t c, double *restrict column) {
    int32_t stride = f->stride, end = f->end, count = from - begin, i = from - from % LANES;
    const double *l = f->factor + (int64_t)begin * stride, *w = f->panel + c, *given = f->at + (int64_t)c * stride;
    if (c > from) { /* rows above the diagonal are in the columns of theirs */
        for (int32_t j = from; j < c; j++) column[j] = f->at[c + (int64_t)j * stride];
        for (int32_t j = c; j < end; j++) column[j] = given[j];
        given = column;
    }
    lanes most = {0}, second = {0}, a = *(const lanes *)(given + i);
    for (int32_t p = 0; p < count; p++)
        a -= *(const lanes *)(l + (int64_t)p * stride + i) * all_of(w[(int64_t)p * stride]);
    *(lanes *)(column + i) = a;
    double highest = 0.0;
    for (int k = from - i + 1; k < LANES; k++) highest = fabs(a[k]) > highest ? fabs(a[k]) : highest;
    for (i += LANES; i + 4 * LANES <= end; i += 4 * LANES) {
        a = *(const lanes *)(given + i);
        lanes b = *(const lanes *)(given + i + LANES);
        lanes d = *(const lanes *)(given + i + 2 * LANES), e = *(const lanes *)(given + i + 3 * LANES);
        for (int32_t p = 0; p < count; p++) {
            const double *rows = l + (int64_t)p * stride + i;
            lanes factor = all_of(w[(int64_t)p * stride]);
            a -= *(const lanes *)rows * factor;
            b -= *(const lanes *)(rows + LANES) * factor;
            d -= *(const lanes *)(rows + 2 * LANES) * factor;
            e -= *(const lanes *)(rows + 3 * LANES) * factor;
        }
        *(lanes *)(column + i) = a;
        *(lanes *)(column + i + LANES) = b;
        *(lanes *)(column + i + 2 * LANES) = d;
        *(lanes *)(column + i + 3 * LANES) = e;
        most = larger_of(larger_of(magnitude_of(a), magnitude_of(b)), most);
        second = larger_of(larger_of(magnitude_of(d), magnitude_of(e)), second);
    }
    for (; i < end; i += LANES) {
        a = *(const lanes *)(given + i);
        for (int32_t p = 0; p < count; p++)
            a -= *(const lanes *)(l + (int64_t)p * stride + i) * all_of(w[(int64_t)p * stride]);
        *(lanes *)(column + i) = a;
        most = larger_of(magnitude_of(a), most);
    }
    most = larger_of(most, second);
    for (int k = 0; k < LANES; k++) highest = most[k] > highest ? most[k] : highest;
    return highest;
}

/* Exchange unknowns a < b of the front, none eliminated yet; pivots of the panel begin at `begin`, `count` of them. */
static void exchange(front *f, int32_t a, int32_t b, int32_t count) {
    if (a == b) return;
    int64_t stride = f->stride;
    double *at = f->at;
    for (int32_t j = 0; j < a; j++) {
        double *column = (j < f->eliminated ? f->factor : at) + j * stride, kept = column[a];
        column[a] = column[b];
        column[b] = kept;
    }
    double kept = at[a + a * stride];
    at[a + a * stride] = at[b + b * stride];
    at[b + b * stride] = kept;
    for (int32_t j = a + 1; j < b; j++) {
        kept = at[j + a * stride];
        at[j + a * stride] = at[b + j * stride];
        at[b + j * stride] = kept;
    }
    for (int32_t i = b + 1; i < f->size; i++) {
        kept = at[i + a * stride];
        at[i + a * stride] = at[i + b * stride];
        at[i + b * stride] = kept;
    }
    for (int32_t p = 0; p < count; p++) {
        kept = f->panel[a + p * stride];
        f->panel[a + p * stride] = f->panel[b + p * stride];
        f->panel[b + p * stride] = kept;
    }
    int32_t other = f->index[a];
    f->index[a] = f->index[b];
    f->index[b] = other;
}

/* Take unknown k of the front as a pivot of one; `column` is its column. */
static void take_one(front *f, int32_t k, int32_t p, const double *column, double pivot) {
    double inverse = 1.0 / pivot, *l = f->factor + (int64_t)k * f->stride, *w = f->panel + (int64_t)p * f->stride;
    int32_t i = k - k % LANES;
    for (; i < f->end; i += LANES) {
        lanes c = *(const lanes *)(column + i);
        *(lanes *)(w + i) = c;
        *(lanes *)(l + i) = c * inverse;
    }
    l[k] = 1.0;
    f->inverse[3 * k] = inverse;
    f->inverse[3 * k + 1] = f->inverse[3 * k + 2] = 0.0;
    f->kind[k] = ONE;
    f->eliminated = k + 1;
}

/* Take unknowns k and k + 1 together; D = [a b; b c]. */
static void take_two(front *f, int32_t k, int32_t p, const double *first, const double *second) {
    double a = first[k], b = first[k + 1], c = second[k + 1], determinant = a * c - b * b;
    double over_a = c / determinant, over_b = -b / determinant, over_c = a / determinant;
    int64_t stride = f->stride;
    double *l = f->factor + k * stride, *w = f->panel + p * stride, *m = l + stride, *v = w + stride;
    for (int32_t i = k - k % LANES; i < f->end; i += LANES) {
        lanes x = *(const lanes *)(first + i), y = *(const lanes *)(second + i);
        *(lanes *)(w + i) = x;
        *(lanes *)(v + i) = y;
        *(lanes *)(l + i) = x * over_a + y * over_b;
        *(lanes *)(m + i) = x * over_b + y * over_c;
    }
    l[k] = 1.0;
    l[k + 1] = 0.0;
    m[k + 1] = 1.0;
    double *inverse = f->inverse + 3 * k;
    inverse[0] = over_a;
    inverse[1] = over_b;
    inverse[2] = over_c;
    inverse[3] = inverse[4] = inverse[5] = 0.0;
    f->kind[k] = FIRST;
    f->kind[k + 1] = SECOND;
    f->eliminated = k + 2;
    f->pairs++;
    if (determinant < 0.0) {
        f->positive++;
        f->negative++;
    } else if (a + c > 0.0) {
        f->positive += 2;
    } else {
        f->negative += 2;
    }
}

/* Eliminate what can be eliminated of the summed columns; whatever is left is delayed. */
static void eliminate(front *f) {
    int32_t stride = f->stride, begin = 0, limit = f->summed;
    double *column = f->panel + (int64_t)PANEL * stride, *partner = column + stride;
    int32_t refused = -1; /* how many were eliminated when the first one was refused */
    memset(column, 0, sizeof(double) * 2 * (size_t)stride);
    for (;;) {
        int32_t k = f->eliminated, count = k - begin;
        if (count >= PANEL - 1 || k == limit) {
            f->pending = count;
            if (k == f->summed || (k == limit && k == refused)) return;
            if (count) subtract_panel(f, count);
            begin = k;
            count = 0;
            if (k == limit) { /* those that were refused, once more */
                limit = f->summed;
                refused = -1;
            }
        }
        double beside = bring_column(f, begin, k, k, column), d = column[k];
        if (fabs(d) <= NOTHING && beside <= NOTHING) {
            int variable = f->index[k] < f->variables;
            memset(column + k, 0, sizeof(double) * (size_t)(stride - k));
            take_one(f, k, count, column, variable ? REPLACEMENT : -REPLACEMENT);
            f->zero++;
            continue;
        }
        if (fabs(d) >= f->threshold * beside) {
            take_one(f, k, count, column, d);
            if (d > 0.0) f->positive++; else f->negative++;
            continue;
        }
        /* With the strongest of the other summed ones. */
        int32_t r = -1;
        double strongest = largest_of(column + k + 1, f->summed - k - 1);
        if (strongest > 0.0)
            for (r = k + 1; fabs(column[r]) != strongest;) r++;
        int taken = 0;
        if (r >= 0) {
            bring_column(f, begin, k, r, partner);
            double b = column[r], c = partner[r], products = fabs(d * c) > b * b ? fabs(d * c) : b * b;
            double determinant = d * c - b * b, most = 0.0, other = 0.0;
            column[r] = 0.0;
            most = largest_of(column + k + 1, f->size - k - 1);
            column[r] = b;
            partner[k] = partner[r] = 0.0;
            other = largest_of(partner + k + 1, f->size - k - 1);
            partner[k] = b;
            partner[r] = c;
            double limit_of = fabs(determinant);
            if (fabs(determinant) >= CANCELLATION * products
                && f->threshold * (fabs(c) * most + fabs(b) * other) <= limit_of
                && f->threshold * (fabs(b) * most + fabs(d) * other) <= limit_of) {
                exchange(f, k + 1, r, count);
                double kept = column[k + 1];
                column[k + 1] = column[r];
                column[r] = kept;
                kept = partner[k + 1];
                partner[k + 1] = partner[r];
                partner[r] = kept;
                take_two(f, k, count, column, partner);
                if (limit < f->eliminated) limit = f->eliminated; /* the partner was one that had been refused */
                taken = 1;
            } else {
                double all = fabs(b) > other ? fabs(b) : other;
                if (c != 0.0 && fabs(c) >= f->threshold * all) {
                    /* The partner alone: it has to come first. */
                    exchange(f, k, r, count);
                    partner[r] = b;
                    partner[k] = c;
                    take_one(f, k, count, partner, c);
                    if (c > 0.0) f->positive++; else f->negative++;
                    taken = 1;
                }
            }
        }
        if (!taken) {
            if (refused < 0) refused = k;
            exchange(f, k, --limit, count);
        }
    }
}

#endif
