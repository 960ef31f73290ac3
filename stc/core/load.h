/* The matrix, scaled, and its scale. */
#ifndef STC_LOAD_H
#define STC_LOAD_H

#include "batch_solve.h"
#include "system.h"

/* A scale is good when the largest entries of all rows are within this factor of 1; and sweeps to find one. */
#define GOOD 2.0
#define SWEEPS 12
#define SMALLEST_SCALE 1e-100
#define LARGEST_SCALE 1e100

/* Collect the diagonal of all unknowns, and the rest, not scaled: 0, or -1 where a number of it is not finite. */
int collect(kkt_state *s) {
    const kkt *k = s->k;
    const double *own = k->given + k->given_count, *restrict given = k->given;
    const int32_t *restrict source = s->source;
    double *restrict raw = s->raw, *restrict value = raw + s->size;
    for (int64_t i = 0; i < k->n; i++) s->diagonal[i] = own[i];
    for (int64_t i = k->n; i < k->n + k->m; i++) s->diagonal[i] = -own[i];
    for (int64_t i = 0; i < k->curved; i++) s->diagonal[k->curved_variable[i]] += given[k->curved_source[i]];
    for (int32_t i = 0; i < s->size; i++) raw[i] = s->diagonal[k->unknown[i]];
    for (int64_t e = 0, entries = s->entries; e < entries; e++) value[e] = given[source[e]];
    return check_of(raw, s->size + s->entries) == 0.0 ? 0 : -1;
}

/* Find the largest entries of the rest's rows, scaled; with `keep`, keep the scaled matrix. */
ALWAYS_INLINE void scale_rest(kkt_state *s, int keep) {
    const double *restrict scale = s->scale + s->outer, *restrict raw = s->raw;
    const int32_t *restrict order = s->order, *restrict start = s->start, *restrict row = s->row;
    double *restrict most = s->most + s->outer, *restrict matrix = s->matrix;
    int32_t size = s->size;
    for (int32_t i = 0; i < size; i++) {
        double value = raw[i] * scale[i] * scale[i];
        if (keep) matrix[i] = value;
        most[i] = fabs(value);
    }
    for (int32_t k = 0; k < size; k++) {
        int32_t i = order[k];
        double own = scale[i], highest = most[i];
        for (int32_t e = start[k]; e < start[k + 1]; e++) {
            int32_t r = row[e];
            double value = raw[size + e] * own * scale[r], magnitude = fabs(value);
            if (keep) matrix[size + e] = value;
            highest = magnitude > highest ? magnitude : highest;
            most[r] = magnitude > most[r] ? magnitude : most[r];
        }
        most[i] = highest;
    }
}

/* The largest of the ends' rows, to the rest. */
static void batch_raise_ends(const batch_group *g, const double *most, double *rest) {
    const double *own = most + g->at + AT8(g->shape->own);
    for (int32_t k = 0; k < g->shape->ends; k++)
        for (int lane = 0; lane < g->segments; lane++) raise_to(rest + g->end[AT8(k) + lane], own[AT8(k) + lane]);
}

/* Load a group: how far from 1 the largest entries of its rows are, and the largest entries of its ends, to the rest. */
static void batch_load(kkt_state *s, batch_work *w, batch_group *g, double *rest) {
    const batch_shape *shape = g->shape;
    int64_t own = shape->own;
    const double *scale = s->scale + g->at, *given = s->k->given;
    double *most = s->most + g->at, *matrix = g->matrix;
    vec8 check = splat8(0.0);
    for (int64_t k = own; k < own + shape->ends; k++) store8(most, AT8(k), splat8(0.0));
    for (int64_t k = 0; k < own; k++) {
        vec8 factor = load8(scale, AT8(k)), value = mul8(gather8(s->diagonal, g->unknown, AT8(k)), mul8(factor, factor));
        store8(matrix, AT8(k), value);
        store8(most, AT8(k), abs8(value));
        check = add8(check, scaled8(0.0, value));
    }
    vec8 high = splat8(1.0), low = splat8(-1.0);
    for (int64_t k = 0; k < own; k++) {
        vec8 factor = load8(scale, AT8(k)), largest = load8(most, AT8(k));
        for (int32_t e = shape->start[k]; e < shape->start[k + 1]; e++) {
            int64_t row = AT8(shape->row[e]);
            vec8 value = mul8(gather8(given, g->source, AT8(e)), mul8(factor, load8(scale, row)));
            vec8 size = abs8(value);
            store8(matrix, AT8(own + e), value);
            store8(most, row, max8(size, load8(most, row)));
            largest = max8(size, largest);
            check = add8(check, scaled8(0.0, value));
        }
        store8(most, AT8(k), largest);
        high = max8(largest, high);
        for (int part = 0; part < 8 / LANES; part++) {
            /* Rows of zeros are not to count. */
            masks none = largest.part[part] == splatw(0.0);
            largest.part[part] = (lanes)((masks)largest.part[part] | (none & (masks)splatw(1.0)));
        }
        low = max8(neg8(largest), low);
    }
    double spread = largest8(high), least = -largest8(low);
    if (spread * least < 1.0) spread = 1.0 / least;
    raise_to(&w->spread, spread);
    w->check += sum8(check);
    batch_raise_ends(g, s->most, rest);
}

void load_rest(kkt_state *s) {
    collect(s);
    scale_rest(s, 1);
}

/* Scale rows and columns alike until the largest entries of all rows are near 1 (Ruiz 2001): from ones, since rows and columns
 * would drift apart. */
int equilibrate(kkt_state *s) {
    double *rest = s->most + s->outer;
    for (int64_t i = 0; i < s->length; i++) s->scale[i] = 1.0;
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        double check = 0.0, low = LARGEST_SCALE, high = 0.0;
        scale_rest(s, 0);
        for (int64_t g = 0; g < s->k->groups; g++) {
            s->parts->check = 0.0;
            batch_load(s, s->parts, s->groups + g, rest);
            check += s->parts->check;
        }
        if (check != 0.0) return -1;
        for (int64_t g = 0; g < s->k->groups; g++) batch_take_ends(s->groups + g, rest, s->most);
        for (int64_t i = 0; i < s->outer + s->size; i++) {
            double value = s->most[i];
            high = value > high ? value : high;
            value = value > 0.0 ? value : 1.0;
            low = value < low ? value : low;
        }
        if (high < GOOD && low * GOOD > 1.0) break;
        for (int64_t i = 0; i < s->outer + s->size; i++) {
            double value = s->scale[i] / sqrt(s->most[i] > 0.0 ? s->most[i] : 1.0);
            value = value < SMALLEST_SCALE ? SMALLEST_SCALE : value;
            s->scale[i] = value > LARGEST_SCALE ? LARGEST_SCALE : value;
        }
        if (high < GOOD * GOOD * low) break;
    }
    return 0;
}

void magnitudes_of_shape(const kkt_state *s, const batch_shape *shape, double *magnitude) {
    for (int64_t e = 0; e < shape->entries; e++) magnitude[e] = INFINITY;
    for (int64_t k = 0; k < s->k->groups; k++) {
        const batch_group *g = s->groups + k;
        for (int64_t e = 0; g->shape == shape && e < shape->entries; e++) {
            double size = -largest8(neg8(abs8(load8(g->matrix, AT8(shape->own + e)))));
            if (size < magnitude[e]) magnitude[e] = size;
        }
    }
}

#endif
