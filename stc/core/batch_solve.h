/* Solving with the factors of groups, and residuals of the matrix itself. */
#ifndef STC_BATCH_SOLVE_H
#define STC_BATCH_SOLVE_H

#include "batch_front.h"
#include "batch_state.h"

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

/* left = b - K x of a group, less what its own unknowns have in the rows of the ends. */
ALWAYS_INLINE void batch_residual_group(int both, const batch_group *g, const double *const *b, const double *const *x,
                                        double *const *left) {
    const plan *p = g->shape->plan;
    const double *value = g->matrix + AT8(g->shape->own);
    const double *one = x[0] + g->at, *two = both ? x[1] + g->at : one;
    double *r = left[0] + g->at, *q = both ? left[1] + g->at : r;
    int32_t own = g->shape->own;
    for (int64_t k = 0; k < own; k++) {
        store8(r, AT8(k), load8(b[0], g->at + AT8(k)));
        if (both) store8(q, AT8(k), load8(b[1], g->at + AT8(k)));
    }
    for (int64_t k = own; k < own + g->shape->ends; k++) {
        store8(r, AT8(k), splat8(0.0));
        if (both) store8(q, AT8(k), splat8(0.0));
    }
    for (int64_t k = 0; k < own; k++) {
        vec8 own_x = load8(one, AT8(k)), diagonal = load8(g->matrix, AT8(k)), sum = sub_product8(load8(r, AT8(k)), diagonal, own_x);
        vec8 own_y = own_x, other = sum;
        if (both) {
            own_y = load8(two, AT8(k));
            other = sub_product8(load8(q, AT8(k)), diagonal, own_y);
        }
        for (int64_t e = p->entry_start[k]; e < p->entry_start[k + 1]; e++, value += 8) {
            int64_t row = AT8(p->entry_row[e]);
            vec8 v = load8(value, 0);
            sum = sub_product8(sum, v, load8(one, row));
            store8(r, row, sub_product8(load8(r, row), v, own_x));
            if (both) {
                other = sub_product8(other, v, load8(two, row));
                store8(q, row, sub_product8(load8(q, row), v, own_y));
            }
        }
        store8(r, AT8(k), sum);
        if (both) store8(q, AT8(k), other);
    }
}

/* The largest magnitude of so many vectors, no number where one is not finite. */
static double batch_largest(const double *x, int64_t vectors) {
    vec8 most = splat8(0.0), check = splat8(0.0);
    for (int64_t k = 0; k < vectors; k++) {
        vec8 a = load8(x, AT8(k));
        most = max8(abs8(a), most);
        check = add8(check, scaled8(0.0, a));
    }
    return largest8(most) + sum8(check);
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

static void batch_raise(double *to, double value) { *to = value > *to || value != value ? value : *to; }

/* Which vector a step solves in: the first one in the solution itself. */
static double *batch_target(const batch_state *s, int which) {
    return s->steps ? s->unknowns[which].change : s->unknowns[which].x;
}

void batch_forward(const batch *b, batch_work *w) {
    batch_state *s = BATCH_STATE(b);
    const double *rhs[2] = {s->probing ? b->probe : b->rhs, b->second_rhs};
    for (int which = 0; which <= s->both; which++)
        for (int64_t k = 0; k < b->rest; k++) w->sum[which][k] = 0.0;
    for (int32_t at = w->first; at < w->end; at++) {
        batch_group *g = s->groups + at;
        int32_t own = g->shape->own;
        for (int which = 0; which <= s->both; which++) {
            unknowns *u = s->unknowns + which;
            double *x = batch_target(s, which) + g->at;
            if (!s->steps) {
                vec8 most = splat8(0.0), check = splat8(0.0);
                for (int32_t k = 0; k < own; k++) {
                    vec8 v = mul8(gather8(rhs[which], g->unknown, AT8(k)), load8(s->scale, g->at + AT8(k)));
                    store8(u->b, g->at + AT8(k), v);
                    store8(x, AT8(k), v);
                    most = max8(abs8(v), most);
                    check = add8(check, scaled8(0.0, v));
                }
                batch_raise(&w->length[which], largest8(most) + sum8(check));
            }
            for (int32_t k = own; k < own + g->shape->ends; k++) store8(x, AT8(k), splat8(0.0));
        }
        batch_forward_group(s->distance, w, g, batch_target(s, 0) + g->at, s->both ? batch_target(s, 1) + g->at : NULL);
        for (int which = 0; which <= s->both; which++) batch_add_ends(g, batch_target(s, which), w->sum[which]);
    }
}

void batch_backward(const batch *b, batch_work *w) {
    batch_state *s = BATCH_STATE(b);
    const double *rest[2] = {b->rest_solution, b->rest_second_solution}, *right[2], *x[2];
    double *left[2];
    for (int which = 0; which <= s->both; which++) {
        right[which] = s->unknowns[which].b;
        x[which] = s->unknowns[which].x;
        left[which] = s->unknowns[which].left;
        w->highest[which] = w->remaining[which] = 0.0;
        for (int64_t k = 0; k < b->rest; k++) w->sum[which][k] = 0.0;
    }
    for (int32_t at = w->first; at < w->end; at++) {
        batch_group *g = s->groups + at;
        int64_t all = g->shape->own + g->shape->ends;
        for (int which = 0; which <= s->both; which++) batch_take_ends(g, rest[which], batch_target(s, which));
        batch_backward_group(s->distance, w, g, batch_target(s, 0) + g->at, s->both ? batch_target(s, 1) + g->at : NULL);
        if (s->steps > 0)
            for (int which = 0; which <= s->both; which++) {
                if (!s->unknowns[which].active) continue;
                double *to = s->unknowns[which].x + g->at;
                const double *change = s->unknowns[which].change + g->at;
                for (int64_t k = 0; k < all; k++) store8(to, AT8(k), add8(load8(to, AT8(k)), load8(change, AT8(k))));
            }
        if (s->both) batch_residual_group(1, g, right, x, left);
        else batch_residual_group(0, g, right, x, left);
        for (int which = 0; which <= s->both; which++) {
            batch_raise(&w->highest[which], batch_largest(x[which] + g->at, g->shape->own));
            batch_raise(&w->remaining[which], batch_largest(left[which] + g->at, g->shape->own));
            batch_add_ends(g, left[which], w->sum[which]);
        }
    }
}

void batch_return(const batch *b, batch_work *w) {
    batch_state *s = BATCH_STATE(b);
    double *result[2] = {s->probing ? b->probed : b->solution, b->second_solution};
    for (int32_t at = w->first; at < w->end; at++) {
        const batch_group *g = s->groups + at;
        for (int which = 0; which <= s->both; which++)
            for (int32_t k = 0; k < g->shape->own; k++)
                scatter8(result[which], g->unknown, AT8(k),
                         mul8(load8(s->unknowns[which].x, g->at + AT8(k)), load8(s->scale, g->at + AT8(k))));
    }
}

#endif
