/* Solving with the factors of groups, and residuals of the matrix itself. */
#ifndef STC_BATCH_SOLVE_H
#define STC_BATCH_SOLVE_H

#include "batch_front.h"
#include "system.h"

/* Columns of L that are gone through at once: as many as there are registers for, with one right-hand side and with two. */
#define BATCH_CHUNK 4

/* Less so many columns of L times the unknowns of their pivots, or those less what the rows have. */
ALWAYS_INLINE void batch_chunk(int count, int back, int64_t distance, int32_t rows, const int32_t *position, const double *l,
                               double *restrict x, double *restrict pivot) {
    vec8 own[BATCH_CHUNK];
    int64_t step = AT8(rows);
#pragma GCC unroll 8
    for (int p = 0; p < count; p++) own[p] = load8(pivot, AT8(p));
    for (int32_t r = 0; r < rows; r++, l += 8) {
        int64_t to = AT8(position[r]);
        vec8 a = load8(x, to);
#pragma GCC unroll 8
        for (int p = 0; p < count; p++) {
            vec8 factor = load8(l, p * step);
            if (distance) prefetch8(l, p * step + distance);
            if (back) own[p] = sub_product8(own[p], factor, a);
            else a = sub_product8(a, factor, own[p]);
        }
        if (!back) store8(x, to, a);
    }
    if (back) {
#pragma GCC unroll 8
        for (int p = 0; p < count; p++) store8(pivot, AT8(p), own[p]);
    }
}

ALWAYS_INLINE void batch_chunks(int back, int64_t distance, int32_t count, int32_t rows, const int32_t *position, const double *l,
                                double *restrict x, double *restrict pivot) {
    for (; count >= 4; count -= 4, l += 4 * AT8(rows), pivot += 32) batch_chunk(4, back, distance, rows, position, l, x, pivot);
    if (count == 3) batch_chunk(3, back, distance, rows, position, l, x, pivot);
    else if (count == 2) batch_chunk(2, back, distance, rows, position, l, x, pivot);
    else if (count == 1) batch_chunk(1, back, distance, rows, position, l, x, pivot);
}

/* x = L^-1 x of a panel, or L^-T D^-1 x. */
ALWAYS_INLINE void batch_forward_panel(int64_t distance, const batch_work *w, const batch_panel *p, double *restrict x) {
    _Alignas(64) double pivot[8 * BATCH_PANEL];
    const int32_t *position = w->rows + p->row_at;
    const double *l = w->factors.at + AT8(p->factor_at + p->count + count_bits(p->pairs));
    for (int32_t q = 0; q < p->count; q++) {
        vec8 a = load8(x, AT8(position[q]));
        for (int32_t k = 0; k < q; k++, l += 8) a = sub_product8(a, load8(l, 0), load8(pivot, AT8(k)));
        store8(pivot, AT8(q), a);
        store8(x, AT8(position[q]), a);
    }
    batch_chunks(0, distance, p->count, p->rows, position + p->count, l, x, pivot);
}

ALWAYS_INLINE void batch_backward_panel(int64_t distance, const batch_work *w, const batch_panel *p, double *restrict x) {
    _Alignas(64) double pivot[8 * BATCH_PANEL];
    const int32_t *position = w->rows + p->row_at;
    const double *inverse = w->factors.at + AT8(p->factor_at);
    for (int32_t k = 0; k < p->count; k++, inverse += 8) {
        vec8 a = load8(x, AT8(position[k])), over = load8(inverse, 0);
        if (p->pairs >> k & 1) {
            vec8 b = load8(x, AT8(position[k + 1])), between = load8(inverse, 8);
            store8(pivot, AT8(k), add_product8(mul8(a, over), b, between));
            store8(pivot, AT8(k + 1), add_product8(mul8(a, between), b, load8(inverse, 16)));
            k++;
            inverse += 16;
        } else {
            store8(pivot, AT8(k), mul8(a, over));
        }
    }
    const double *l = inverse + AT8(p->count * (p->count - 1) / 2);
    batch_chunks(1, -distance, p->count, p->rows, position + p->count, l, x, pivot);
    for (int32_t q = p->count - 1; q >= 0; q--) {
        vec8 a = load8(pivot, AT8(q));
        store8(x, AT8(position[q]), a);
        l -= AT8(q);
        for (int32_t k = 0; k < q; k++) store8(pivot, AT8(k), sub_product8(load8(pivot, AT8(k)), load8(l, AT8(k)), a));
    }
}

