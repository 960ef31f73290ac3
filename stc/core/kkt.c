/* The life of a system, its plans, and the course of a factorisation. */
#include "kkt.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "system.h"

/* Stages of so many unknowns on average are wide, and sparse those that have fewer entries off the diagonal than this, for
 * each two unknowns of a stage: an order that ignores stages is tried, too, and taken where it has fewer operations. */
#define WIDE 60.0
#define SPARSE 0.1
#define ALIGNMENT 64
/* A plan is made anew, from the values at hand, where delayed pivots have cost so many times the planned operations in
 * all, and twice as much each time: some matrices suit no plan. */
#define WASTED 4.0
/* The first two plans are made anew, knowing which unknowns have been delayed, where the first matrix has cost so many
 * times the planned operations beyond those; the third takes all for weak. */
#define SOON 0.1
#define LEARNING 2
/* What eight matrices spend on a front as a whole counts for so little in uniting fronts: with 8, which they are, the
 * solves of four problems take as long in the geometric mean, cart-pole with 10,000 intervals a tenth longer. */
enum { BATCH_SHARED = 32 };
/* Factors of segments with smaller pivots or larger entries than these are tried on a right-hand side: the residual, before
 * refinement, should be no larger than INACCURATE, and the solution no longer than TOO_LONG times as much. */
#define SUSPICIOUS 1e-9
#define GROWTH 1e10
#define INACCURATE 1e-5
#define TOO_LONG 3e9
/* Where both are below this share of that, factors are not tried again until they are so many times as suspect. */
#define EASILY 1e-2
#define MORE 3.0
/* Factors of more bytes are out of a processor's own memory: so many numbers before their place is read it is asked for. */
#define DISTANT (1 << 22)
#define AHEAD 1200
/* Steps of refinement at most. */
#define REFINEMENTS 10
/* After a matrix that was refused, so many at most are left to the other system. */
#define LONGEST_PAUSE 15

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

static void forget_plans(kkt_state *s) {
    s->order = s->natural;
    s->start = s->k->start;
    s->row = s->k->row;
    s->source = s->k->source;
    plan_free(s->plan);
    free(s->fronts);
    free(s->waiting);
    s->plan = NULL;
    s->fronts = NULL;
    s->waiting = NULL;
    for (int64_t i = 0; i < s->k->shapes && s->shapes; i++) {
        batch_shape *shape = s->shapes + i;
        plan_free(shape->plan);
        free(shape->depth);
        free(shape->inner);
        shape->plan = NULL;
        shape->depth = shape->inner = NULL;
    }
    for (int64_t i = 0; i < s->k->parts && s->parts; i++) {
        free(s->parts[i].waiting);
        s->parts[i].waiting = NULL;
    }
}

void kkt_free(kkt *k) {
    kkt_state *s = KKT_STATE(k);
    if (!s) return;
    forget_plans(s);
    for (int64_t i = 0; i < k->shapes && s->shapes; i++) {
        free(s->shapes[i].start);
        free(s->shapes[i].weak);
    }
    for (int64_t i = 0; i < k->parts && s->parts; i++) {
        batch_work *w = s->parts + i;
        arena_free(&w->factors);
        arena_free(&w->fronts[0]);
        arena_free(&w->fronts[1]);
        arena_free(&w->panel);
        arena_free(&w->corner);
        free(w->panels); free(w->rows); free(w->index); free(w->place); free(w->fresh); free(w->row); free(w->offset);
        if (i) free(w->result);
        free(w->sum[0]); free(w->sum[1]); free(w->most);
    }
    if (s->left != s->matrix) free(s->left);
    free(s->shapes); free(s->groups); free(s->parts); free(s->diagonal); free(s->raw); free(s->matrix); free(s->weak); free(s->regular);
    free(s->natural); free(s->index); free(s->local); free(s->inverse); free(s->kind); free(s->work);
    arena_free(&s->memory);
    arena_free(&s->factors);
    arena_free(&s->stack);
    arena_free(&s->panel);
    arena_free(&s->front);
    free(s);
    k->state = 0;
    if (k->whole) kkt_free((kkt *)(intptr_t)k->whole);
}

