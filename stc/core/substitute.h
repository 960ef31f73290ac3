/* Solving with the factors, and refining against the matrix itself. */
#ifndef STC_SUBSTITUTE_H
#define STC_SUBSTITUTE_H

#include "system.h"
#include "vectors.h"

/* y -= L x below the eliminated ones, and before that x = L^-1 x among them; y holds both. */
static void forward_front(const double *restrict l, int32_t stride, int32_t taken, int32_t size, double *restrict y) {
    int32_t k = 0;
    for (; k + 4 <= taken; k += 4) {
        const double *a = l + (int64_t)k * stride, *b = a + stride, *c = b + stride, *d = c + stride;
        double p = y[k], q = y[k + 1] - a[k + 1] * p, r = y[k + 2] - a[k + 2] * p - b[k + 2] * q;
        double t = y[k + 3] - a[k + 3] * p - b[k + 3] * q - c[k + 3] * r;
        y[k + 1] = q;
        y[k + 2] = r;
        y[k + 3] = t;
        lanes vp = all_of(p), vq = all_of(q), vr = all_of(r), vt = all_of(t);
        int32_t i = k + 4;
        for (; i + LANES <= size; i += LANES)
            *(lanes *)(y + i) -= *(const lanes *)(a + i) * vp + *(const lanes *)(b + i) * vq + *(const lanes *)(c + i) * vr
                                 + *(const lanes *)(d + i) * vt;
        for (; i < size; i++) y[i] -= a[i] * p + b[i] * q + c[i] * r + d[i] * t;
    }
    for (; k < taken; k++) {
        const double *a = l + (int64_t)k * stride;
        double p = y[k];
        int32_t i = k + 1;
        for (; i + LANES <= size; i += LANES) *(lanes *)(y + i) -= *(const lanes *)(a + i) * all_of(p);
        for (; i < size; i++) y[i] -= a[i] * p;
    }
}

static inline double sum_of(lanes x) {
    double sum = 0.0;
    for (int k = 0; k < LANES; k++) sum += x[k];
    return sum;
}

/* x = L^-T (x - L' y), y being the numbers below. */
static void backward_front(const double *restrict l, int32_t stride, int32_t taken, int32_t size, double *restrict y) {
    int32_t k = taken;
    for (; k % 4; k--) {
        const double *a = l + (int64_t)(k - 1) * stride;
        lanes sum = {0};
        double rest = y[k - 1];
        int32_t i = k;
        for (; i + LANES <= size; i += LANES) sum += *(const lanes *)(a + i) * *(const lanes *)(y + i);
        for (; i < size; i++) rest -= a[i] * y[i];
        y[k - 1] = rest - sum_of(sum);
    }
    for (; k > 0; k -= 4) {
        const double *a = l + (int64_t)(k - 4) * stride, *b = a + stride, *c = b + stride, *d = c + stride;
        lanes sa = {0}, sb = {0}, sc = {0}, sd = {0};
        int32_t i = k;
        double ra = y[k - 4], rb = y[k - 3], rc = y[k - 2], rd = y[k - 1];
        for (; i + LANES <= size; i += LANES) {
            lanes x = *(const lanes *)(y + i);
            sa += *(const lanes *)(a + i) * x;
            sb += *(const lanes *)(b + i) * x;
            sc += *(const lanes *)(c + i) * x;
            sd += *(const lanes *)(d + i) * x;
        }
        for (; i < size; i++) {
            ra -= a[i] * y[i];
            rb -= b[i] * y[i];
            rc -= c[i] * y[i];
            rd -= d[i] * y[i];
        }
        rd -= sum_of(sd);
        rc -= sum_of(sc) + c[k - 1] * rd;
        rb -= sum_of(sb) + b[k - 1] * rd + b[k - 2] * rc;
        ra -= sum_of(sa) + a[k - 1] * rd + a[k - 2] * rc + a[k - 3] * rb;
        y[k - 4] = ra;
        y[k - 3] = rb;
        y[k - 2] = rc;
        y[k - 1] = rd;
    }
}

/* y = D^-1 y for the pivots of a front. */
static void divide_front(const double *inverse, const uint8_t *kind, int32_t taken, double *y) {
    for (int32_t k = 0; k < taken; k++, inverse += 3) {
        if (kind[k] == ONE) {
            y[k] *= inverse[0];
        } else {
            double a = y[k], b = y[k + 1];
            y[k] = inverse[0] * a + inverse[1] * b;
            y[k + 1] = inverse[1] * a + inverse[2] * b;
            k++;
            inverse += 3;
        }
    }
}

