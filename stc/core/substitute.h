/* Solving with the factors, and refining against the matrix itself. */
#ifndef STC_SUBSTITUTE_H
#define STC_SUBSTITUTE_H

#include "batch_solve.h"
#include "system.h"

/* Residuals are relative to the right-hand side plus the solution, or so many times the right-hand side. */
#define LARGEST_GAIN 1e6

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

/* x = (L D L^T)^-1 x of the rest; the same for `other` where there is one. */
static void substitute(kkt_state *s, double *restrict x, double *restrict other) {
    double *y = s->work;
    for (int32_t at = 0; at < s->plan->fronts; at++) {
        const factored *f = &s->fronts[at];
        const int32_t *index = s->index + f->index_at;
        for (double *v = x; v; v = v == x ? other : NULL) {
            for (int32_t k = 0; k < f->size; k++) y[k] = v[index[k]];
            forward_front(s->factors.at + f->factor_at, f->stride, f->eliminated, f->size, y);
            for (int32_t k = 0; k < f->size; k++) v[index[k]] = y[k];
        }
    }
    for (int32_t at = s->plan->fronts - 1; at >= 0; at--) {
        const factored *f = &s->fronts[at];
        const int32_t *index = s->index + f->index_at;
        for (double *v = x; v; v = v == x ? other : NULL) {
            for (int32_t k = 0; k < f->size; k++) y[k] = v[index[k]];
            divide_front(s->inverse + 3 * (int64_t)f->first, s->kind + f->first, f->eliminated, y);
            backward_front(s->factors.at + f->factor_at, f->stride, f->eliminated, f->size, y);
            for (int32_t k = 0; k < f->eliminated; k++) v[index[k]] = y[k];
        }
    }
}

/* left = b - K x of the rest: `matrix` is its diagonal and its entries, `entries` of them.  The largest magnitude, not a
 * number where one is not finite. */
static double residual(const kkt_state *s, const double *matrix, int64_t entries, const double *restrict b,
                       const double *restrict x, double *restrict left) {
    const kkt *k = s->k;
    const int32_t *restrict order = s->order, *restrict start = s->start, *restrict row = s->row;
    const double *restrict value = matrix + s->size;
    int32_t size = s->size;
    for (int32_t i = 0; i < size; i++) left[i] = b[i] - matrix[i] * x[i];
    for (int32_t j = 0; j < size; j++) {
        int32_t i = order[j];
        double own = x[i], sum = left[i];
        for (int32_t e = start[j]; e < start[j + 1]; e++) {
            int32_t r = row[e];
            sum -= value[e] * x[r];
            left[r] -= value[e] * own;
        }
        left[i] = sum;
    }
    for (int64_t e = s->entries; e < entries; e++) {
        left[k->column[e]] -= value[e] * x[k->row[e]];
        left[k->row[e]] -= value[e] * x[k->column[e]];
    }
    return norm_of(left, size);
}

/* A number for each place, of different magnitudes: rows that are the same would agree with the same numbers. */
static double probe_of(int64_t place) {
    double share = (double)(((uint64_t)place * 0x9e3779b97f4a7c15u) >> 11) * 0x1p-53;
    return share < 0.5 ? share - 1.0 : share;
}

/* Judge a change from the largest magnitudes of the solution and of what is left: it is taken back where it has made things
 * worse, and `active` says whether there is to be another one. */
static void judge_change(kkt_state *s, unknowns *u, double highest, double remaining, int refinements) {
    double gain = LARGEST_GAIN * u->length, now = remaining / (u->length + (highest < gain ? highest : gain)), before = u->report;
    if (!s->steps) u->growth = highest / u->length;
    u->active = 0;
    if (!(now < before) && s->steps > 0) {
        for (int64_t i = 0; i < s->length; i++) u->x[i] -= u->change[i];
        return;
    }
    u->report = now;
    u->active = now < before && !(now > 0.5 * before || now <= *s->k->accuracy || s->steps >= refinements);
}

void solve_system(kkt_state *s, int count, int probing, int refinements) {
    const kkt *k = s->k;
    const double *rhs[2] = {k->rhs, k->second_rhs};
    double *result[2] = {k->solution, k->second_solution}, report = 0.0;
    int64_t parts = k->groups ? k->parts : 0;
    s->steps = 0;
    s->probing = probing;
    s->count = count;
    for (int which = 0; which < count; which++) {
        unknowns *u = s->solving[which] = s->unknowns + which;
        double *const *vector = s->vector + 4 * which;
        *u = (unknowns){vector[0], vector[1], vector[2], vector[3], rhs[which], 0.0, 0.0, 0.0, 1};
        for (int64_t i = 0; probing && i < s->length; i++) u->b[i] = probe_of(i);
        for (int64_t i = 0, at = s->outer; i < s->size; i++, at++) {
            if (!probing) u->b[at] = u->rhs[k->unknown[i]] * s->scale[at];
            u->x[at] = u->b[at];
        }
        u->length = norm_of(u->b + s->outer, s->size);
        for (int64_t part = 0; part < parts; part++) s->parts[part].length[which] = 0.0;
    }
    for (; s->count; s->steps++) {
        double *x[2] = {NULL, NULL};
        if (parts) invoke(k->calls, KKT_FORWARD);
        for (int which = 0; which < s->count; which++) {
            unknowns *u = s->solving[which];
            x[which] = target_of(s, u) + s->outer;
            for (int64_t part = 0; part < parts; part++) {
                raise_to(&u->length, s->parts[part].length[which]);
                for (int64_t i = 0; i < s->size; i++) x[which][i] += s->parts[part].sum[which][i];
            }
            if (!s->steps) u->report = (double)(u->active = !(u->length == 0.0));
        }
        substitute(s, x[0], x[1]);
        if (parts) invoke(k->calls, KKT_BACKWARD);
        int kept = 0;
        for (int which = 0; which < s->count; which++) {
            unknowns *u = s->solving[which];
            double *own = u->x + s->outer, *left = u->left + s->outer;
            for (int64_t i = 0; s->steps && i < s->size; i++) own[i] += x[which][i];
            double remaining = residual(s, s->matrix, s->entries, u->b + s->outer, own, left), highest = norm_of(own, s->size);
            for (int64_t part = 0; part < parts; part++) {
                const batch_work *w = s->parts + part;
                raise_to(&highest, w->highest[which]);
                for (int64_t i = 0; i < s->size; i++) left[i] += w->sum[which][i];
            }
            if (parts) remaining = norm_of(left, s->size);
            for (int64_t part = 0; part < parts; part++) raise_to(&remaining, s->parts[part].remaining[which]);
            if (u->active) judge_change(s, u, highest, remaining, refinements);
            double *swapped = u->change;
            u->change = u->left;
            u->left = swapped;
            if (u->active) s->solving[kept++] = u;
        }
        s->count = kept;
    }
    s->count = count;
    if (probing) return;
    if (parts) invoke(k->calls, KKT_RETURN);
    for (int which = 0; which < count; which++) {
        for (int64_t i = 0; i < s->size; i++)
            result[which][k->unknown[i]] = s->unknowns[which].x[s->outer + i] * s->scale[s->outer + i];
        raise_to(&report, s->unknowns[which].report);
    }
    *k->report = report;
}

#endif
