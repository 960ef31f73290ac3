/* The life of a system of like segments, its scale, and what its parts have in common. */
#include "batch.h"

#include <string.h>

#include "batch_solve.h"
#include "batch_tree.h"

/* A scale serves as long as the largest entries of all rows are within this factor of 1. */
#define BATCH_STALE 1024.0

/* Factors with smaller pivots or larger entries than these are tried on a right-hand side: the residual, before refinement,
 * should be no larger than BATCH_INACCURATE, and the solution no longer than BATCH_SINGULAR times as much. */
#define BATCH_SUSPECT 1e-9
#define BATCH_GROWTH 1e10
#define BATCH_INACCURATE 1e-5
#define BATCH_SINGULAR 3e9
/* Where both are below this share of that, factors are not tried again until they are so many times as suspect. */
#define BATCH_EASILY 1e-2
#define BATCH_MORE 3.0
/* Factors of more bytes are out of a processor's own memory: so many numbers before their place is read it is asked for. */
#define BATCH_DISTANT (1 << 22)
#define BATCH_AHEAD 1200
/* Steps of refinement at most. */
#define BATCH_REFINEMENTS 10
/* After a matrix that was refused, so many at most are left to the other method. */
#define BATCH_LONGEST_PAUSE 15

/* What eight matrices spend on a front as a whole counts for so little in uniting fronts: with 8, which they are, the
 * solves of four problems take as long in the geometric mean, cart-pole with 10,000 intervals a tenth longer. */
enum { BATCH_SHARED = 32 };

static void *batch_array(int64_t count, size_t size) { return calloc((size_t)count + 8, size); }

/* --- Memory. */

void batch_free(batch *b) {
    batch_state *s = BATCH_STATE(b);
    if (!s) return;
    for (int64_t k = 0; k < b->shapes && s->shapes; k++) {
        plan_free(s->shapes[k].plan);
        free(s->shapes[k].depth);
        free(s->shapes[k].inner);
        free(s->shapes[k].weak);
    }
    for (int64_t k = 0; k < b->groups && s->groups; k++) {
        free(s->groups[k].unknown);
        free(s->groups[k].source);
    }
    for (int64_t k = 0; k < b->parts && s->parts; k++) {
        batch_work *w = s->parts + k;
        arena_free(&w->factors);
        arena_free(&w->fronts[0]);
        arena_free(&w->fronts[1]);
        arena_free(&w->panel);
        arena_free(&w->corner);
        free(w->panels); free(w->rows); free(w->index); free(w->place); free(w->fresh); free(w->row); free(w->offset); free(w->waiting);
        if (k) free(w->result);
        free(w->sum[0]); free(w->sum[1]); free(w->most);
    }
    arena_free(&s->memory);
    free(s->shapes); free(s->groups); free(s->parts); free(s->diagonal); free(s->rest_matrix);
    free(s);
    b->state = 0;
}

static int batch_new_shapes(const batch *b, batch_state *s) {
    s->shapes = batch_array(b->shapes, sizeof(batch_shape));
    if (!s->shapes) return -1;
    const int32_t *one = b->one, *other = b->other, *stage = b->stage;
    for (int64_t k = 0; k < b->shapes; k++) {
        const int64_t *given = b->shape + 4 * k;
        s->shapes[k] = (batch_shape){.own = (int32_t)given[0], .variables = (int32_t)given[1], .ends = (int32_t)given[2],
                                     .entries = (int32_t)given[3], .one = one, .other = other, .stage = stage};
        s->shapes[k].weak = batch_array(given[0] + given[2], 1);
        if (!s->shapes[k].weak) return -1;
        one += given[3];
        other += given[3];
        stage += given[0] + given[2];
    }
    return 0;
}