/* x = (L D L^T)^-1 x, by position; the same for `other` where there is one. */
static void substitute(kkt *s, double *restrict x, double *restrict other) {
    double *y = s->work, *z = s->work + s->work_room / 2;
    for (int32_t at = 0; at < s->plan->fronts; at++) {
        const factored *f = &s->fronts[at];
        const int32_t *index = s->index + f->index_at;
        const double *l = s->factors.at + f->factor_at;
        for (int32_t k = 0; k < f->size; k++) y[k] = x[index[k]];
        forward_front(l, f->stride, f->eliminated, f->size, y);
        for (int32_t k = 0; k < f->size; k++) x[index[k]] = y[k];
        if (!other) continue;
        for (int32_t k = 0; k < f->size; k++) z[k] = other[index[k]];
        forward_front(l, f->stride, f->eliminated, f->size, z);
        for (int32_t k = 0; k < f->size; k++) other[index[k]] = z[k];
    }
    for (int32_t at = s->plan->fronts - 1; at >= 0; at--) {
        const factored *f = &s->fronts[at];
        const int32_t *index = s->index + f->index_at;
        const double *l = s->factors.at + f->factor_at;
        for (int32_t k = 0; k < f->size; k++) y[k] = x[index[k]];
        divide_front(s->inverse + 3 * (int64_t)f->first, s->kind + f->first, f->eliminated, y);
        backward_front(l, f->stride, f->eliminated, f->size, y);
        for (int32_t k = 0; k < f->eliminated; k++) x[index[k]] = y[k];
        if (!other) continue;
        for (int32_t k = 0; k < f->size; k++) z[k] = other[index[k]];
        divide_front(s->inverse + 3 * (int64_t)f->first, s->kind + f->first, f->eliminated, z);
        backward_front(l, f->stride, f->eliminated, f->size, z);
        for (int32_t k = 0; k < f->eliminated; k++) other[index[k]] = z[k];
    }
}

/* left = b - K x, scaled, by position; its largest magnitude, not a number where it is not finite. */
static double residual(const kkt *s, const double *restrict b, const double *restrict x, double *restrict left) {
    const plan *p = s->plan;
    double most = 0.0, check = 0.0;
    for (int32_t k = 0; k < s->size; k++) left[k] = b[k] - s->diagonal[k] * x[k];
    for (int32_t k = 0; k < s->size; k++) {
        double own = x[k], sum = left[k];
        for (int64_t e = p->entry_start[k]; e < p->entry_start[k + 1]; e++) {
            int32_t r = p->entry_row[e];
            double value = s->value[e];
            sum -= value * x[r];
            left[r] -= value * own;
        }
        left[k] = sum;
        check += sum * 0.0;
        most = fabs(sum) > most ? fabs(sum) : most;
    }
    return most + check;
}

static void begin(const kkt *s, unknowns *u, const double *rhs) {
    for (int32_t k = 0; k < s->size; k++) {
        u->b[k] = u->change[k] = rhs[s->plan->order[k]] * s->scale[k];
        u->x[k] = 0.0;
    }
    u->length = largest_of(u->b, s->size);
    u->active = !(u->length == 0.0);
    u->report = u->active;
}

/* Add a change, and leave in its place what is left to solve for; the change is taken back where it made that worse. */
static void improve(const kkt *s, unknowns *u, int64_t steps) {
    for (int32_t k = 0; k < s->size; k++) u->x[k] += u->change[k];
    u->active = 0;
    if (s->options.refinements == 0) return;
    double remaining = residual(s, u->b, u->x, u->left), highest = largest_of(u->x, s->size);
    if (worsened(u, highest, remaining, s->arrays.accuracy[0], steps, s->options.refinements))
        for (int32_t k = 0; k < s->size; k++) u->x[k] -= u->change[k];
    if (u->active) memcpy(u->change, u->left, sizeof(double) * (size_t)s->size);
}

void solve_system(kkt *s, int both) {
    double *left = s->most; /* only used while a scale is sought */
    unknowns one = {s->vector[0], s->vector[1], s->vector[2], left, 0.0, 0.0, 0};
    unknowns two = {s->vector[3], s->vector[4], s->vector[5], left, 0.0, 0.0, 0};
    int64_t steps = 0;
    begin(s, &one, s->arrays.rhs);
    if (both) begin(s, &two, s->arrays.second_rhs);
    while (one.active || two.active) {
        if (one.active) substitute(s, one.change, two.active ? two.change : NULL);
        else substitute(s, two.change, NULL);
        if (one.active) improve(s, &one, steps);
        if (two.active) improve(s, &two, steps);
        steps++;
    }
    for (int32_t k = 0; k < s->size; k++) s->arrays.solution[s->plan->order[k]] = one.x[k] * s->scale[k];
    if (both)
        for (int32_t k = 0; k < s->size; k++) s->arrays.second_solution[s->plan->order[k]] = two.x[k] * s->scale[k];
    s->arrays.report[0] = one.report > two.report || one.report != one.report ? one.report : two.report;
    s->arrays.report[1] = (double)(steps > 0 ? steps - 1 : 0);
}

#endif
