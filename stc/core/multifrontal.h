/* All fronts, one after the other: assembled from the matrix and from what their children have left, and eliminated. */
#ifndef STC_MULTIFRONTAL_H
#define STC_MULTIFRONTAL_H

#include <stdlib.h>
#if defined(__AVX512F__)
#include <immintrin.h>
#endif

#include "front.h"
#include "singular.h"

/* Columns are so many numbers apart: whole lines, and not all on the same lines of a cache. */
static inline int32_t stride_of(int32_t size) {
    int32_t stride = padded(size);
    return stride % 64 == 0 ? stride + 8 : stride;
}

/* Columns of a front that there is memory for: whole tiles are written. */
static inline int64_t columns_of(int32_t size) { return padded(size); }

/* What a child has left is added run by run, where unknowns that follow one another in it do so in its parent in runs of
 * so many on average, else one by one. */
#define LONG_RUN 12

/* Whole vectors of rows from `from` to before `end`: what is above the diagonal, or beyond the last row, is never read. */
static inline void clear_rows(double *to, int32_t from, int32_t end) {
    for (int32_t i = from; i < end; i += LANES) *(lanes *)(to + i) = (lanes){0};
}

#if defined(__AVX512F__)
/* Eight rows of a parent that a child has some of, `mask` saying which, from row `from` of the child on. */
typedef struct {
    int32_t to, from, mask;
} block;

/* Add what a child has left, `place` saying where each of its unknowns is, increasing; `work` is for three times as many.
 * Rows of the child spread to eight of the parent at a time. */
static void add_contribution(double *restrict at, int64_t stride, const double *restrict given, const contribution *c,
                             const int32_t *restrict place, int32_t *restrict work) {
    int32_t size = c->size, count = 0;
    block *blocks = (block *)work;
    for (int32_t i = 0; i < size; i++) {
        int32_t to = place[i] & ~7;
        if (!count || blocks[count - 1].to != to) blocks[count++] = (block){to, i, 0};
        blocks[count - 1].mask |= 1 << (place[i] & 7);
    }
    for (int32_t j = 0, first = 0; j < size; j++) {
        double *to = at + place[j] * stride;
        const double *from = given + (int64_t)j * c->stride;
        if (first + 1 < count && blocks[first + 1].from <= j) first++;
        __mmask8 mask = (__mmask8)(blocks[first].mask & (0xff << (place[j] & 7)));
        double *put = to + blocks[first].to;
        _mm512_storeu_pd(put, _mm512_add_pd(_mm512_loadu_pd(put), _mm512_maskz_expand_pd(mask, _mm512_loadu_pd(from + j))));
        for (int32_t r = first + 1; r < count; r++) {
            put = to + blocks[r].to;
            __m512d spread = _mm512_maskz_expand_pd((__mmask8)blocks[r].mask, _mm512_loadu_pd(from + blocks[r].from));
            _mm512_storeu_pd(put, _mm512_add_pd(_mm512_loadu_pd(put), spread));
        }
    }
}
#else
/* Add what a child has left, `place` saying where each of its unknowns is; `runs` is work space. */
static void add_contribution(double *restrict at, int64_t stride, const double *restrict given, const contribution *c,
                             const int32_t *restrict place, int32_t *restrict runs) {
    int32_t size = c->size, count = 1;
    runs[0] = 0;
    for (int32_t i = 1; i < size; i++) { /* without a branch, which nobody could foretell */
        runs[count] = i;
        count += place[i] != place[i - 1] + 1;
    }
    runs[count] = size;
    if (size < LONG_RUN * count) {
        for (int32_t j = 0; j < size; j++) {
            double *to = at + place[j] * stride;
            const double *from = given + (int64_t)j * c->stride;
            for (int32_t i = j; i < size; i++) to[place[i]] += from[i];
        }
        return;
    }
    for (int32_t j = 0, first = 0; j < size; j++) {
        double *to = at + place[j] * stride;
        const double *from = given + (int64_t)j * c->stride;
        if (runs[first + 1] <= j) first++;
        for (int32_t r = first, i = j; r < count; r++) {
            double *run = to + place[i] - i;
            int32_t end = runs[r + 1];
            for (; i + LANES <= end; i += LANES) *(lanes *)(run + i) += *(const lanes *)(from + i);
            for (; i < end; i++) run[i] += from[i];
        }
    }
}
#endif