static int batch_new_groups(const batch *b, batch_state *s) {
    s->groups = batch_array(b->groups, sizeof(batch_group));
    if (!s->groups) return -1;
    const int32_t *unknown = b->unknown, *source = b->source, *end = b->end, *result = b->result;
    int64_t at = 0;
    for (int64_t k = 0; k < b->groups; k++) {
        batch_shape *shape = s->shapes + b->group[3 * k];
        batch_group *g = s->groups + k;
        int64_t own = 8 * (int64_t)shape->own, entries = 8 * (int64_t)shape->entries, ends = shape->ends;
        *g = (batch_group){.shape = shape, .segments = (int32_t)b->group[3 * k + 1], .part = (int32_t)b->group[3 * k + 2],
                           .at = at, .given_unknown = unknown, .given_source = source, .end = end, .result = result};
        g->unknown = batch_array(own, sizeof(int32_t));
        g->source = batch_array(entries, sizeof(int32_t));
        if (!g->unknown || !g->source) return -1;
        memcpy(g->unknown, unknown, sizeof(int32_t) * (size_t)own);
        memcpy(g->source, source, sizeof(int32_t) * (size_t)entries);
        at += own + 8 * ends;
        s->vectors += shape->own + shape->entries;
        unknown += own;
        source += entries;
        end += 8 * ends;
        result += 4 * ends * (ends + 1);
    }
    s->outer = at;
    s->length = (at + b->rest + 7) & ~7;
    return 0;
}

static int batch_new_parts(const batch *b, batch_state *s) {
    s->parts = batch_array(b->parts, sizeof(batch_work));
    if (!s->parts) return -1;
    for (int64_t k = 0; k < b->parts; k++) {
        batch_work *w = s->parts + k;
        w->first = w->end = -1;
        for (int32_t g = 0; g < b->groups; g++)
            if (s->groups[g].part == k) {
                if (w->first < 0) w->first = g;
                w->end = g + 1;
            }
        w->result = k ? batch_array(b->rest_length, sizeof(double)) : b->rest_given;
        w->sum[0] = batch_array(b->rest, sizeof(double));
        w->sum[1] = batch_array(b->rest, sizeof(double));
        w->most = batch_array(b->rest, sizeof(double));
        if (!w->result || !w->sum[0] || !w->sum[1] || !w->most) return -1;
    }
    return 0;
}

int64_t batch_new(batch *b) {
    batch_state *s = batch_array(1, sizeof *s);
    if (!s) return BATCH_NO_MEMORY;
    b->state = (int64_t)(intptr_t)s;
    if (batch_new_shapes(b, s) || batch_new_groups(b, s) || batch_new_parts(b, s)) goto failed;
    s->diagonal = batch_array(b->size, sizeof(double));
    s->rest_matrix = batch_array(b->rest + b->rest_entries, sizeof(double));
    if (!s->diagonal || !s->rest_matrix || arena_reserve(&s->memory, 10 * s->length + 8 * s->vectors, 0)) goto failed;
    memset(s->memory.at, 0, sizeof(double) * (size_t)(10 * s->length + 8 * s->vectors));
    s->scale = s->memory.at;
    s->most = s->scale + s->length;
    for (int k = 0; k < 8; k++) s->vector[k] = s->most + (k + 1) * s->length;
    double *matrix = s->vector[7] + s->length;
    for (int64_t k = 0; k < b->groups; k++) {
        s->groups[k].matrix = matrix;
        matrix += 8 * (int64_t)(s->groups[k].shape->own + s->groups[k].shape->entries);
    }
    batch_restart(b);
    return 0;
failed:
    batch_free(b);
    return BATCH_NO_MEMORY;
}

void batch_restart(batch *b) {
    batch_state *s = BATCH_STATE(b);
    s->fresh = 1;
    s->pause = s->wait = 0;
    s->trusted = 1.0;
    s->wasted = 0.0; /* another plan would have later solves differ from each other in their last digits */
    b->use = 0;
}

int64_t batch_held(const batch *b) {
    const batch_state *s = BATCH_STATE(b);
    int64_t held = s->memory.room + 8 * s->vectors;
    for (int64_t k = 0; k < b->parts; k++)
        held += s->parts[k].factors.room + s->parts[k].fronts[0].room + s->parts[k].fronts[1].room + 2 * s->parts[k].row_room;
    return held;
}

/* --- The matrix. */

/* The diagonal of all unknowns. */
static void batch_collect_diagonal(const batch *b, batch_state *s) {
    const double *own = b->given + b->given_count;
    for (int64_t k = 0; k < b->n; k++) s->diagonal[k] = own[k];
    for (int64_t k = b->n; k < b->n + b->m; k++) s->diagonal[k] = -own[k];
    for (int64_t k = 0; k < b->curved; k++) s->diagonal[b->curved_variable[k]] += b->given[b->curved_source[k]];
}

