/* What a system consists of; for the files of this folder. */
#ifndef STC_SYSTEM_H
#define STC_SYSTEM_H

#include "kkt.h"
#include "order.h"

/* A scale is good when the largest entries of all rows are within this factor of 1; and sweeps to find one. */
#define GOOD 2.0
#define SWEEPS 12
#define SMALLEST_SCALE 1e-100
#define LARGEST_SCALE 1e100
/* Residuals are relative to the right-hand side plus the solution, or so many times the right-hand side. */
#define LARGEST_GAIN 1e6
/* A plan is made anew, from the values at hand, where delayed pivots have cost so many times the planned operations in
 * all, and twice as much each time: some matrices suit no plan. */
#define WASTED 4.0
/* The first two plans are made anew, knowing which unknowns have been delayed, where the first matrix has cost so many
 * times the planned operations beyond those; the third takes all for weak. */
#define SOON 0.1
#define LEARNING 2

/* A stretch of memory, aligned to lines of caches, that grows. */
typedef struct {
    double *at;
    int64_t room;
} arena;

/* The factors of a front: columns of L in `factors`, the unknowns of its rows in `index`, the eliminated ones first. */
typedef struct {
    int64_t factor_at, index_at;
    int32_t stride, size, eliminated;
    int32_t first; /* of the eliminated ones, among all pivots in order */
} factored;

/* What a front has left, waiting for its parent: a square, its lower triangle filled, by columns. */
typedef struct {
    int64_t at, index_at;
    int32_t stride, size, delayed, front;
    int32_t excess; /* pivots of the front and of all below it that are not positive, beyond the rows among them */
} contribution;

struct kkt {
    int32_t n, m, size;
    int64_t entries; /* off the diagonal */
    kkt_arrays arrays;
    kkt_options options;
    kkt_facts facts;
    int64_t hess_count, jac_count;
    int32_t *one, *other;   /* unknowns of each entry off the diagonal: of H, then of J */
    int32_t *source;        /* where its value is: in H, or behind it in J */
    int32_t *diagonal_source; /* of each unknown, or -1 */
    int32_t *stage;
    plan *plan;
    /* In the order of elimination: */
    int32_t *ordered_source, *ordered_diagonal;
    double *diagonal, *value; /* scaled */
    double *scale, *most;
    double *regular;  /* size of the last pivot of each unknown that was suspected to be zero, and was not, ... */
    double judged_by; /* ... by this value of options.certain */
    factored *fronts;
    arena factors, stack, panel, front;
    int32_t *index, *local;
    int64_t index_room;
    int32_t local_room;
    contribution *waiting;
    double *inverse;  /* D^-1: three numbers for each pivot */
    uint8_t *kind;    /* of each pivot: ONE, FIRST or SECOND of two */
    double *vector[6];
    double *work;     /* for the rows of the largest front, twice */
    int64_t work_room;
    int32_t factorized;
    int32_t fresh;    /* the plan is new and one of the first */
    uint8_t *weak;    /* unknowns that have been delayed, being no pivots in their fronts */
    double wasted, allowed; /* operations beyond those planned, and how many are worth another plan */
};

enum { KKT_GIVEN_UP = -1 };
enum { ONE = 1, FIRST = 2, SECOND = 3 };

/* What works on numbers (numeric.c): with a plan, values are loaded, then factorised, then solved with. */
/* With `needed`, only an inertia (n, m, 0) is of use: KKT_GIVEN_UP as soon as there is none. */
int64_t factorize_all(kkt *s, int needed);
void load_values(kkt *s, int *finite);
void solve_system(kkt *s, int both);

/* A row's factor of the scale, after a sweep that has found this largest entry in it. */
static inline double rescaled(double scale, double most) {
    double value = scale / sqrt(most > 0.0 ? most : 1.0);
    value = value < SMALLEST_SCALE ? SMALLEST_SCALE : value;
    return value > LARGEST_SCALE ? LARGEST_SCALE : value;
}

/* One right-hand side on its way to a solution, scaled: x, and its next change; what is left to solve for. */
typedef struct {
    double *b, *x, *change, *left;
    double length, report;
    int64_t active;
} unknowns;

/* Whether the last change has made things worse, and is to be taken back; from the largest magnitudes of the solution and of
 * what is left.  `active` from now on: whether there is to be another change. */
static inline int worsened(unknowns *u, double highest, double remaining, double accuracy, int64_t steps, int64_t most) {
    double gain = LARGEST_GAIN * u->length, now = remaining / (u->length + (highest < gain ? highest : gain));
    double before = u->report;
    u->active = 0;
    if (!(now < before) && steps > 0) return 1;
    u->report = now;
    u->active = now < before && !(now > 0.5 * before || now <= accuracy || steps >= most);
    return 0;
}

/* At least so much room; what is in it stays where `kept` numbers are asked for.  0, or -1. */
int arena_reserve(arena *a, int64_t room, int64_t kept);
void arena_free(arena *a);

#endif