/* Make all of a front zero that may be read. */
static void clear(const front *f) {
    for (int32_t j = 0; j < f->size; j++) clear_rows(f->at + (int64_t)j * f->stride, j - j % LANES, f->end);
}

/* Where a front and what it leaves go: enough room for all of it, or -1. */
static int reserve(kkt_state *s, int32_t size, int32_t summed, int64_t factors_used, int64_t stack_used, int64_t index_used) {
    int64_t stride = stride_of(size), all = stride * columns_of(size);
    /* Vectors and tiles of what a front leaves begin anywhere, and reach beyond its last row and column. */
    if (arena_reserve(&s->factors, factors_used + stride * summed + LANES, factors_used)) return -1;
    if (arena_reserve(&s->front, all + TILE_COLUMNS * stride + LANES, 0)) return -1;
    if (arena_reserve(&s->stack, stack_used + all, stack_used)) return -1;
    if (arena_reserve(&s->panel, (PANEL + 2) * stride, 0)) return -1;
    if (index_used + size > s->index_room) {
        int64_t room = 2 * (index_used + size) + 64;
        int32_t *larger = realloc(s->index, sizeof(int32_t) * (size_t)room);
        if (!larger) return -1;
        s->index = larger;
        s->index_room = room;
    }
    if (4 * size > s->local_room) { /* places, and three times as many for add_contribution */
        int32_t *larger = realloc(s->local, sizeof(int32_t) * (size_t)(8 * size));
        if (!larger) return -1;
        s->local = larger;
        s->local_room = 8 * size;
    }
    return 0;
}

/* Where more unknowns wait for a later front than this many and those of the front, smaller pivots are taken: in matrices
 * close to singular they would gather, thousands of them, and fill the last fronts. */
#define WAITING_FREELY 100
#define LOWEST_THRESHOLD 1e-8

/* Of the elimination of so many unknowns of a front. */
static int64_t operations_of(int64_t size, int64_t taken) {
    int64_t count = 0;
    for (int64_t k = 0; k < taken; k++) count += (size - k) * (size - k - 1) / 2;
    return count;
}

/* How many of some unknowns are rows. */
static int32_t rows_among(const kkt_state *s, const int32_t *index, int32_t count) {
    int32_t rows = 0;
    for (int32_t k = 0; k < count; k++) rows += index[k] >= s->variables;
    return rows;
}