static int new_shapes(kkt_state *s) {
    const kkt *k = s->k;
    const int32_t *column = k->shape_column, *row = k->shape_row, *stage = k->shape_stage;
    s->shapes = array_of(k->shapes, sizeof(batch_shape));
    if (!s->shapes) return -1;
    for (int64_t i = 0; i < k->shapes; i++) {
        const int64_t *given = k->shape + 4 * i;
        batch_shape *shape = s->shapes + i;
        *shape = (batch_shape){.own = (int32_t)given[0], .variables = (int32_t)given[1], .ends = (int32_t)given[2],
                               .entries = (int32_t)given[3], .column = column, .row = row, .stage = stage};
        shape->start = array_of(shape->own, sizeof(int32_t));
        shape->weak = array_of(shape->own + shape->ends, 1);
        if (!shape->start || !shape->weak) return -1;
        for (int32_t e = 0; e < shape->entries; e++) shape->start[column[e] + 1]++;
        for (int32_t j = 0; j < shape->own; j++) shape->start[j + 1] += shape->start[j];
        column += shape->entries;
        row += shape->entries;
        stage += shape->own + shape->ends;
    }
    return 0;
}

static int new_groups(kkt_state *s) {
    const kkt *k = s->k;
    const int32_t *unknown = k->group_unknown, *source = k->group_source, *end = k->group_end, *result = k->group_result;
    s->groups = array_of(k->groups, sizeof(batch_group));
    if (!s->groups) return -1;
    for (int64_t i = 0; i < k->groups; i++) {
        batch_shape *shape = s->shapes + k->group[3 * i];
        int64_t own = shape->own, ends = shape->ends;
        s->groups[i] = (batch_group){.shape = shape, .segments = (int32_t)k->group[3 * i + 1],
                                     .part = (int32_t)k->group[3 * i + 2], .at = s->outer, .unknown = unknown, .source = source,
                                     .end = end, .result = result};
        s->outer += 8 * (own + ends);
        s->vectors += own + shape->entries;
        unknown += 8 * own;
        source += 8 * (int64_t)shape->entries;
        end += 8 * ends;
        result += 4 * ends * (ends + 1);
    }
    return 0;
}

static int new_parts(kkt_state *s) {
    const kkt *k = s->k;
    s->parts = array_of(k->parts, sizeof(batch_work));
    if (!s->parts) return -1;
    for (int64_t i = 0; i < k->parts; i++) {
        batch_work *w = s->parts + i;
        w->first = w->end = -1;
        for (int32_t g = 0; g < k->groups; g++)
            if (s->groups[g].part == i) {
                if (w->first < 0) w->first = g;
                w->end = g + 1;
            }
        w->result = i ? array_of(s->size + s->filled, sizeof(double)) : s->left;
        w->sum[0] = array_of(s->size, sizeof(double));
        w->sum[1] = array_of(s->size, sizeof(double));
        w->most = array_of(s->size, sizeof(double));
        if (!w->result || !w->sum[0] || !w->sum[1] || !w->most) return -1;
    }
    return 0;
}