/* Both right-hand sides, panel by panel, so that factors are near for the second one. */
static void batch_forward_group(int64_t distance, const batch_work *w, const batch_group *g, double *x, double *y) {
    for (int64_t at = g->first; at < g->first + g->panels; at++) {
        batch_forward_panel(distance, w, w->panels + at, x);
        if (y) batch_forward_panel(0, w, w->panels + at, y);
    }
}

static void batch_backward_group(int64_t distance, const batch_work *w, const batch_group *g, double *x, double *y) {
    for (int64_t at = g->first + g->panels - 1; at >= g->first; at--) {
        batch_backward_panel(distance, w, w->panels + at, x);
        if (y) batch_backward_panel(0, w, w->panels + at, y);
    }
}

/* left = b - K x of a group, less what its own unknowns have in the rows of the ends; for one right-hand side or two. */
ALWAYS_INLINE void batch_residual_group(int count, const batch_group *g, unknowns *const *solving) {
    const batch_shape *shape = g->shape;
    const double *value = g->matrix + AT8(shape->own), *x[2];
    double *left[2];
    int32_t own = shape->own;
#pragma GCC unroll 2
    for (int which = 0; which < count; which++) {
        x[which] = solving[which]->x + g->at;
        left[which] = solving[which]->left + g->at;
        for (int64_t k = 0; k < own; k++) store8(left[which], AT8(k), load8(solving[which]->b, g->at + AT8(k)));
        for (int64_t k = own; k < own + shape->ends; k++) store8(left[which], AT8(k), splat8(0.0));
    }
    for (int64_t k = 0; k < own; k++) {
        vec8 diagonal = load8(g->matrix, AT8(k)), own_x[2], sum[2];
#pragma GCC unroll 2
        for (int which = 0; which < count; which++) {
            own_x[which] = load8(x[which], AT8(k));
            sum[which] = sub_product8(load8(left[which], AT8(k)), diagonal, own_x[which]);
        }
        for (int32_t e = shape->start[k]; e < shape->start[k + 1]; e++, value += 8) {
            int64_t row = AT8(shape->row[e]);
            vec8 v = load8(value, 0);
#pragma GCC unroll 2
            for (int which = 0; which < count; which++) {
                sum[which] = sub_product8(sum[which], v, load8(x[which], row));
                store8(left[which], row, sub_product8(load8(left[which], row), v, own_x[which]));
            }
        }
#pragma GCC unroll 2
        for (int which = 0; which < count; which++) store8(left[which], AT8(k), sum[which]);
    }
}

/* 0, or not a number where one of `count` numbers is not finite. */
static double check_of(const double *x, int64_t count) {
    lanes sum = {0};
    int64_t i = 0;
    double found = 0.0;
    for (; i + LANES <= count; i += LANES) sum += *(const lanes *)(x + i) * all_of(0.0);
    for (; i < count; i++) found += x[i] * 0.0;
    for (int lane = 0; lane < LANES; lane++) found += sum[lane];
    return found;
}

/* The largest magnitude, not a number where one is not finite. */
static double norm_of(const double *x, int64_t count) {
    lanes sum = {0}, most = {0};
    int64_t i = 0;
    double found = 0.0;
    for (; i + LANES <= count; i += LANES) {
        lanes own = *(const lanes *)(x + i);
        sum += own * all_of(0.0);
        most = larger_of(magnitude_of(own), most);
    }
    for (int lane = 0; lane < LANES; lane++) raise_to(&found, most[lane] + sum[lane]);
    for (; i < count; i++) raise_to(&found, fabs(x[i]) + x[i] * 0.0);
    return found;
}

/* Add what a group has in the places of its ends to the rest. */
static void batch_add_ends(const batch_group *g, const double *x, double *sum) {
    const double *own = x + g->at + AT8(g->shape->own);
    const int32_t *end = g->end;
    for (int32_t k = 0; k < g->shape->ends; k++, own += 8, end += 8)
        for (int lane = 0; lane < g->segments; lane++) sum[end[lane]] += own[lane];
}