int64_t factorize_rest(kkt_state *s, int needed) {
    kkt *k = s->k;
    const plan *p = s->plan;
    int64_t factors_used = 0, stack_used = 0, index_used = 0, entries = 0, operations = 0, delayed_in_all = 0, wasted = 0;
    int32_t waiting = 0, pivots = 0, widest = 0, held = 0, ordered = s->order == p->order;
    const double *value = s->left + s->size;
    front f = {.variables = s->variables};
    for (int32_t at = 0; at < p->fronts; at++) {
        int32_t first = p->first[at], own = p->first[at + 1] - first, delayed = 0, excess = 0;
        int64_t positive = f.positive;
        int32_t rows = (int32_t)(p->row_start[at + 1] - p->row_start[at]);
        for (int32_t c = 0; c < p->children[at]; c++) delayed += s->waiting[waiting - 1 - c].delayed;
        int32_t size = delayed + own + rows, stride = stride_of(size);
        if (reserve(s, size, delayed + own, factors_used, stack_used, index_used)) return KKT_NO_MEMORY;
        f.at = s->front.at;
        f.factor = s->factors.at + factors_used;
        f.stride = stride;
        f.size = size;
        f.end = (size + LANES - 1) / LANES * LANES;
        f.summed = delayed + own;
        f.eliminated = 0;
        f.index = s->index + index_used;
        f.inverse = s->inverse + 3 * (int64_t)pivots;
        f.kind = s->kind + pivots;
        f.panel = s->panel.at;
        f.threshold = held > WAITING_FREELY + size ? LOWEST_THRESHOLD : k->threshold;
        memcpy(f.index + delayed, p->order + first, sizeof(int32_t) * (size_t)own);
        memcpy(f.index + f.summed, p->rows + p->row_start[at], sizeof(int32_t) * (size_t)rows);
        clear(&f);
        for (int32_t i = 0; i < own; i++) {
            double *column = f.at + (int64_t)(delayed + i) * stride + delayed;
            column[i] = s->left[p->order[first + i]];
            for (int32_t e = p->entry_start[first + i]; e < p->entry_start[first + i + 1]; e++)
                column[p->entry_local[e]] = value[ordered ? e : p->entry[e]];
        }
        for (int32_t c = 0, put = 0; c < p->children[at]; c++) {
            const contribution *child = &s->waiting[--waiting];
            const int32_t *local = p->local + p->row_start[child->front] - child->delayed;
            for (int32_t i = 0; i < child->delayed; i++) {
                f.index[put] = s->index[child->index_at + i];
                s->local[i] = put++;
            }
            for (int32_t i = child->delayed; i < child->size; i++) s->local[i] = delayed + local[i];
            add_contribution(f.at, stride, s->stack.at + child->at, child, s->local, s->local + s->local_room / 4);
            stack_used = child->at;
            excess += child->excess;
        }
        eliminate(&f);
        held += f.summed - f.eliminated - delayed;
        int32_t taken = f.eliminated;
        if (p->parent[at] < 0 && taken < size) { /* not a number, or overflowed: give up on what is left */
            for (int32_t i = taken; i < size; i++) {
                double *column = f.factor + (int64_t)i * stride;
                memset(column, 0, sizeof(double) * (size_t)stride);
                column[i] = 1.0;
                f.inverse[3 * i] = (f.index[i] < s->variables ? 1.0 : -1.0) / REPLACEMENT;
                f.inverse[3 * i + 1] = f.inverse[3 * i + 2] = 0.0;
                f.kind[i] = ONE;
                f.zero++;
            }
            taken = size;
        }
        /* With more pivots up to here that are not positive than rows among them and rows still to come that they couple
         * with, there is a space of more than m dimensions on which the quadratic form of K is nowhere positive: the span
         * of those directions of the pivots that solve the rows to come, and of all rows to come.  Then more than m
         * eigenvalues are negative or zero, whatever follows. */
        excess += taken - (int32_t)(f.positive - positive) - rows_among(s, f.index, taken);
        int32_t beyond = needed ? excess - rows_among(s, f.index + taken, size - taken) : 0;
        if (beyond > 0) {
            k->inertia[0] = k->n - beyond;
            k->inertia[1] = k->m + beyond - f.zero;
            k->inertia[2] = f.zero;
            s->wasted_here = wasted;
            return KKT_GIVEN_UP;
        }
        for (int32_t i = taken; i < f.summed; i++) s->weak[f.index[i]] = 1;
        factored *kept = &s->fronts[at];
        kept->factor_at = factors_used;
        kept->index_at = index_used;
        kept->stride = stride;
        kept->size = size;
        kept->eliminated = taken;
        kept->first = pivots;
        pivots += taken;
        factors_used += (int64_t)stride * taken;
        index_used += size;
        widest = size > widest ? size : widest;
        delayed_in_all += f.summed - taken;
        entries += (int64_t)taken * size - (int64_t)taken * (taken - 1) / 2;
        int64_t done = operations_of(size, taken);
        operations += done;
        wasted += done - operations_of(own + rows, own);
        if (p->parent[at] >= 0) {
            contribution *c = &s->waiting[waiting++];
            c->size = size - taken;
            c->delayed = f.summed - taken;
            c->stride = stride_of(c->size);
            c->at = stack_used;
            c->index_at = kept->index_at + taken;
            c->front = at;
            c->excess = excess;
            leave(&f, s->stack.at + stack_used, c->stride);
            stack_used += (int64_t)c->stride * c->size;
        }
    }
    if (2 * (int64_t)padded(widest) + 64 > s->work_room) {
        free(s->work);
        s->work_room = 2 * (int64_t)padded(widest) + 64;
        s->work = malloc(sizeof(double) * (size_t)s->work_room);
        if (!s->work) { s->work_room = 0; return KKT_NO_MEMORY; }
    }
    k->nonzeros = entries;
    k->operations = operations;
    k->delayed = delayed_in_all;
    k->inertia[0] = f.positive;
    k->inertia[1] = f.negative;
    k->inertia[2] = f.zero;
    s->wasted_here = wasted;
    confirm_zeros(s);
    return k->inertia[2] ? KKT_SINGULAR : KKT_OK;
}

#endif