int64_t kkt_new(kkt *k) {
    kkt_state *s = array_of(1, sizeof *s);
    if (!s) return KKT_NO_MEMORY;
    k->state = (int64_t)(intptr_t)s;
    s->k = k;
    s->size = (int32_t)k->size;
    s->variables = (int32_t)k->variables;
    s->entries = k->entries;
    s->filled = k->filled;
    s->diagonal = array_of(k->total, sizeof(double));
    s->matrix = array_of(k->size + k->entries, sizeof(double));
    s->raw = array_of(k->size + k->entries, sizeof(double));
    s->left = k->groups ? array_of(k->size + k->filled, sizeof(double)) : s->matrix;
    s->weak = array_of(k->size, 1);
    s->regular = array_of(k->size, sizeof(double));
    s->natural = array_of(k->size, sizeof(int32_t));
    s->inverse = array_of(3 * k->size, sizeof(double));
    s->kind = array_of(k->size, 1);
    if (!s->diagonal || !s->raw || !s->matrix || !s->left || !s->weak || !s->regular || !s->natural || !s->inverse || !s->kind || new_shapes(s)
        || new_groups(s) || new_parts(s))
        goto failed;
    for (int32_t i = 0; i < s->size; i++) s->natural[i] = i;
    s->length = (s->outer + k->size + 7) & ~7;
    int64_t room = 10 * s->length + 8 * s->vectors;
    if (arena_reserve(&s->memory, room, 0)) goto failed;
    memset(s->memory.at, 0, sizeof(double) * (size_t)room);
    double *at = s->memory.at;
    s->scale = at;
    s->most = at += s->length;
    for (int i = 0; i < 8; i++) s->vector[i] = at += s->length;
    at += s->length;
    for (int64_t i = 0; i < k->groups; i++) {
        s->groups[i].matrix = at;
        at += 8 * (int64_t)(s->groups[i].shape->own + s->groups[i].shape->entries);
    }
    kkt_restart(k);
    return KKT_OK;
failed:
    kkt_free(k);
    return KKT_NO_MEMORY;
}

static kkt *whole_of(const kkt *k) { return (kkt *)(intptr_t)k->whole; }

void kkt_restart(kkt *k) {
    kkt_state *s = KKT_STATE(k);
    if (!s) return;
    s->fresh = 1;
    s->pause = s->wait = 0;
    s->trusted = 1.0;
    s->factorized = 0;
    s->wasted = 0.0; /* another plan would have later solves differ from each other in their last digits */
    for (int32_t i = 0; i < s->size; i++) s->regular[i] = INFINITY; /* no small pivot has been found to be regular */
    if (k->whole) kkt_restart(whole_of(k));
}

/* --- Plans. */

static int plan_shape(kkt_state *s, batch_shape *shape) {
    int32_t all = shape->own + shape->ends;
    double *magnitude = array_of(shape->entries, sizeof(double));
    if (!magnitude) return -1;
    magnitudes_of_shape(s, shape, magnitude);
    const plan *p = shape->plan = plan_new(all, shape->entries, shape->column, shape->row, magnitude, shape->variables, shape->stage,
                                           shape->weak, BATCH_SHARED);
    free(magnitude);
    if (!p) return -1;
    shape->depth = array_of(p->fronts, sizeof(int32_t));
    shape->inner = array_of(p->fronts, sizeof(int32_t));
    if (!shape->depth || !shape->inner) return -1;
    for (int32_t f = p->fronts - 1; f >= 0; f--) {
        shape->depth[f] = p->parent[f] < 0 ? 0 : shape->depth[p->parent[f]] + 1;
        for (int64_t i = p->row_start[f]; i < p->row_start[f + 1]; i++) shape->inner[f] += p->rows[i] < shape->own;
    }
    return 0;
}

static int plan_segments(kkt_state *s) {
    int32_t fronts = 1;
    for (int64_t i = 0; i < s->k->shapes; i++) {
        if (plan_shape(s, s->shapes + i)) return -1;
        if (s->shapes[i].plan->fronts > fronts) fronts = s->shapes[i].plan->fronts;
    }
    for (int64_t i = 0; i < s->k->parts; i++)
        if (!(s->parts[i].waiting = array_of(fronts, sizeof(batch_left)))) return -1;
    return 0;
}

static plan *plan_by(const kkt_state *s, const double *magnitude, const int32_t *stage) {
    return plan_new(s->size, s->filled, s->k->column, s->k->row, magnitude, s->variables, stage, s->weak, 1);
}