static int batch_is_finite(const batch *b, const batch_state *s) {
    double check = 0.0;
#pragma omp simd reduction(+ : check)
    for (int64_t k = 0; k < b->given_count; k++) check += b->given[k] * 0.0;
#pragma omp simd reduction(+ : check)
    for (int64_t k = 0; k < b->n + b->m; k++) check += s->diagonal[k] * 0.0;
    return check == 0.0;
}

/* Unscaled numbers of a group. */
static void batch_load_raw(const batch *b, const batch_state *s, batch_group *g) {
    int64_t own = g->shape->own;
    for (int64_t k = 0; k < own; k++) store8(g->matrix, AT8(k), gather8(s->diagonal, g->unknown, AT8(k)));
    for (int64_t e = 0; e < g->shape->entries; e++)
        store8(g->matrix, AT8(own + e), gather8(b->given, g->source, AT8(e)));
}

/* The unknowns of an entry of a group: as planned, or as given. */
typedef struct {
    const int64_t *start;
    const int32_t *row, *one, *other;
} batch_entries;

static batch_entries batch_entries_of(const batch_shape *s) {
    if (s->plan) return (batch_entries){s->plan->entry_start, s->plan->entry_row, NULL, NULL};
    return (batch_entries){NULL, NULL, s->one, s->other};
}

/* Largest entry of each row of S K S, of a group that is loaded as it is given, not planned yet. */
static void batch_most_given(batch_state *s, const batch_group *g) {
    const batch_shape *shape = g->shape;
    const double *scale = s->scale + g->at;
    double *most = s->most + g->at;
    for (int64_t k = 0; k < shape->own + shape->ends; k++) {
        vec8 own = load8(scale, AT8(k));
        store8(most, AT8(k), k < shape->own ? abs8(mul8(load8(g->matrix, AT8(k)), mul8(own, own))) : splat8(0.0));
    }
    const batch_entries entries = batch_entries_of(shape);
    for (int64_t e = 0, k = 0; e < shape->entries; e++) {
        if (entries.start)
            while (entries.start[k + 1] <= e) k++;
        int64_t i = AT8(entries.start ? k : entries.one[e]), j = AT8(entries.start ? entries.row[e] : entries.other[e]);
        vec8 value = abs8(mul8(load8(g->matrix, AT8(shape->own + e)), mul8(load8(scale, i), load8(scale, j))));
        store8(most, i, max8(value, load8(most, i)));
        store8(most, j, max8(value, load8(most, j)));
    }
}

/* The largest of the ends' rows, to the rest. */
static void batch_raise_ends(const batch_group *g, const double *most, double *rest) {
    const double *own = most + g->at + AT8(g->shape->own);
    for (int32_t k = 0; k < g->shape->ends; k++)
        for (int lane = 0; lane < g->segments; lane++) batch_raise(rest + g->end[AT8(k) + lane], own[AT8(k) + lane]);
}

/* Largest entry of each row of S K S in the rest. */
static void batch_most_of_rest(const batch *b, batch_state *s) {
    double *most = s->most + s->outer;
    const double *scale = s->scale + s->outer;
    for (int64_t k = 0; k < b->rest; k++) most[k] = fabs(s->diagonal[b->rest_unknown[k]]) * scale[k] * scale[k];
    for (int64_t e = 0; e < b->rest_entries; e++) {
        int32_t i = b->rest_first[e], j = b->rest_second[e];
        double value = fabs(b->given[b->rest_source[e]]) * scale[i] * scale[j];
        batch_raise(most + i, value);
        batch_raise(most + j, value);
    }
}

/* The scale of the rest, to the places of the ends. */
static void batch_spread_scale(batch_state *s, int64_t groups) {
    for (int64_t k = 0; k < groups; k++) batch_take_ends(s->groups + k, s->scale + s->outer, s->scale);
}

