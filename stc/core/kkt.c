/* The life of a system, and its plan. */
#include "kkt.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "system.h"

/* Sweeps that scale the magnitudes a plan is made from. */
#define PLAN_SWEEPS 4
/* Stages of so many unknowns on average are wide, and sparse those that have fewer entries off the diagonal than this, for
 * each two unknowns of a stage: an order that ignores stages is tried, too, and taken where it has fewer operations. */
#define WIDE 60.0
#define SPARSE 0.1
#define ALIGNMENT 64

int arena_reserve(arena *a, int64_t room, int64_t kept) {
    if (room <= a->room) return 0;
    room += room / 4 + 64;
    double *larger = NULL;
#if defined(_WIN32)
    larger = _aligned_malloc(sizeof(double) * (size_t)room, ALIGNMENT);
#else
    size_t bytes = (sizeof(double) * (size_t)room + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    larger = aligned_alloc(ALIGNMENT, bytes);
#endif
    if (!larger) return -1;
    if (kept > 0) memcpy(larger, a->at, sizeof(double) * (size_t)kept);
#if defined(_WIN32)
    _aligned_free(a->at);
#else
    free(a->at);
#endif
    a->at = larger;
    a->room = room;
    return 0;
}

void arena_free(arena *a) {
#if defined(_WIN32)
    _aligned_free(a->at);
#else
    free(a->at);
#endif
    a->at = NULL;
    a->room = 0;
}

/* --- Memory. */

static void forget_plan(kkt *s) {
    plan_free(s->plan);
    free(s->fronts);
    free(s->waiting);
    s->plan = NULL;
    s->fronts = NULL;
    s->waiting = NULL;
}

void kkt_free(kkt *s) {
    if (!s) return;
    forget_plan(s);
    free(s->one); free(s->other); free(s->source); free(s->diagonal_source); free(s->stage); free(s->ordered_source);
    free(s->ordered_diagonal); free(s->diagonal); free(s->value); free(s->scale); free(s->most); free(s->index);
    free(s->local); free(s->inverse); free(s->kind); free(s->work);
    free(s->weak); free(s->regular);
    for (int k = 0; k < 6; k++) free(s->vector[k]);
    arena_free(&s->factors);
    arena_free(&s->stack);
    arena_free(&s->panel);
    arena_free(&s->front);
    free(s);
}

static void *array(int64_t count, size_t size) { return calloc((size_t)count + 8, size); }

kkt *kkt_new(const kkt_pattern *pattern, const kkt_arrays *arrays) {
    kkt *s = calloc(1, sizeof *s);
    if (!s) return NULL;
    int64_t entries = 0;
    s->n = pattern->n;
    s->m = pattern->m;
    s->size = pattern->n + pattern->m;
    s->arrays = *arrays;
    s->hess_count = pattern->hess_count;
    s->jac_count = pattern->jac_count;
    s->options = (kkt_options){1e-4, 1e300, 1e-13, 10, 0, 4.0};
    for (int64_t e = 0; e < pattern->hess_count; e++) entries += pattern->hess_rows[e] != pattern->hess_cols[e];
    entries += pattern->jac_count;
    s->entries = entries;
    s->one = array(entries, sizeof(int32_t));
    s->other = array(entries, sizeof(int32_t));
    s->source = array(entries, sizeof(int32_t));
    s->ordered_source = array(entries, sizeof(int32_t));
    s->value = array(entries, sizeof(double));
    s->diagonal_source = array(s->size, sizeof(int32_t));
    s->ordered_diagonal = array(s->size, sizeof(int32_t));
    s->stage = array(s->size, sizeof(int32_t));
    s->diagonal = array(s->size, sizeof(double));
    s->scale = array(s->size, sizeof(double));
    s->most = array(s->size, sizeof(double));
    s->inverse = array(3 * (int64_t)s->size, sizeof(double));
    s->kind = array(s->size, 1);
    s->weak = array(s->size, 1);
    s->regular = array(s->size, sizeof(double));
    int failed = !s->one || !s->other || !s->source || !s->ordered_source || !s->value || !s->diagonal_source
                 || !s->ordered_diagonal || !s->stage || !s->diagonal || !s->scale || !s->most || !s->inverse || !s->kind
                 || !s->weak || !s->regular;
    for (int k = 0; k < 6; k++) failed |= !(s->vector[k] = array(s->size, sizeof(double)));
    if (failed) { kkt_free(s); return NULL; }
    memcpy(s->stage, pattern->stage, sizeof(int32_t) * (size_t)s->size);
    for (int32_t i = 0; i < s->size; i++) s->diagonal_source[i] = -1;
    int64_t put = 0;
    for (int64_t e = 0; e < pattern->hess_count; e++) {
        if (pattern->hess_rows[e] == pattern->hess_cols[e]) {
            s->diagonal_source[pattern->hess_rows[e]] = (int32_t)e;
            continue;
        }
        s->one[put] = pattern->hess_rows[e];
        s->other[put] = pattern->hess_cols[e];
        s->source[put++] = (int32_t)e;
    }
    for (int64_t e = 0; e < pattern->jac_count; e++) {
        s->one[put] = s->n + pattern->jac_rows[e];
        s->other[put] = pattern->jac_cols[e];
        s->source[put++] = (int32_t)(pattern->hess_count + e);
    }
    return s;
}

/* --- The plan. */

/* Magnitudes of the entries off the diagonal, of a matrix scaled so that each row's largest is near 1. */
static int magnitudes(const kkt *s, double *magnitude) {
    double *scale = array(s->size, sizeof(double)), *most = array(s->size, sizeof(double));
    if (!scale || !most) { free(scale); free(most); return -1; }
    for (int64_t e = 0; e < s->entries; e++) {
        int32_t from = s->source[e];
        magnitude[e] = fabs(from < s->hess_count ? s->arrays.hess[from] : s->arrays.jac[from - s->hess_count]);
    }
    for (int32_t i = 0; i < s->size; i++) scale[i] = 1.0;
    for (int sweep = 0; sweep <= PLAN_SWEEPS; sweep++) {
        for (int32_t i = 0; i < s->size; i++) {
            double own = s->diagonal_source[i] >= 0 ? s->arrays.hess[s->diagonal_source[i]] : 0.0;
            most[i] = fabs(own) * scale[i] * scale[i];
        }
        for (int64_t e = 0; e < s->entries; e++) {
            double value = magnitude[e] * scale[s->one[e]] * scale[s->other[e]];
            if (sweep == PLAN_SWEEPS) magnitude[e] = value;
            if (value > most[s->one[e]]) most[s->one[e]] = value;
            if (value > most[s->other[e]]) most[s->other[e]] = value;
        }
        for (int32_t i = 0; i < s->size; i++)
            if (most[i] > 0.0 && most[i] < INFINITY) scale[i] /= sqrt(most[i]);
    }
    free(scale);
    free(most);
    return 0;
}

/* Forget which small pivots have been found to be regular. */
static void suspect_all(kkt *s) {
    for (int32_t k = 0; k < s->size; k++) s->regular[k] = INFINITY;
    s->judged_by = s->options.certain;
}

static plan *cheapest_plan(const kkt *s, const graph *g, const double *magnitude) {
    plan *found = plan_new(g, s->entries, s->one, s->other, magnitude, s->n, s->stage, s->weak, 1), *other = NULL;
    int32_t stages = 1;
    for (int32_t i = 0; i < s->size; i++) stages = s->stage[i] >= stages ? s->stage[i] + 1 : stages;
    double width = (double)s->size / stages;
    if (!found || stages == 1 || width < WIDE || (double)s->entries >= SPARSE * width * s->size) return found;
    int32_t *none = array(s->size, sizeof(int32_t));
    if (none) other = plan_new(g, s->entries, s->one, s->other, magnitude, s->n, none, s->weak, 1);
    free(none);
    if (!other || other->operations >= found->operations) {
        plan_free(other);
        return found;
    }
    plan_free(found);
    return other;
}

static int make_plan(kkt *s) {
    graph g = {0};
    double *magnitude = array(s->entries, sizeof(double));
    forget_plan(s);
    if (magnitude && !graph_new(&g, s->size, s->entries, s->one, s->other) && !magnitudes(s, magnitude))
        s->plan = cheapest_plan(s, &g, magnitude);
    free(g.start); free(g.index); free(g.entry); free(magnitude);
    if (!s->plan) return -1;
    s->fronts = array(s->plan->fronts, sizeof(factored));
    s->waiting = array(s->plan->fronts, sizeof(contribution));
    if (!s->fronts || !s->waiting) { forget_plan(s); return -1; }
    for (int64_t e = 0; e < s->entries; e++) s->ordered_source[e] = s->source[s->plan->entry[e]];
    for (int32_t k = 0; k < s->size; k++) {
        s->ordered_diagonal[k] = s->diagonal_source[s->plan->order[k]];
        s->scale[k] = 1.0;
    }
    suspect_all(s);
    s->wasted = 0.0;
    s->allowed = WASTED * ldexp((double)s->plan->operations, s->facts.plans < 30 ? (int)s->facts.plans : 30);
    s->facts.plans++;
    s->fresh = s->facts.plans <= LEARNING;
    s->facts.planned = s->plan->entries;
    s->facts.fronts = s->plan->fronts;
    return 0;
}

/* --- What callers call. */

void kkt_restart(kkt *s) {
    for (int32_t k = 0; k < s->size; k++) s->scale[k] = 1.0;
    suspect_all(s);
    s->factorized = 0;
    s->wasted = 0.0; /* another plan would have later solves differ from each other in their last digits */
}

kkt_options *kkt_options_of(kkt *s) { return &s->options; }

const kkt_facts *kkt_facts_of(const kkt *s) { return &s->facts; }

static int is_finite(const kkt *s) {
    double check = 0.0;
    for (int64_t e = 0; e < s->hess_count; e++) check += s->arrays.hess[e] * 0.0;
    for (int64_t e = 0; e < s->jac_count; e++) check += s->arrays.jac[e] * 0.0;
    return check == 0.0;
}

static int64_t factorize(kkt *s, int needed) {
    int finite = 0;
    s->factorized = 0;
    if (!s->plan || s->options.replan || s->wasted > s->allowed) {
        if (!is_finite(s)) return KKT_NOT_FINITE;
        s->options.replan = 0;
        if (make_plan(s)) return KKT_NO_MEMORY;
    }
    if (s->options.certain != s->judged_by) suspect_all(s);
    load_values(s, &finite);
    if (!finite) return KKT_NOT_FINITE;
    s->facts.factorizations++;
    int64_t ended = factorize_all(s, needed);
    if (ended == KKT_NO_MEMORY || ended == KKT_GIVEN_UP) return ended;
    if (s->fresh && s->wasted > SOON * (double)s->plan->operations) {
        if (s->facts.plans == LEARNING) memset(s->weak, 1, (size_t)s->size);
        s->options.replan = 1;
    }
    s->fresh = 0;
    s->arrays.accuracy[0] = s->options.fine;
    s->factorized = 1;
    return ended;
}

int64_t kkt_refactor(kkt *const *system) { return factorize(*system, 0); }

int64_t kkt_attempt(kkt *const *system) {
    int64_t ended = factorize(*system, 1);
    return ended == KKT_SINGULAR || ended == KKT_GIVEN_UP ? KKT_OK : ended;
}

int64_t kkt_solve(kkt *const *system) {
    if (!(*system)->factorized) return -1;
    solve_system(*system, 0);
    return 0;
}

int64_t kkt_solve_both(kkt *const *system) {
    if (!(*system)->factorized) return -1;
    solve_system(*system, 1);
    return 0;
}
