/* The fronts of a group, one after the other: assembled from the matrix and from what their children have left, and
 * eliminated. */
#ifndef STC_BATCH_TREE_H
#define STC_BATCH_TREE_H

#include <string.h>

#include "batch_front.h"
#include "batch_state.h"

/* At the roots, where nothing is left to wait for, smaller pivots are taken. */
#define BATCH_LOWEST_THRESHOLD 1e-8

static int batch_grow(void **array, int64_t *room, int64_t needed, size_t size) {
    if (needed <= *room) return 0;
    int64_t more = 2 * needed + 64;
    void *larger = realloc(*array, size * (size_t)more);
    if (!larger) return -1;
    *array = larger;
    *room = more;
    return 0;
}

/* Keep the factors of a panel of pivots, which are the unknowns from `begin` on; `streamed`: past the caches. */
static int batch_keep(batch_work *w, const batch_front *f, int32_t begin, int32_t count, int streamed) {
    int64_t stride = AT8(f->stride), vectors = 3 * count;
    int32_t rows = 0;
    for (int32_t i = begin; i < f->stride; i++) {
        uint32_t mask = f->l_of[i];
        if (i < begin + count || mask) rows++;
        vectors += count_bits(mask);
    }
    if (batch_grow((void **)&w->panels, &w->panel_room, w->panel_count + 1, sizeof(batch_panel))
        || batch_grow((void **)&w->rows, &w->row_room, w->row_count + rows, sizeof(batch_row))
        || arena_reserve(&w->factors, AT8(w->factor_count + vectors), AT8(w->factor_count)))
        return -1;
    w->panels[w->panel_count++] = (batch_panel){w->factor_count, w->row_count, count, rows, f->pairs};
    double *to = w->factors.at + AT8(w->factor_count), *begun = to;
    for (int32_t p = 0; p < count; p++) {
        int pair = f->pairs >> p & 1;
        for (int k = 0; k < (pair ? 3 : 1); k++, to += 8) store8(to, 0, load8(f->inverse, AT8(3 * p + k)));
        p += pair;
    }
    batch_row *row = w->rows + w->row_count;
    for (int32_t i = begin; i < f->stride; i++) {
        uint32_t mask = f->l_of[i];
        if (i >= begin + count && !mask) continue;
        *row++ = (batch_row){f->index[i], mask};
        for (uint32_t bits = mask; bits; bits &= bits - 1, to += 8) {
            vec8 value = load8(f->l, stride * __builtin_ctz(bits) + AT8(i));
            if (streamed) stream8(to, 0, value);
            else store8(to, 0, value);
        }
    }
    w->row_count += rows;
    w->factor_count += (to - begun) / 8;
    w->operations += 8 * ((to - begun) / 8);
    return 0;
}

/* Eliminate what can be eliminated of the summed unknowns. */
static int batch_eliminate(batch_work *w, batch_front *f, int root, int streamed) {
    int32_t limit = f->summed, before = 0;
    while (f->eliminated < f->summed) {
        int32_t begin = f->eliminated, count = batch_take_panel(f, &limit);
        if (count) {
            if (batch_keep(w, f, begin, count, streamed)) return -1;
            batch_subtract(f, f->eliminated);
        }
        if (f->eliminated < limit) continue;
        if (f->eliminated == before) {
            if (!root || f->threshold == BATCH_LOWEST_THRESHOLD) return 0;
            f->threshold = BATCH_LOWEST_THRESHOLD;
        }
        limit = f->summed; /* those that were refused, once more */
        before = f->eliminated;
    }
    return 0;
}

/* Where the place of a row in its parent, as planned, is there. */
static inline int32_t batch_place(int32_t local, int32_t planned, int32_t delayed, int32_t inner) {
    return local < planned ? delayed + local : inner + local - planned;
}

/* The columns of a front from those of its first child: what that has left is copied, all else is zero. */
static void batch_begin(const batch_front *f, const double *child, int32_t stride, const int32_t *from) {
    for (int32_t j = 0; j < f->inner; j++) {
        double *to = f->at + j * AT8(f->stride);
        const double *column = from[j] < 0 ? NULL : child + from[j] * AT8(stride);
        for (int32_t i = j; i < f->stride; i++)
            store8(to, AT8(i), column && from[i] >= 0 ? load8(column, AT8(from[i])) : splat8(0.0));
    }
}