/* Scale rows and columns alike until the largest entries of all rows are near 1 (Ruiz 2001). */
static void batch_equilibrate(const batch *b, batch_state *s) {
    for (int64_t k = 0; k < s->length; k++) s->scale[k] = 1.0;
    for (int64_t k = 0; k < b->groups; k++) batch_load_raw(b, s, s->groups + k);
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        batch_most_of_rest(b, s);
        for (int64_t k = 0; k < b->groups; k++) {
            batch_most_given(s, s->groups + k);
            batch_raise_ends(s->groups + k, s->most, s->most + s->outer);
        }
        for (int64_t k = 0; k < b->groups; k++) batch_take_ends(s->groups + k, s->most + s->outer, s->most);
        double low = LARGEST_SCALE, high = 0.0;
        for (int64_t k = 0; k < s->outer + b->rest; k++) {
            double value = s->most[k];
            high = value > high ? value : high;
            value = value > 0.0 ? value : 1.0;
            low = value < low ? value : low;
        }
        if (high < GOOD && low * GOOD > 1.0) break;
        for (int64_t k = 0; k < s->outer + b->rest; k++) s->scale[k] = rescaled(s->scale[k], s->most[k]);
        if (high < GOOD * GOOD * low) break;
    }
    s->fresh = 0;
}

static double batch_distance(double most) {
    double value = most > 0.0 ? most : 1.0;
    return value > 1.0 ? value : 1.0 / value;
}

/* Load a group, scaled: how far from 1 the largest entries of its rows are. */
static void batch_load(const batch *b, batch_state *s, batch_work *w, batch_group *g) {
    const batch_shape *shape = g->shape;
    const plan *p = shape->plan;
    int64_t own = shape->own, e = 0;
    const double *scale = s->scale + g->at;
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
        for (int64_t end = p->entry_start[k + 1]; e < end; e++) {
            int64_t row = AT8(p->entry_row[e]);
            vec8 value = mul8(gather8(b->given, g->source, AT8(e)), mul8(factor, load8(scale, row)));
            vec8 size = abs8(value);
            store8(matrix, AT8(own + e), value);
            store8(most, row, max8(size, load8(most, row)));
            largest = max8(size, largest);
            check = add8(check, scaled8(0.0, value));
        }
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
    batch_raise(&w->spread, spread);
    w->check += sum8(check);
    batch_raise_ends(g, s->most, w->most);
}

/* Load the rest, scaled, into rest_given. */
static double batch_load_rest(const batch *b, batch_state *s) {
    const double *scale = s->scale + s->outer;
    double *most = s->most + s->outer, *own = s->rest_matrix + b->rest, check = 0.0;
    for (int64_t k = 0; k < b->rest_filled; k++) b->rest_given[k] = 0.0;
    for (int64_t k = 0; k < b->rest; k++) {
        double value = s->diagonal[b->rest_unknown[k]] * scale[k] * scale[k];
        s->rest_matrix[k] = value;
        most[k] = fabs(value);
        check += value * 0.0;
        b->rest_given[b->rest_filled + k] = k < b->rest_variables ? value : -value;
    }
    for (int64_t e = 0; e < b->rest_entries; e++) {
        int32_t i = b->rest_first[e], j = b->rest_second[e];
        double value = b->given[b->rest_source[e]] * scale[i] * scale[j];
        check += value * 0.0;
        own[e] = value;
        batch_raise(most + i, fabs(value));
        batch_raise(most + j, fabs(value));
        b->rest_given[b->rest_target[e]] = value;
    }
    return check;
}

/* --- Plans. */

/* The least magnitude that each entry has in any segment, scaled. */
static void batch_magnitudes(const batch *b, const batch_state *s, const batch_shape *shape, double *magnitude) {
    for (int64_t e = 0; e < shape->entries; e++) magnitude[e] = INFINITY;
    for (int64_t k = 0; k < b->groups; k++) {
        const batch_group *g = s->groups + k;
        if (g->shape != shape) continue;
        const double *scale = s->scale + g->at;
        for (int64_t e = 0; e < shape->entries; e++) {
            vec8 factor = mul8(load8(scale, AT8(shape->one[e])), load8(scale, AT8(shape->other[e])));
            double size = smallest8(abs8(mul8(load8(g->matrix, AT8(shape->own + e)), factor)));
            if (size < magnitude[e]) magnitude[e] = size;
        }
    }
}

