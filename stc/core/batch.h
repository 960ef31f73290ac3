/* Eight like segments of a horizon eliminated at once, group by group, and a rest, which is a system of its own (kkt.h).
 *
 *     [ A1      B1^T ]     A: a segment's own unknowns, eliminated here;  B: what they have in common with the rest
 *     [    A2   B2^T ]
 *     [ B1  B2   C   ]     C - B1 A1^-1 B1^T - B2 A2^-1 B2^T  is what the rest is to factorise
 *
 * The method is the multifrontal one of kkt.h; each number is a vector here, a lane for each segment of a group
 * (batch_front.h).  A pivot is taken where no factor becomes too large in any lane, so all lanes have the same order.
 * Groups with segments of the same length are planned together, by the smallest of their entries (plan.c).
 *
 * A matrix is refused where a segment has unknowns without a pivot, where the rest is singular, or where the factors turn
 * out to be inaccurate: whoever calls has another method for it.
 *
 * Vectors have the numbers of groups, eight for each unknown of a segment in the order of elimination and then for each of
 * its ends, those unknowns of the rest that it couples with; behind all groups the rest.
 */
#ifndef STC_BATCH_H
#define STC_BATCH_H

#include "kkt.h"
#include "native.h"

/* What the functions below return besides 0. */
enum {
    BATCH_REFUSED = 1,
    BATCH_NOT_FINITE = KKT_NOT_FINITE,
    BATCH_NO_MEMORY = KKT_NO_MEMORY,
};

/* Calls that are made by number: the phases of the parts, then the rest's, then those of the other method. */
enum {
    BATCH_ELIMINATE = 0,
    BATCH_FORWARD = 1,
    BATCH_BACKWARD = 2,
    BATCH_RETURN = 3,
    BATCH_REST = 4,
    BATCH_REST_SOLVE = 5,      /* and for two right-hand sides */
    BATCH_WHOLE_SOLVE = 7,     /* and for two right-hand sides */
    BATCH_CALLS = 9,
};

/* Lanes of arrays that a group has no segments for repeat its first one. */
typedef API_STRUCT {
    int64_t n, m, size;                 /* variables and rows; unknowns with those added in between */
    int64_t hess_count, given_count;    /* entries of H, and of H and J: p and d follow them */
    int64_t curved;                     /* entries on the diagonal of H */
    const int32_t *curved_variable, *curved_source; /* (curved,) */
    int64_t shapes, groups, parts;
    const int64_t *shape;               /* (shapes, 4): own unknowns, variables among them, ends, entries */
    const int32_t *one, *other;         /* unknowns of each entry: own variables, own rows, ends; shape after shape */
    const int32_t *stage;               /* of each unknown, -1 for ends; shape after shape */
    const int64_t *group;               /* (groups, 3): shape, segments, part */
    const int32_t *unknown;             /* (own, 8), group after group */
    const int32_t *source;              /* (entries, 8): where in given */
    const int32_t *end;                 /* (ends, 8): which of the rest */
    const int32_t *result;              /* (triangle of ends, 8): where in rest_given; -1 - place: with its sign changed */
    int64_t rest, rest_entries, rest_variables, rest_filled; /* unknowns, entries, ...; entries of its H */
    const int32_t *rest_unknown;        /* (rest,) */
    const int32_t *rest_first, *rest_second, *rest_source, *rest_target; /* (rest_entries,) */
    double *rest_given;                 /* entries of H, then p and d */
    int64_t rest_length;                /* of that */
    double *rest_rhs, *rest_solution, *rest_second_rhs, *rest_second_solution; /* (rest,) */
    const int64_t *rest_inertia;
    const double *given;
    const double *rhs, *second_rhs, *probe;    /* (size,) */
    double *solution, *second_solution, *probed; /* (size,) */
    double *report, *accuracy;          /* as in kkt.h */
    int64_t *inertia;
    const int64_t *calls;
    double fine;                        /* what accuracy[0] is set to by a factorisation */
    int64_t threads;                    /* unused where there is one part */
    int64_t factorizations, entries, operations, delayed; /* told of the last factorisation */
    int64_t use;                        /* 1 where the factors at hand are those of the other method */
    int64_t state;                      /* the memory of these functions */
} batch;

/* 0, or BATCH_NO_MEMORY. */
API int64_t batch_new(batch *b);
API void batch_free(batch *b);
/* Forget the scale of the last matrix, but not the plan. */
API void batch_restart(batch *b);
API int64_t batch_factorize(batch *b);
/* Numbers of memory held. */
API int64_t batch_held(const batch *b);
API void batch_solve(batch *b);
API void batch_solve_both(batch *b);
/* What is done for the groups of one part, while another thread may be at those of another one. */
API void batch_part(batch *b, int64_t part, int64_t phase);

#endif
