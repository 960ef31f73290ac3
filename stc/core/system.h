/* What a system consists of; for the files of this folder. */
#ifndef STC_SYSTEM_H
#define STC_SYSTEM_H

#include "kkt.h"
#include "order.h"

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

/* At least so much room; what is in it stays where `kept` numbers are asked for.  0, or -1. */
int arena_reserve(arena *a, int64_t room, int64_t kept);
void arena_free(arena *a);

#endif