static int batch_plan_shape(const batch *b, const batch_state *s, batch_shape *shape) {
    graph g = {0};
    double *magnitude = batch_array(shape->entries, sizeof(double));
    if (magnitude && !graph_new(&g, shape->own + shape->ends, shape->entries, shape->one, shape->other)) {
        batch_magnitudes(b, s, shape, magnitude);
        shape->plan = plan_new(&g, shape->entries, shape->one, shape->other, magnitude, shape->variables, shape->stage,
                               shape->weak, BATCH_SHARED);
    }
    free(g.start); free(g.index); free(g.entry); free(magnitude);
    const plan *p = shape->plan;
    if (!p) return -1;
    shape->depth = batch_array(p->fronts, sizeof(int32_t));
    shape->inner = batch_array(p->fronts, sizeof(int32_t));
    if (!shape->depth || !shape->inner) return -1;
    for (int32_t f = p->fronts - 1; f >= 0; f--) {
        shape->depth[f] = p->parent[f] < 0 ? 0 : shape->depth[p->parent[f]] + 1;
        for (int64_t k = p->row_start[f]; k < p->row_start[f + 1]; k++) shape->inner[f] += p->rows[k] < shape->own;
    }
    return 0;
}

/* Bring the tables and the scale of a group to the order of elimination. */
static void batch_order_group(batch_state *s, batch_group *g) {
    const batch_shape *shape = g->shape;
    const plan *p = shape->plan;
    double *scale = s->scale + g->at, *kept = s->vector[0];
    memcpy(kept, scale, sizeof(double) * (size_t)AT8(shape->own));
    for (int64_t k = 0; k < shape->own; k++) {
        store8(scale, AT8(k), load8(kept, AT8(p->order[k])));
        for (int lane = 0; lane < 8; lane++) g->unknown[AT8(k) + lane] = g->given_unknown[AT8(p->order[k]) + lane];
    }
    for (int64_t e = 0; e < shape->entries; e++)
        for (int lane = 0; lane < 8; lane++) g->source[AT8(e) + lane] = g->given_source[AT8(p->entry[e]) + lane];
}

/* Back to the tables as they are given. */
static void batch_forget_plan(const batch *b, batch_state *s) {
    for (int64_t k = 0; k < b->shapes; k++) {
        batch_shape *shape = s->shapes + k;
        plan_free(shape->plan);
        free(shape->depth);
        free(shape->inner);
        shape->plan = NULL;
        shape->depth = shape->inner = NULL;
        if (s->planned == LEARNING) memset(shape->weak, 1, (size_t)(shape->own + shape->ends));
    }
    for (int64_t k = 0; k < b->groups; k++) {
        batch_group *g = s->groups + k;
        memcpy(g->unknown, g->given_unknown, 8 * sizeof(int32_t) * (size_t)g->shape->own);
        memcpy(g->source, g->given_source, 8 * sizeof(int32_t) * (size_t)g->shape->entries);
    }
    for (int64_t k = 0; k < b->parts; k++) {
        free(s->parts[k].waiting);
        s->parts[k].waiting = NULL;
    }
    s->fresh = 1;
    s->replan = 0;
}

static int batch_plan(const batch *b, batch_state *s) {
    int64_t fronts = 1;
    for (int64_t k = 0; k < b->shapes; k++) {
        if (batch_plan_shape(b, s, s->shapes + k)) return -1;
        fronts = imax(fronts, s->shapes[k].plan->fronts);
    }
    for (int64_t k = 0; k < b->groups; k++) batch_order_group(s, s->groups + k);
    for (int64_t k = 0; k < b->parts; k++)
        if (!(s->parts[k].waiting = batch_array(fronts, sizeof(batch_left)))) return -1;
    s->planned++;
    s->wasted = 0.0;
    return 0;
}

