/* What the state of a system consists of; for the files of this folder. */
#ifndef STC_SYSTEM_H
#define STC_SYSTEM_H

#include "kkt.h"
#include "order.h"
#include "vec8.h"

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

/* Groups of the same length. */
typedef struct {
    int32_t own, variables, ends, entries;
    const int32_t *column, *row, *stage;
    int32_t *start; /* of each own unknown's entries */
    plan *plan;
    int32_t *depth; /* of each front, the roots' being 0 */
    int32_t *inner; /* how many of the rows of each front are no ends */
    uint8_t *weak;  /* unknowns that have been delayed, being no pivots in their fronts */
} batch_shape;

/* Pivots that were taken together: D^-1 begins at `factor_at`, a vector for each pivot of one and three for those of
 * two, then L: the rows of the pivots, each up to its pivot, and the columns of the other rows. */
typedef struct {
    int64_t factor_at, row_at;  /* unknowns: of the pivots, then of the rows */
    int32_t count, rows;
    uint32_t pairs;
} batch_panel;

typedef struct {
    batch_shape *shape;
    int32_t segments, part;
    int64_t at;             /* in vectors, of its first unknown */
    const int32_t *unknown, *source, *end, *result;
    double *matrix;         /* (own, 8) and (entries, 8), scaled */
    int64_t first, panels;  /* of its part */
} batch_group;

/* What a front has left: it stays where the front was. */
typedef struct {
    int64_t at;
    int32_t stride, inner, from, summed, front, index_at;
} batch_left;

/* What is worked with at the groups of one thread. */
typedef struct {
    int32_t first, end;     /* groups */
    arena factors, fronts[2], panel, corner;
    batch_panel *panels;
    int32_t *rows;
    int32_t *index, *place, *fresh, *row;
    int64_t *offset;
    batch_left *waiting;
    int64_t panel_count, panel_room, row_count, row_room, factor_count, index_room;
    int32_t place_room;
    double *result;         /* for the rest's diagonal and entries */
    double *sum[2];         /* of the rest, for either right-hand side */
    double *most;           /* of the rest's rows */
    int64_t refused, no_memory, negative, operations, delayed;
    double wasted, work;    /* operations, about: those that delayed pivots add, and those planned */
    double check, spread, largest, smallest, length[2], highest[2], remaining[2];
} batch_work;

/* One right-hand side on its way to a solution, scaled: x, and its next change; what is left to solve for. */
typedef struct {
    double *b, *x, *change, *left;
    const double *rhs;
    double length, report, growth;
    int64_t active;
} unknowns;

/* Vectors have the numbers of groups, eight for each unknown of a segment and then for each of its ends, those unknowns of the
 * rest that it couples with; behind all groups, from `outer` on, the rest. */
typedef struct {
    kkt *k;
    int32_t size, variables;
    int64_t entries, filled; /* as in kkt.h */
    const int32_t *order, *start, *row, *source; /* columns one after the other, and their entries: as given, then as planned */
    int32_t *natural;
    int64_t outer, length;
    double *diagonal;        /* of all unknowns, not scaled */
    double *scale, *most;
    double *vector[8];
    double *raw, *matrix;    /* diagonal and entries of the rest; and scaled, */
    double *left;            /* and with what segments have left */
    int32_t fresh;           /* the scale is to be sought */
    int32_t young;           /* the plan is new and one of the first */
    double wasted;           /* operations beyond those planned, as a multiple of these, since the plan was made */
    unknowns unknowns[2], *solving[2];
    int32_t count, steps, probing;
    /* The rest. */
    plan *plan;
    uint8_t *weak;           /* unknowns that have been delayed, being no pivots in their fronts */
    double *regular;         /* size of the last pivot of each unknown that was suspected to be zero, and was not */
    factored *fronts;
    arena factors, stack, panel, front;
    int32_t *index, *local;
    int64_t index_room;
    int32_t local_room;
    contribution *waiting;
    double *inverse;         /* D^-1: three numbers for each pivot */
    uint8_t *kind;           /* of each pivot: ONE, FIRST or SECOND of two */
    double *work;            /* for the rows of the largest front, twice */
    int64_t work_room;
    int64_t wasted_here;     /* operations beyond those planned, of the last factorisation */
    int64_t factorized;
    /* Segments. */
    batch_shape *shapes;
    batch_group *groups;
    batch_work *parts;
    arena memory;
    int64_t vectors;         /* of all their matrices */
    int64_t pause, wait;     /* matrices to be left out */
    int64_t watched;         /* whether groups that the scale does not serve are not to be eliminated */
    double trusted;          /* factors are not tried below so much growth */
    int64_t distance;        /* how many numbers ahead factors are asked for, 0 where they are near */
} kkt_state;

#define KKT_STATE(k) ((kkt_state *)(intptr_t)(k)->state)

/* Besides what kkt.h declares: segments have unknowns without a pivot; the inertia cannot be (n, m, 0). */
enum { KKT_REFUSED = -1, KKT_GIVEN_UP = -2 };
enum { ONE = 1, FIRST = 2, SECOND = 3 };

/* What works on numbers (numeric.c). */
/* Collect the matrix's numbers, and find a scale for them; -1 where one is not finite. */
int collect(kkt_state *s);
int equilibrate(kkt_state *s);
/* Load the rest again, its entries being in another order, with the scale at hand. */
void load_rest(kkt_state *s);
/* Load the matrix, scaled anew where the last scale does not serve, and eliminate the segments. */
int64_t load_and_eliminate(kkt_state *s);
/* Factorise the rest.  With `needed`, only an inertia (n, m, 0) is of use: KKT_GIVEN_UP as soon as there is none. */
int64_t factorize_rest(kkt_state *s, int needed);
/* Solve for one right-hand side or two; `probing`: for one that tells singular matrices, without a result. */
void solve_system(kkt_state *s, int count, int probing, int refinements);
/* The least magnitude that each entry has in any segment, scaled. */
void magnitudes_of_shape(const kkt_state *s, const batch_shape *shape, double *magnitude);

static inline void *array_of(int64_t count, size_t size) { return calloc((size_t)count + 8, size); }

static inline void raise_to(double *to, double value) { *to = value > *to || value != value ? value : *to; }

/* At least so much room; what is in it stays where `kept` numbers are asked for.  0, or -1. */
int arena_reserve(arena *a, int64_t room, int64_t kept);
void arena_free(arena *a);

#endif