/* Add what another child has left. */
static void batch_add(const batch_front *f, const double *child, const batch_left *c, const int32_t *place) {
    for (int32_t j = c->from; j < c->inner; j++) {
        if (place[j] < 0) continue;
        double *to = f->at + place[j] * AT8(f->stride);
        const double *column = child + j * AT8(c->stride);
        for (int32_t i = j; i < c->stride; i++)
            if (place[i] >= 0) store8(to, AT8(place[i]), add8(load8(to, AT8(place[i])), load8(column, AT8(i))));
    }
}

static int batch_reserve(batch_work *w, batch_front *f, int64_t used, int parity, int64_t index_used) {
    int32_t stride = f->stride;
    if (arena_reserve(&w->fronts[parity], used + AT8(stride) * f->inner, used)) return -1;
    if (arena_reserve(&w->panel, AT8(stride) * (2 * BATCH_PANEL + 2) + AT8(3 * BATCH_PANEL), 0)) return -1;
    if (batch_grow((void **)&w->index, &w->index_room, index_used + stride, sizeof(int32_t))) return -1;
    if (stride > w->place_room) {
        int32_t room = 2 * stride;
        free(w->place); free(w->from); free(w->bits);
        w->place = malloc(sizeof(int32_t) * (size_t)room);
        w->from = malloc(sizeof(int32_t) * (size_t)room);
        w->bits = malloc(2 * sizeof(uint32_t) * (size_t)room);
        w->place_room = room;
        if (!w->place || !w->from || !w->bits) { w->place_room = 0; return -1; }
    }
    f->at = w->fronts[parity].at + used;
    f->index = w->index + index_used;
    f->l = w->panel.at;
    f->w = f->l + AT8(stride) * BATCH_PANEL;
    f->column = f->w + AT8(stride) * BATCH_PANEL;
    f->partner = f->column + AT8(stride);
    f->inverse = f->partner + AT8(stride);
    f->l_of = w->bits;
    f->w_of = w->bits + w->place_room;
    return 0;
}

/* Where a child's rows are in the front, from -1 on padding; `put` counts those that it has delayed. */
static void batch_find_places(const batch_work *w, const batch_shape *s, const batch_front *f, const batch_left *c, int32_t delayed,
                              int32_t planned, int32_t *put) {
    const int32_t *index = w->index + c->index_at, *local = s->plan->local + s->plan->row_start[c->front];
    for (int32_t i = c->from; i < c->stride; i++) {
        w->place[i] = -1;
        if (index[i] < 0) continue;
        if (i < c->summed) {
            f->index[*put] = index[i];
            w->place[i] = (*put)++;
        } else {
            w->place[i] = batch_place(*local++, planned, delayed, f->inner);
        }
    }
}