/* Whether the next matrix is to be planned for anew (see WASTED, SOON and LEARNING). */
static void batch_judge_plan(const batch *b, batch_state *s, int first) {
    double wasted = 0.0, work = 1.0;
    for (int64_t k = 0; k < b->parts; k++) {
        wasted += s->parts[k].wasted;
        work += s->parts[k].work;
    }
    s->wasted += wasted / work;
    if (first && s->planned <= LEARNING) s->replan = s->wasted > SOON;
    else if (s->wasted > ldexp(WASTED, s->planned < 30 ? (int)s->planned : 30)) s->replan = 1;
}

/* --- Factorisation. */

static void batch_eliminate_part(const batch *b, batch_state *s, batch_work *w, int first) {
    w->panel_count = w->row_count = w->factor_count = 0;
    w->refused = w->no_memory = w->negative = w->operations = w->delayed = 0;
    w->check = w->wasted = w->work = 0.0;
    w->spread = 1.0;
    w->largest = 0.0;
    w->smallest = INFINITY;
    for (int64_t k = 0; k < b->rest; k++) w->most[k] = 0.0;
    if (!first)
        for (int64_t k = 0; k < b->rest_length; k++) w->result[k] = 0.0;
    for (int32_t k = w->first; k < w->end; k++) {
        batch_load(b, s, w, s->groups + k);
        int serves = !s->watched || w->spread <= BATCH_STALE;
        if (serves && !w->refused && !w->no_memory) batch_eliminate_group(b, w, s->groups + k);
    }
}

void batch_part(batch *b, int64_t part, int64_t phase) {
    batch_state *s = BATCH_STATE(b);
    batch_work *w = s->parts + part;
    if (phase == BATCH_ELIMINATE) batch_eliminate_part(b, s, w, part == 0);
    else if (phase == BATCH_FORWARD) batch_forward(b, w);
    else if (phase == BATCH_BACKWARD) batch_backward(b, w);
    else batch_return(b, w);
}

/* Eliminate all groups: 0, or why not; `spread`: how far from 1 the largest entries of rows are. */
static int64_t batch_eliminate_all(batch *b, batch_state *s, double *spread) {
    double check = batch_load_rest(b, s), *most = s->most + s->outer;
    invoke(b->calls, BATCH_ELIMINATE);
    int refused = 0, no_memory = 0;
    *spread = 1.0;
    for (int64_t k = 0; k < b->parts; k++) {
        const batch_work *w = s->parts + k;
        check += w->check;
        refused |= w->refused != 0;
        no_memory |= w->no_memory != 0;
        batch_raise(spread, w->spread);
        for (int64_t i = 0; i < b->rest; i++) batch_raise(most + i, w->most[i]);
    }
    for (int64_t i = 0; i < b->rest; i++) batch_raise(spread, batch_distance(most[i]));
    if (check != 0.0) return BATCH_NOT_FINITE;
    return no_memory ? BATCH_NO_MEMORY : refused ? BATCH_REFUSED : 0;
}

static void batch_solve_for(batch *b, int both, int probing, int64_t refinements);

/* Whether the factors may be trusted, which is tried where they are suspect. */
static int batch_are_accurate(batch *b, batch_state *s) {
    double suspect = 0.0;
    for (int64_t k = 0; k < b->parts; k++) {
        batch_raise(&suspect, BATCH_SUSPECT / s->parts[k].smallest);
        batch_raise(&suspect, s->parts[k].largest / BATCH_GROWTH);
    }
    if (suspect <= s->trusted) return 1;
    double kept[3] = {b->report[0], b->report[1], b->report[2]};
    batch_solve_for(b, 0, 1, 0);
    double residual = b->report[0], growth = b->report[2];
    memcpy(b->report, kept, sizeof kept);
    if (residual < BATCH_EASILY * BATCH_INACCURATE && growth < BATCH_EASILY * BATCH_SINGULAR)
        s->trusted = BATCH_MORE * suspect;
    return residual < BATCH_INACCURATE && growth < BATCH_SINGULAR;
}