/* Bring what the rest has to the places of a group's ends. */
static void batch_take_ends(const batch_group *g, const double *rest, double *x) {
    double *own = x + g->at + AT8(g->shape->own);
    for (int32_t k = 0; k < g->shape->ends; k++) store8(own, AT8(k), gather8(rest, g->end, AT8(k)));
}

/* Which vector a step solves in: the first one in the solution itself. */
static double *target_of(const kkt_state *s, const unknowns *u) { return s->steps ? u->change : u->x; }

static void batch_forward(kkt_state *s, batch_work *w) {
    for (int which = 0; which < s->count; which++)
        for (int64_t k = 0; k < s->size; k++) w->sum[which][k] = 0.0;
    for (int32_t at = w->first; at < w->end; at++) {
        batch_group *g = s->groups + at;
        int32_t own = g->shape->own;
        for (int which = 0; which < s->count; which++) {
            unknowns *u = s->solving[which];
            double *x = target_of(s, u) + g->at;
            if (!s->steps) {
                for (int32_t k = 0; k < own; k++) {
                    vec8 v = s->probing ? load8(u->b, g->at + AT8(k))
                                        : mul8(gather8(u->rhs, g->unknown, AT8(k)), load8(s->scale, g->at + AT8(k)));
                    store8(u->b, g->at + AT8(k), v);
                    store8(x, AT8(k), v);
                }
                raise_to(&w->length[which], norm_of(x, AT8(own)));
            }
            for (int32_t k = own; k < own + g->shape->ends; k++) store8(x, AT8(k), splat8(0.0));
        }
        double *x = target_of(s, s->solving[0]) + g->at, *y = s->count > 1 ? target_of(s, s->solving[1]) + g->at : NULL;
        batch_forward_group(s->distance, w, g, x, y);
        for (int which = 0; which < s->count; which++) batch_add_ends(g, target_of(s, s->solving[which]), w->sum[which]);
    }
}

static void batch_backward(kkt_state *s, batch_work *w) {
    for (int which = 0; which < s->count; which++) {
        w->highest[which] = w->remaining[which] = 0.0;
        for (int64_t k = 0; k < s->size; k++) w->sum[which][k] = 0.0;
    }
    for (int32_t at = w->first; at < w->end; at++) {
        batch_group *g = s->groups + at;
        int64_t own = g->shape->own, all = own + g->shape->ends;
        for (int which = 0; which < s->count; which++) {
            double *x = target_of(s, s->solving[which]);
            batch_take_ends(g, x + s->outer, x);
        }
        double *x = target_of(s, s->solving[0]) + g->at, *y = s->count > 1 ? target_of(s, s->solving[1]) + g->at : NULL;
        batch_backward_group(s->distance, w, g, x, y);
        for (int which = 0; s->steps && which < s->count; which++) {
            double *to = s->solving[which]->x + g->at;
            const double *change = s->solving[which]->change + g->at;
            for (int64_t k = 0; k < all; k++) store8(to, AT8(k), add8(load8(to, AT8(k)), load8(change, AT8(k))));
        }
        if (s->count > 1) batch_residual_group(2, g, s->solving);
        else batch_residual_group(1, g, s->solving);
        for (int which = 0; which < s->count; which++) {
            const unknowns *u = s->solving[which];
            raise_to(&w->highest[which], norm_of(u->x + g->at, AT8(own)));
            raise_to(&w->remaining[which], norm_of(u->left + g->at, AT8(own)));
            batch_add_ends(g, u->left, w->sum[which]);
        }
    }
}

static void batch_return(kkt_state *s, batch_work *w) {
    double *result[2] = {s->k->solution, s->k->second_solution};
    for (int32_t at = w->first; at < w->end; at++) {
        const batch_group *g = s->groups + at;
        for (int which = 0; which < s->count; which++)
            for (int32_t k = 0; k < g->shape->own; k++)
                scatter8(result[which], g->unknown, AT8(k),
                         mul8(load8(s->unknowns[which].x, g->at + AT8(k)), load8(s->scale, g->at + AT8(k))));
    }
}

#endif