void batch_eliminate_group(const batch *b, batch_work *w, batch_group *g) {
    const batch_shape *s = g->shape;
    const plan *p = s->plan;
    int32_t waiting = 0, corner_stride = s->ends + 1, fronts = p->fronts - (s->ends > 0);
    int64_t used[2] = {0, 0}, index_used = 0;
    if (arena_reserve(&w->corner, AT8(corner_stride) * corner_stride, 0)) { w->no_memory = 1; return; }
    memset(w->corner.at, 0, sizeof(double) * (size_t)(AT8(corner_stride) * corner_stride));
    g->first = w->panel_count;
    batch_front f = {.corner = w->corner.at, .corner_stride = corner_stride, .own = s->own, .largest = splat8(0.0),
                     .negative = splat8(0.0), .smallest = INFINITY};
    for (int32_t at = 0; at < fronts; at++) {
        int32_t first = p->first[at], own = p->first[at + 1] - first, delayed = 0, parity = s->depth[at] & 1;
        int32_t inner = s->inner[at], ends = (int32_t)(p->row_start[at + 1] - p->row_start[at]) - inner, planned = own + inner;
        const int32_t *rows = p->rows + p->row_start[at];
        for (int32_t c = 0; c < p->children[at]; c++) {
            const batch_left *left = &w->waiting[waiting - 1 - c];
            delayed += left->summed - left->from;
        }
        f.summed = delayed + own;
        f.inner = (f.summed + inner + 1) & ~1;
        f.stride = f.inner + ((ends + 1) & ~1);
        f.eliminated = 0;
        f.threshold = 1e-4;
        if (batch_reserve(w, &f, used[parity], parity, index_used)) { w->no_memory = 1; return; }
        for (int32_t k = 0; k < f.stride; k++) f.index[k] = -1;
        for (int32_t k = 0; k < own; k++) f.index[delayed + k] = first + k;
        for (int32_t k = 0; k < inner; k++) f.index[f.summed + k] = rows[k];
        for (int32_t k = 0; k < ends; k++) f.index[f.inner + k] = rows[inner + k];
        for (int32_t k = 0; k < f.stride; k++) w->from[k] = -1;
        int32_t put = 0;
        if (!p->children[at]) batch_begin(&f, NULL, 0, w->from);
        for (int32_t c = 0; c < p->children[at]; c++) {
            const batch_left *left = &w->waiting[--waiting];
            const double *child = w->fronts[!parity].at + left->at;
            batch_find_places(w, s, &f, left, delayed, planned, &put);
            if (c == 0) {
                for (int32_t i = left->from; i < left->stride; i++)
                    if (w->place[i] >= 0) w->from[w->place[i]] = i;
                batch_begin(&f, child, left->stride, w->from);
            } else {
                batch_add(&f, child, left, w->place);
            }
            used[!parity] = left->at;
        }
        for (int32_t k = 0; k < own; k++) {
            double *column = f.at + (delayed + k) * AT8(f.stride), *diagonal = column + AT8(delayed + k);
            store8(diagonal, 0, add8(load8(diagonal, 0), load8(g->matrix, AT8(first + k))));
            for (int64_t e = p->entry_start[first + k]; e < p->entry_start[first + k + 1]; e++) {
                double *to = column + AT8(batch_place(p->entry_local[e], planned, delayed, f.inner));
                store8(to, 0, add8(load8(to, 0), load8(g->matrix, AT8(s->own + e))));
            }
        }
        int root = p->parent[at] < 0 || p->parent[at] == fronts;
        if (batch_eliminate(w, &f, root, BATCH_STATE(b)->distance > 0)) { w->no_memory = 1; return; }
        w->delayed += f.summed - f.eliminated;
        double wide = f.stride, usual = planned + ends;
        w->work += own * usual * usual;
        w->wasted += f.eliminated * wide * wide - own * usual * usual;
        for (int32_t k = f.eliminated; k < f.summed; k++)
            __atomic_store_n(s->weak + p->order[f.index[k]], (uint8_t)1, __ATOMIC_RELAXED);
        if (root) {
            if (f.eliminated < f.summed) { w->refused = 1; return; }
            continue;
        }
        w->waiting[waiting++] =
            (batch_left){used[parity], f.stride, f.inner, f.eliminated, f.summed, at, (int32_t)index_used};
        used[parity] += AT8(f.stride) * f.inner;
        index_used += f.stride;
    }
    g->panels = w->panel_count - g->first;
    double largest = largest8(f.largest);
    w->largest = largest > w->largest || largest != largest ? largest : w->largest;
    w->smallest = f.smallest < w->smallest || f.smallest != f.smallest ? f.smallest : w->smallest;
    for (int lane = 0; lane < g->segments; lane++) w->negative += (int64_t)f.negative.part[lane / LANES][lane % LANES];
    const int32_t *result = g->result;
    for (int32_t i = 0; i < s->ends; i++)
        for (int32_t j = 0; j <= i; j++, result += 8) {
            const double *value = f.corner + AT8(j * (int64_t)corner_stride + i);
            for (int lane = 0; lane < g->segments; lane++) {
                int32_t to = result[lane];
                if (to >= 0) w->result[to] += value[lane];
                else w->result[-1 - to] -= value[lane];
            }
        }
}

#endif