static int64_t batch_factorize_all(batch *b, batch_state *s) {
    double spread = 1.0;
    int first = !s->planned || s->replan;
    batch_collect_diagonal(b, s);
    s->watched = !s->fresh && !s->replan;
    if (s->replan) batch_forget_plan(b, s);
    if (s->fresh) {
        if (!batch_is_finite(b, s)) return BATCH_NOT_FINITE;
        batch_equilibrate(b, s);
        if (first && batch_plan(b, s)) return BATCH_NO_MEMORY;
        batch_spread_scale(s, b->groups);
        int64_t ended = batch_eliminate_all(b, s, &spread);
        batch_judge_plan(b, s, first);
        if (ended) return ended;
    } else {
        int64_t ended = batch_eliminate_all(b, s, &spread);
        if (ended == BATCH_NOT_FINITE || ended == BATCH_NO_MEMORY) return ended;
        if (!(spread <= BATCH_STALE)) {
            s->watched = 0;
            batch_equilibrate(b, s);
            batch_spread_scale(s, b->groups);
            ended = batch_eliminate_all(b, s, &spread);
        }
        batch_judge_plan(b, s, 0);
        if (ended) return ended;
    }
    for (int64_t k = 1; k < b->parts; k++)
        for (int64_t i = 0; i < b->rest_length; i++) b->rest_given[i] += s->parts[k].result[i];
    int64_t ended = invoke(b->calls, BATCH_REST);
    if (ended == BATCH_NO_MEMORY) return ended;
    if (ended || b->rest_inertia[2]) return BATCH_REFUSED;
    return batch_are_accurate(b, s) ? 0 : BATCH_REFUSED;
}

int64_t batch_factorize(batch *b) {
    batch_state *s = BATCH_STATE(b);
    if (s->wait > 0) {
        s->wait--;
        return BATCH_REFUSED;
    }
    int64_t ended = batch_factorize_all(b, s);
    if (ended == BATCH_NOT_FINITE) s->fresh = 1;
    if (ended == BATCH_REFUSED) {
        s->pause = imin(2 * s->pause + 1, BATCH_LONGEST_PAUSE);
        s->wait = s->pause - 1;
    }
    if (ended) return ended;
    s->pause = 0;
    int64_t negative = b->rest_inertia[1], own = 0, added = (b->size - b->n - b->m) / 2;
    b->entries = b->operations = b->delayed = 0;
    for (int64_t k = 0; k < b->parts; k++) {
        const batch_work *w = s->parts + k;
        negative += w->negative;
        b->entries += 8 * w->factor_count;
        b->operations += w->operations;
        b->delayed += w->delayed;
    }
    s->distance = 8 * b->entries > BATCH_DISTANT ? BATCH_AHEAD : 0;
    for (int64_t k = 0; k < b->groups; k++) own += s->groups[k].shape->own * (int64_t)s->groups[k].segments;
    b->inertia[0] = own + b->rest - negative - added;
    b->inertia[1] = negative - added;
    b->inertia[2] = 0;
    b->accuracy[0] = b->fine;
    b->use = 0;
    b->factorizations++;
    return 0;
}

/* --- Solves. */

/* left = b - K x of the rest, but for what the groups have in it. */
static void batch_residual_rest(const batch *b, const batch_state *s, const unknowns *u) {
    const double *x = u->x + s->outer, *right = u->b + s->outer, *own = s->rest_matrix + b->rest;
    double *left = u->left + s->outer;
    for (int64_t k = 0; k < b->rest; k++) left[k] = right[k] - s->rest_matrix[k] * x[k];
    for (int64_t e = 0; e < b->rest_entries; e++) {
        int32_t i = b->rest_first[e], j = b->rest_second[e];
        left[i] -= own[e] * x[j];
        left[j] -= own[e] * x[i];
    }
}

static double batch_norm(const double *x, int64_t count) {
    double most = 0.0;
    for (int64_t k = 0; k < count; k++) batch_raise(&most, fabs(x[k]) + x[k] * 0.0);
    return most;
}

/* Whether to refine once more, after a change; it is taken back where that made it worse. */
static void batch_improve(const batch *b, batch_state *s, int which, int64_t refinements) {
    unknowns *u = s->unknowns + which;
    double highest = batch_norm(u->x + s->outer, b->rest), remaining = batch_norm(u->left + s->outer, b->rest);
    for (int64_t k = 0; k < b->parts; k++) {
        batch_raise(&highest, s->parts[k].highest[which]);
        batch_raise(&remaining, s->parts[k].remaining[which]);
    }
    if (which == 0 && s->steps == 0) b->report[2] = highest / u->length;
    if (worsened(u, highest, remaining, b->accuracy[0], s->steps, refinements))
        for (int64_t k = 0; k < s->length; k++) u->x[k] -= u->change[k];
}

