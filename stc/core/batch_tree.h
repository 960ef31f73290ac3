/* The fronts of a group, one after the other: assembled from the matrix and from what their children have left, and
 * eliminated. */
#ifndef STC_BATCH_TREE_H
#define STC_BATCH_TREE_H

#include <string.h>

#include "batch_front.h"
#include "system.h"

/* No factor is larger than 1 over this.  In all lanes at once, 1e-4 as in kkt.c would delay twice as many pivots, and take up
 * to a third more operations (the lamp's jumps); with 1e-6, more than half of their matrices have none for all unknowns. */
#define BATCH_THRESHOLD 1e-8

static int batch_grow(void **array, int64_t *room, int64_t needed, size_t size) {
    if (needed <= *room) return 0;
    int64_t more = 2 * needed + 64;
    void *larger = realloc(*array, size * (size_t)more);
    if (!larger) return -1;
    *array = larger;
    *room = more;
    return 0;
}

/* Keep the factors of a panel of pivots, which are the unknowns from `begin` on, and subtract what they leave; `streamed`:
 * past the caches. */
static int batch_keep(batch_work *w, batch_front *f, int32_t begin, int32_t count, int streamed) {
    int32_t end = begin + count, packed = 0;
    int64_t stride = AT8(f->stride), own = count + count_bits(f->pairs) + count * (count - 1) / 2;
    f->count = 0;
    for (int32_t i = end; i < f->stride; i++) {
        if (i == f->inner) f->count = packed;
        vec8 found = abs8(load8(f->w, AT8(i)));
        for (int32_t p = 1; p < count; p++) found = either8(found, load8(f->w, p * stride + AT8(i)));
        f->row[packed] = i;
        packed += any8(found);
    }
    if (f->stride == f->inner) f->count = packed;
    f->packed = packed;
    if (batch_grow((void **)&w->panels, &w->panel_room, w->panel_count + 1, sizeof(batch_panel))
        || batch_grow((void **)&w->rows, &w->row_room, w->row_count + count + packed, sizeof(int32_t))
        || arena_reserve(&w->factors, AT8(w->factor_count + own + count * packed), AT8(w->factor_count)))
        return -1;
    w->panels[w->panel_count++] = (batch_panel){w->factor_count, w->row_count, count, packed, f->pairs};
    int32_t *row = w->rows + w->row_count;
    for (int32_t k = 0; k < count; k++) *row++ = f->index[begin + k];
    for (int32_t k = 0; k < packed; k++) *row++ = f->index[f->row[k]];
    w->row_count += count + packed;
    double *to = w->factors.at + AT8(w->factor_count);
    w->factor_count += own + count * packed;
    w->operations += 8 * (int64_t)(packed * (packed + 1) / 2 + packed) * count;
    for (int32_t p = 0; p < count; p++) {
        int pair = f->pairs >> p & 1;
        for (int k = 0; k < (pair ? 3 : 1); k++, to += 8) store8(to, 0, load8(f->inverse, AT8(3 * p + k)));
        p += pair;
    }
    vec8 one, other = splat8(0.0);
    for (int32_t q = 1; q < count; q++)
        for (int32_t p = 0; p < q; p++, to += 8) {
            if (f->pairs >> p & 1 && q == p + 1) {
                store8(to, 0, splat8(0.0));
                continue;
            }
            int pair = batch_divide_row(f, p, stride, begin + q, &one, &other);
            store8(to, 0, one);
            if (pair) {
                to += 8;
                p++;
                store8(to, 0, other);
            }
        }
    double *l = streamed ? f->l : to;
    int64_t step = AT8(packed);
    for (int32_t p = 0; p < count; p++) {
        if (f->pairs >> p & 1) {
            for (int32_t r = 0; r < packed; r++) {
                batch_divide_row(f, p, stride, f->row[r], &one, &other);
                store8(l, p * step + AT8(r), one);
                store8(l, (p + 1) * step + AT8(r), other);
            }
            p++;
        } else {
            vec8 inverse = load8(f->inverse, AT8(3 * p));
            for (int32_t r = 0; r < packed; r++) store8(l, p * step + AT8(r), mul8(load8(f->w, p * stride + AT8(f->row[r])), inverse));
        }
    }
    batch_subtract(f, l, count, w->offset);
    if (streamed)
        for (int64_t k = 0; k < count * packed; k++) stream8(to, AT8(k), load8(l, AT8(k)));
    return 0;
}

