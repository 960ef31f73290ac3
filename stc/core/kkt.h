/* A factorisation of KKT systems: sparse, symmetric, indefinite; the inertia is counted.
 *
 *     K = [ H + diag(p)    J^T     ]     n variables
 *         [ J             -diag(d) ]     m rows
 *
 * Read this file first.  The life of a system:
 *
 *     kkt_new        allocates what does not depend on values
 *     kkt_refactor   scales K (load.h), plans the elimination the first time (plan.c), and factorises
 *     kkt_attempt    the same, but given up as soon as the inertia cannot be (n, m, 0) any more
 *     kkt_solve      solves with iterative refinement (substitute.h); kkt_solve_both for two right-hand sides at once
 *     kkt_free
 *
 * The method is the multifrontal one (Duff & Reid 1983): S K S = P L D L^T P^T, with S from equilibration (Ruiz 2001),
 * P from a minimum-degree order of pairs (a row and the variable that it is matched with), and D of blocks of one and
 * two.  The graph is cut into fronts, dense matrices of some unknowns that are eliminated together and of those that
 * they leave entries to (multifrontal.h, front.h).  A pivot is taken only where no factor becomes larger than 1/u (threshold
 * pivoting); unknowns of a front for which there is none are delayed: they move to the front above, where more is known of them.
 *
 * Like segments of a horizon may be eliminated first, eight at a time, group by group:
 *
 *     [ A1      B1^T ]     A: a segment's own unknowns;  B: what they have in common with the rest
 *     [    A2   B2^T ]
 *     [ B1  B2   C   ]     C - B1 A1^-1 B1^T - B2 A2^-1 B2^T  is what is left to the tree of fronts, the rest
 *
 * The method is the same; each number is a vector there, a lane for each segment of a group (batch_tree.h, batch_front.h).
 * A pivot is taken where no factor becomes too large in any lane, so all lanes have the same order.  Groups with segments of
 * the same length, a shape, are planned together, by the smallest of their entries.  Where a segment has unknowns without a
 * pivot, the rest is singular, or the factors turn out to be inaccurate, another system, `whole`, takes the matrix without
 * segments.
 *
 * Numbers are doubles, indices 32 bits wide, counts of entries and operations 64.  Nothing here is global: systems are
 * independent of each other, and one system is used by one thread at a time.  Results do not depend on the processor
 * beyond the rounding of multiply-adds.
 */
#ifndef STC_KKT_H
#define STC_KKT_H

#include "native.h"

/* What the functions below return. */
enum {
    KKT_OK = 0,
    KKT_SINGULAR = 1,   /* factorised; some eigenvalues count as zero, and solutions are finite */
    KKT_NOT_FINITE = 2, /* an entry is not finite: nothing is factorised */
    KKT_NO_MEMORY = 3,
};

/* The relative residual that refinement ends at while rows are far off; near a solution, callers ask for less. */
#define COARSE 1e-10

/* What is done for the groups of one part, while another thread may be at those of another one: calls made by number. */
enum {
    KKT_ELIMINATE = 0,
    KKT_FORWARD = 1,
    KKT_BACKWARD = 2,
    KKT_RETURN = 3,
};

/* Unknowns that are not given, added where segments are cut apart (kkt/seams.py), are numbered behind the others; half of
 * them are variables, half rows.  Arrays are the caller's and stay where they are. */
typedef API_STRUCT {
    int64_t n, m, total;                /* variables and rows; unknowns with those added */
    int64_t given_count;                /* entries of H and J */
    int64_t curved;                     /* entries on the diagonal of H */
    const int32_t *curved_variable, *curved_source; /* (curved,) */
    /* The rest, or all. */
    int64_t size, variables;            /* unknowns, the first ones variables; others are rows, or added */
    int64_t entries, filled;            /* off the diagonal; and together with those that segments alone fill */
    const int32_t *column, *row;        /* (filled,): the unknowns of each entry, and first by column those given: */
    const int32_t *start;               /* (size + 1,) */
    const int32_t *source;              /* (entries,): where in given */
    const int32_t *unknown;             /* (size,): which of all */
    const int32_t *stage;               /* (size,): 0 and on, lower ones are eliminated first */
    /* Segments.  Lanes that a group has no segments for repeat its first one. */
    int64_t shapes, groups, parts;
    const int64_t *shape;               /* (shapes, 4): own unknowns, variables among them, ends, entries */
    const int32_t *shape_column, *shape_row; /* unknowns of each entry: own variables, own rows, ends; by column, shape after shape */
    const int32_t *shape_stage;         /* of each unknown, -1 for ends; shape after shape */
    const int64_t *group;               /* (groups, 3): shape, segments, part */
    const int32_t *group_unknown;       /* (own, 8): which of all, group after group */
    const int32_t *group_source;        /* (entries, 8): where in given */
    const int32_t *group_end;           /* (ends, 8): which of the rest */
    const int32_t *group_result;        /* (triangle of ends, 8): which of the rest's diagonal and then of its entries */
    const int64_t *calls;               /* kkt_part for all parts, by phase */
    int64_t whole;                      /* address of the system without segments, which is made when it is needed */
    /* Values. */
    const double *given;                /* H, J, p, d, and what else there are entries of */
    const double *rhs, *second_rhs;     /* (total,) */
    double *solution, *second_solution; /* (total,) */
    double *report;                     /* (1,): relative residual */
    double *accuracy;                   /* (1,): the residual that refinement aims at */
    int64_t *inertia;                   /* (3,): positive, negative, zero */
    /* What can be set at any time; it counts from the next factorisation on. */
    double threshold;                   /* u, between 0 and 0.5 */
    double fine;                        /* what accuracy[0] is set to by a factorisation */
    int64_t replan;                     /* 1: plan the elimination anew with the next matrix */
    int64_t careful;                    /* 1: without segments */
    /* What is known of the last factorisation. */
    int64_t factorizations;             /* so many were made in all */
    int64_t segmented, refused;         /* whether segments were eliminated first; how many matrices refused that */
    int64_t plans;                      /* so many times the elimination was planned */
    int64_t fronts;
    int64_t nonzeros;                   /* of L and D */
    int64_t operations;                 /* multiplications with additions, of the elimination */
    int64_t delayed;                    /* pivots that a front has left to the one above */
    int64_t held;                       /* numbers in memory, about */
    int64_t state;                      /* the memory of these functions */
} kkt;

/* KKT_OK or KKT_NO_MEMORY. */
API int64_t kkt_new(kkt *k);
API void kkt_free(kkt *k);
/* Forget the scale of the last matrix, but not the plan: the same matrices have the same factors again. */
API void kkt_restart(kkt *k);
API int64_t kkt_refactor(kkt *k);
/* KKT_OK, unless a number is not finite or there is no memory.  An inertia that is not (n, m, 0) may be told before the
 * factorisation is complete: the array then holds one that is wrong in the same direction, and there is nothing to solve
 * with. */
API int64_t kkt_attempt(kkt *k);
API int64_t kkt_solve(kkt *k);
API int64_t kkt_solve_both(kkt *k);
API void kkt_part(kkt *k, int64_t part, int64_t phase);

#endif