static void batch_solve_for(batch *b, int both, int probing, int64_t refinements) {
    batch_state *s = BATCH_STATE(b);
    const double *rhs[2] = {probing ? b->probe : b->rhs, b->second_rhs};
    double *result[2] = {probing ? b->probed : b->solution, b->second_solution};
    double *rest_rhs[2] = {b->rest_rhs, b->rest_second_rhs};
    const double *rest_x[2] = {b->rest_solution, b->rest_second_solution};
    s->both = both;
    s->steps = 0;
    s->probing = probing;
    b->report[2] = 0.0;
    for (int which = 0; which <= both; which++) {
        unknowns *u = s->unknowns + which;
        *u = (unknowns){s->vector[4 * which], s->vector[4 * which + 1], s->vector[4 * which + 2], s->vector[4 * which + 3],
                              0.0, 0.0, 1};
        for (int64_t k = 0; k < b->rest; k++)
            u->b[s->outer + k] = u->x[s->outer + k] = rhs[which][b->rest_unknown[k]] * s->scale[s->outer + k];
        u->length = batch_norm(u->b + s->outer, b->rest);
        for (int64_t k = 0; k < b->parts; k++) s->parts[k].length[which] = 0.0;
    }
    for (;; s->steps++) {
        invoke(b->calls, BATCH_FORWARD);
        for (int which = 0; which <= both; which++) {
            unknowns *u = s->unknowns + which;
            if (!s->steps) {
                for (int64_t k = 0; k < b->parts; k++) batch_raise(&u->length, s->parts[k].length[which]);
                u->active = !(u->length == 0.0);
                u->report = (double)u->active;
            }
            const double *own = batch_target(s, which) + s->outer;
            for (int64_t k = 0; k < b->rest; k++) rest_rhs[which][k] = own[k];
            for (int64_t part = 0; part < b->parts; part++)
                for (int64_t k = 0; k < b->rest; k++) rest_rhs[which][k] += s->parts[part].sum[which][k];
        }
        invoke(b->calls, BATCH_REST_SOLVE + both);
        for (int which = 0; which <= both; which++) {
            unknowns *u = s->unknowns + which;
            double *own = batch_target(s, which) + s->outer;
            for (int64_t k = 0; k < b->rest; k++) own[k] = rest_x[which][k];
            if (s->steps && u->active)
                for (int64_t k = 0; k < b->rest; k++) u->x[s->outer + k] += own[k];
            batch_residual_rest(b, s, u);
        }
        invoke(b->calls, BATCH_BACKWARD);
        int active = 0;
        for (int which = 0; which <= both; which++) {
            unknowns *u = s->unknowns + which;
            for (int64_t part = 0; part < b->parts; part++)
                for (int64_t k = 0; k < b->rest; k++) u->left[s->outer + k] += s->parts[part].sum[which][k];
            if (u->active) batch_improve(b, s, which, refinements);
            double *kept = u->change;
            u->change = u->left;
            u->left = kept;
            active |= u->active != 0;
        }
        if (!active) break;
    }
    invoke(b->calls, BATCH_RETURN);
    for (int which = 0; which <= both; which++)
        for (int64_t k = 0; k < b->rest; k++)
            result[which][b->rest_unknown[k]] = s->unknowns[which].x[s->outer + k] * s->scale[s->outer + k];
    double other = both ? s->unknowns[1].report : 0.0, report = s->unknowns[0].report;
    b->report[0] = report > other || report != report ? report : other;
    b->report[1] = (double)s->steps;
}

void batch_solve(batch *b) {
    if (b->use) invoke(b->calls, BATCH_WHOLE_SOLVE);
    else batch_solve_for(b, 0, 0, BATCH_REFINEMENTS);
}

void batch_solve_both(batch *b) {
    if (b->use) invoke(b->calls, BATCH_WHOLE_SOLVE + 1);
    else batch_solve_for(b, 1, 0, BATCH_REFINEMENTS);
}