/* Eliminate what can be eliminated of the summed unknowns; at the roots, where nothing is left to wait for, those that have been
 * refused are tried again. */
static int batch_eliminate(batch_work *w, batch_front *f, int root, int streamed) {
    int32_t limit = f->summed, before = 0;
    while (f->eliminated < f->summed) {
        int32_t begin = f->eliminated, count = batch_take_panel(f, &limit);
        if (count && batch_keep(w, f, begin, count, streamed)) return -1;
        if (f->eliminated < limit) continue;
        if (!root) return 0;
        if (f->eliminated == before) return 0;
        limit = f->summed;
        before = f->eliminated;
    }
    return 0;
}

/* Where the place of a row in its parent, as planned, is there. */
static inline int32_t batch_place(int32_t local, int32_t planned, int32_t delayed, int32_t inner) {
    return local < planned ? delayed + local : inner + local - planned;
}

/* The columns of a front from those of its first child: what that has left is copied, all else is zero.  `place`: where the
 * rows of the child are; `fresh`: rows of the front where it has none. */
static void batch_begin(const batch_front *f, const double *child, const batch_left *c, const int32_t *place, const int32_t *fresh,
                        int32_t count) {
    int64_t stride = AT8(f->stride);
    for (int32_t k = 0; k < count && fresh[k] < f->inner; k++) {
        double *to = f->at + fresh[k] * stride;
        for (int32_t i = fresh[k]; i < f->stride; i++) store8(to, AT8(i), splat8(0.0));
    }
    for (int32_t j = c->from, first = 0; j < c->inner; j++) {
        double *to = f->at + place[j] * stride;
        const double *column = child + j * AT8(c->stride);
        for (int32_t i = j; i < c->stride; i++) store8(to, AT8(place[i]), load8(column, AT8(i)));
        while (first < count && fresh[first] < place[j]) first++;
        for (int32_t k = first; k < count; k++) store8(to, AT8(fresh[k]), splat8(0.0));
    }
}

/* Add what another child has left. */
static void batch_add(const batch_front *f, const double *child, const batch_left *c, const int32_t *place) {
    for (int32_t j = c->from; j < c->inner; j++) {
        double *to = f->at + place[j] * AT8(f->stride);
        const double *column = child + j * AT8(c->stride);
        for (int32_t i = j; i < c->stride; i++) store8(to, AT8(place[i]), add8(load8(to, AT8(place[i])), load8(column, AT8(i))));
    }
}

static int batch_reserve(batch_work *w, batch_front *f, int64_t used, int parity, int64_t index_used) {
    int32_t stride = f->stride;
    if (arena_reserve(&w->fronts[parity], used + AT8(stride) * f->inner, used)) return -1;
    if (arena_reserve(&w->panel, AT8(stride) * 2 * BATCH_PANEL + AT8(3 * BATCH_PANEL), 0)) return -1;
    if (batch_grow((void **)&w->index, &w->index_room, index_used + stride, sizeof(int32_t))) return -1;
    if (stride > w->place_room) {
        int32_t room = 2 * stride;
        free(w->place); free(w->fresh); free(w->row); free(w->offset);
        w->place = malloc(sizeof(int32_t) * (size_t)room);
        w->fresh = malloc(sizeof(int32_t) * (size_t)room);
        w->row = malloc(sizeof(int32_t) * (size_t)room);
        w->offset = malloc(sizeof(int64_t) * (size_t)room);
        w->place_room = room;
        if (!w->place || !w->fresh || !w->row || !w->offset) { w->place_room = 0; return -1; }
    }
    f->at = w->fronts[parity].at + used;
    f->index = w->index + index_used;
    f->w = w->panel.at;
    f->l = f->w + AT8(stride) * BATCH_PANEL;
    f->inverse = f->l + AT8(stride) * BATCH_PANEL;
    f->row = w->row;
    return 0;
}

/* Where a child's rows are in the front; `put` counts those that it has delayed. */
static void batch_find_places(const batch_work *w, const batch_shape *s, const batch_front *f, const batch_left *c, int32_t delayed,
                              int32_t planned, int32_t *put) {
    const int32_t *index = w->index + c->index_at, *local = s->plan->local + s->plan->row_start[c->front];
    for (int32_t i = c->from; i < c->stride; i++) {
        if (i < c->summed) {
            f->index[*put] = index[i];
            w->place[i] = (*put)++;
        } else {
            w->place[i] = batch_place(*local++, planned, delayed, f->inner);
        }
    }
}