static int plan_rest(kkt_state *s) {
    double *magnitude = array_of(s->filled, sizeof(double)), width = 0.0;
    int32_t *none = array_of(s->size, sizeof(int32_t)), stages = 1;
    if (magnitude && none) {
        for (int64_t e = 0; e < s->filled; e++) magnitude[e] = fabs(s->left[s->size + e]);
        s->plan = plan_by(s, magnitude, s->k->stage);
        for (int32_t i = 0; i < s->size; i++) stages = s->k->stage[i] >= stages ? s->k->stage[i] + 1 : stages;
        width = (double)s->size / stages;
        if (s->plan && stages > 1 && width >= WIDE && (double)s->filled < SPARSE * width * s->size) {
            plan *other = plan_by(s, magnitude, none), *worse = other;
            if (other && other->operations < s->plan->operations) {
                worse = s->plan;
                s->plan = other;
            }
            plan_free(worse);
        }
    }
    free(magnitude);
    free(none);
    if (!s->plan) return -1;
    s->fronts = array_of(s->plan->fronts, sizeof(factored));
    s->waiting = array_of(s->plan->fronts, sizeof(contribution));
    if (!s->fronts || !s->waiting) return -1;
    if (!s->k->groups) { /* entries lie in the order of elimination from now on */
        for (int64_t e = 0; e < s->entries; e++) s->plan->entry[e] = s->source[s->plan->entry[e]];
        s->order = s->plan->order;
        s->start = s->plan->entry_start;
        s->row = s->plan->entry_row;
        s->source = s->plan->entry;
        load_rest(s);
    }
    for (int32_t i = 0; i < s->size; i++) s->regular[i] = INFINITY; /* no small pivot has been found to be regular */
    s->wasted = 0.0;
    s->young = ++s->k->plans <= LEARNING;
    s->k->fronts = s->plan->fronts;
    return 0;
}

/* Whether the next matrix is to be planned for anew. */
static void judge_plans(kkt_state *s) {
    double wasted = (double)s->wasted_here, work = (double)s->plan->operations;
    for (int64_t i = 0; i < s->k->parts; i++) {
        wasted += 4.0 * s->parts[i].wasted; /* eight matrices, of which half are looked at */
        work += 4.0 * s->parts[i].work;
    }
    s->wasted += wasted / (work > 1.0 ? work : 1.0);
    if (s->young && s->wasted > SOON) {
        if (s->k->plans == LEARNING) {
            memset(s->weak, 1, (size_t)s->size);
            for (int64_t i = 0; i < s->k->shapes; i++) memset(s->shapes[i].weak, 1, (size_t)(s->shapes[i].own + s->shapes[i].ends));
        }
        s->k->replan = 1;
    }
    s->young = 0;
    if (s->wasted > ldexp(WASTED, s->k->plans < 30 ? (int)s->k->plans - 1 : 30)) s->k->replan = 1;
}

/* --- Factorisation. */

/* Whether the factors of segments may be trusted, which is tried where they are suspect. */
static int are_accurate(kkt_state *s) {
    double suspect = 0.0;
    for (int64_t i = 0; i < s->k->parts; i++) {
        raise_to(&suspect, SUSPICIOUS / s->parts[i].smallest);
        raise_to(&suspect, s->parts[i].largest / GROWTH);
    }
    if (suspect <= s->trusted) return 1;
    solve_system(s, 1, 1, 0);
    double remaining = s->unknowns[0].report / INACCURATE, growth = s->unknowns[0].growth / TOO_LONG;
    if (remaining < EASILY && growth < EASILY) s->trusted = MORE * suspect;
    return remaining < 1.0 && growth < 1.0;
}