static void batch_eliminate_group(int streamed, batch_work *w, batch_group *g) {
    const batch_shape *s = g->shape;
    const plan *p = s->plan;
    int32_t waiting = 0, corner_stride = s->ends + 1, fronts = p->fronts - (s->ends > 0);
    int64_t used[2] = {0, 0}, index_used = 0;
    if (arena_reserve(&w->corner, AT8(corner_stride) * corner_stride, 0)) { w->no_memory = 1; return; }
    memset(w->corner.at, 0, sizeof(double) * (size_t)(AT8(corner_stride) * corner_stride));
    g->first = w->panel_count;
    batch_front f = {.corner = w->corner.at, .corner_stride = corner_stride, .own = s->own, .largest = splat8(0.0),
                     .negative = splat8(0.0), .smallest = INFINITY,
                     .threshold = BATCH_THRESHOLD};
    for (int32_t at = 0; at < fronts; at++) {
        int32_t first = p->first[at], own = p->first[at + 1] - first, delayed = 0, parity = s->depth[at] & 1;
        int32_t inner = s->inner[at], ends = (int32_t)(p->row_start[at + 1] - p->row_start[at]) - inner, planned = own + inner;
        const int32_t *rows = p->rows + p->row_start[at];
        for (int32_t c = 0; c < p->children[at]; c++) {
            const batch_left *left = &w->waiting[waiting - 1 - c];
            delayed += left->summed - left->from;
        }
        f.summed = delayed + own;
        f.inner = f.summed + inner;
        f.stride = f.inner + ends;
        f.eliminated = 0;
        if (batch_reserve(w, &f, used[parity], parity, index_used)) { w->no_memory = 1; return; }
        for (int32_t k = 0; k < own; k++) f.index[delayed + k] = p->order[first + k];
        for (int32_t k = 0; k < inner + ends; k++) f.index[f.summed + k] = rows[k];
        int32_t put = 0, fresh = 0;
        if (!p->children[at]) {
            for (int32_t k = 0; k < f.inner; k++) w->fresh[k] = k;
            const batch_left none = {0};
            batch_begin(&f, NULL, &none, NULL, w->fresh, f.inner);
        }
        for (int32_t c = 0; c < p->children[at]; c++) {
            const batch_left *left = &w->waiting[--waiting];
            const double *child = w->fronts[!parity].at + left->at;
            batch_find_places(w, s, &f, left, delayed, planned, &put);
            if (c == 0) {
                for (int32_t i = left->from, k = 0; k < f.stride; k++)
                    if (i < left->stride && w->place[i] == k) i++;
                    else w->fresh[fresh++] = k;
                batch_begin(&f, child, left, w->place, w->fresh, fresh);
            } else {
                batch_add(&f, child, left, w->place);
            }
            used[!parity] = left->at;
        }
        for (int32_t k = 0; k < own; k++) {
            double *column = f.at + (delayed + k) * AT8(f.stride), *diagonal = column + AT8(delayed + k);
            store8(diagonal, 0, add8(load8(diagonal, 0), load8(g->matrix, AT8(p->order[first + k]))));
            for (int32_t e = p->entry_start[first + k]; e < p->entry_start[first + k + 1]; e++) {
                double *to = column + AT8(batch_place(p->entry_local[e], planned, delayed, f.inner));
                store8(to, 0, add8(load8(to, 0), load8(g->matrix, AT8(s->own + p->entry[e]))));
            }
        }
        int root = p->parent[at] < 0 || p->parent[at] == fronts;
        if (batch_eliminate(w, &f, root, streamed)) { w->no_memory = 1; return; }
        w->delayed += f.summed - f.eliminated;
        double wide = f.stride, usual = planned + ends;
        w->work += own * usual * usual;
        w->wasted += f.eliminated * wide * wide - own * usual * usual;
        for (int32_t k = f.eliminated; k < f.summed; k++)
            __atomic_store_n(s->weak + f.index[k], (uint8_t)1, __ATOMIC_RELAXED);
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
            for (int lane = 0; lane < g->segments; lane++) w->result[result[lane]] += value[lane];
        }
}

#endif