static int64_t factorize(kkt *k, int needed) {
    kkt_state *s = KKT_STATE(k);
    int first = !s->plan || k->replan;
    s->factorized = 0;
    if (first) forget_plans(s);
    if (collect(s)) return KKT_NOT_FINITE;
    if (first || s->fresh) {
        s->fresh = 1;
        if (equilibrate(s)) return KKT_NOT_FINITE;
        if (first && plan_segments(s)) return KKT_NO_MEMORY;
        k->replan = 0;
    }
    int64_t ended = load_and_eliminate(s);
    s->fresh = 0;
    if (ended > KKT_OK) return ended;
    if (first && plan_rest(s)) return KKT_NO_MEMORY;
    s->wasted_here = 0;
    if (ended == KKT_OK) ended = factorize_rest(s, needed);
    if (ended == KKT_NO_MEMORY) return ended;
    if (ended != KKT_GIVEN_UP) judge_plans(s);
    if (k->groups && (ended || !are_accurate(s))) return KKT_REFUSED;
    if (ended == KKT_GIVEN_UP) return ended;
    k->held = s->memory.room + 8 * s->vectors + s->factors.room + s->stack.room + s->front.room + 4 * (s->size + s->filled);
    int64_t added = (k->total - k->n - k->m) / 2, stored = 0;
    for (int64_t i = 0; i < k->parts; i++) {
        const batch_work *w = s->parts + i;
        k->inertia[1] += w->negative;
        stored += 8 * w->factor_count;
        k->operations += w->operations;
        k->delayed += w->delayed;
        k->held += w->factors.room + w->fronts[0].room + w->fronts[1].room + 2 * w->row_room;
    }
    if (k->groups) {
        k->inertia[1] -= added;
        k->inertia[0] = k->n + k->m - k->inertia[1];
    }
    s->distance = 8 * stored > DISTANT ? AHEAD : 0;
    k->nonzeros += stored;
    s->factorized = 1;
    return ended;
}

/* By the other system, without segments. */
static int64_t factorize_whole(kkt *k, int needed) {
    kkt *whole = whole_of(k);
    if (!whole->state && kkt_new(whole)) return KKT_NO_MEMORY;
    whole->threshold = k->threshold;
    int64_t ended = factorize(whole, needed);
    k->nonzeros = whole->nonzeros;
    k->operations = whole->operations;
    k->delayed = whole->delayed;
    return ended;
}

static int64_t factorize_either(kkt *k, int needed) {
    kkt_state *s = KKT_STATE(k);
    int64_t ended = KKT_REFUSED;
    if (!k->groups || (!k->careful && (s->wait == 0 || s->wait-- == 0))) {
        ended = factorize(k, k->groups ? 0 : needed);
        k->refused += ended == KKT_REFUSED;
        s->pause = ended != KKT_REFUSED ? 0 : imin(2 * s->pause + 1, LONGEST_PAUSE);
        s->wait = s->pause > 0 ? s->pause - 1 : 0;
    }
    k->segmented = k->groups && ended != KKT_REFUSED;
    if (ended == KKT_REFUSED) ended = factorize_whole(k, needed);
    k->factorizations += ended != KKT_NOT_FINITE && ended != KKT_NO_MEMORY;
    *k->accuracy = k->fine;
    return ended;
}

int64_t kkt_refactor(kkt *k) { return factorize_either(k, 0); }

int64_t kkt_attempt(kkt *k) {
    int64_t ended = factorize_either(k, 1);
    return ended == KKT_SINGULAR || ended == KKT_GIVEN_UP ? KKT_OK : ended;
}

static int64_t solve(kkt *k, int count) {
    kkt_state *s = KKT_STATE(k->groups && !k->segmented ? whole_of(k) : k);
    if (!s || !s->factorized) return -1;
    solve_system(s, count, 0, REFINEMENTS);
    return 0;
}

int64_t kkt_solve(kkt *k) { return solve(k, 1); }

int64_t kkt_solve_both(kkt *k) { return solve(k, 2); }
