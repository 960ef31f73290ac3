/* A factorisation of KKT systems: sparse, symmetric, indefinite; the inertia is counted.
 *
 *     K = [ H + diag(p)    J^T     ]     n variables
 *         [ J             -diag(d) ]     m rows
 *
 * Read this file first.  The life of a system:
 *
 *     kkt_new        takes the pattern, copies it, and allocates what does not depend on values
 *     kkt_refactor   scales K, plans the elimination the first time (plan.c), and factorises (multifrontal.h, front.h)
 *     kkt_attempt    the same, but given up as soon as the inertia cannot be (n, m, 0) any more
 *     kkt_solve      solves with iterative refinement (substitute.h); kkt_solve_both for two right-hand sides at once
 *     kkt_free
 *
 * The method is the multifrontal one (Duff & Reid 1983): S K S = P L D L^T P^T, with S from equilibration (Ruiz 2001),
 * P from a minimum-degree order of pairs (a row and the variable that it is matched with), and D of blocks of one and
 * two.  The graph is cut into fronts, dense matrices of some unknowns that are eliminated together and of those that
 * they leave entries to.  A pivot is taken only where no factor becomes larger than 1/u (threshold pivoting); unknowns of a
 * front for which there is none are delayed: they move to the front above, where more is known of them.
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

/* The sparsity: every entry of J and of the lower triangle of H once.  K may be what the elimination of other unknowns has
 * left: entries of H may then couple rows as well, numbered from n on, as if H were of size n + m. */
typedef struct {
    int32_t n, m;
    int64_t hess_count, jac_count;
    const int32_t *hess_rows, *hess_cols; /* (hess_count,) */
    const int32_t *jac_rows, *jac_cols;   /* (jac_count,) */
    const int32_t *stage; /* of each unknown, variables first, (n + m,): 0 and on, lower ones are eliminated first */
} kkt_pattern;

/* Arrays of the caller, which stay where they are as long as the system lives. */
typedef struct {
    const double *hess, *jac, *primal, *dual; /* values of H, J, p and d */
    const double *rhs, *second_rhs;           /* (n + m,) */
    double *solution, *second_solution;       /* (n + m,) */
    double *report;                           /* (3,): relative residual, refinements, growth of the solution */
    double *accuracy;                         /* (1,): the residual that refinement aims at */
    int64_t *inertia;                         /* (3,): positive, negative, zero */
} kkt_arrays;

/* What can be set at any time; it counts from the next factorisation on. */
typedef struct {
    double threshold;   /* u, between 0 and 0.5 */
    double certain;     /* small pivots so many times larger than the noise in them are no zeros; huge: all are */
    double fine;        /* what accuracy[0] is set to by a factorisation */
    int64_t refinements; /* steps at most; 0: the caller refines, and nothing is reported */
    int64_t replan;     /* 1: plan the elimination anew with the next matrix */
    double stale;       /* a scale serves as long as the largest entries of all rows are within this factor of 1 */
} kkt_options;

/* What is known of the last factorisation. */
typedef struct {
    int64_t factorizations; /* so many were made in all */
    int64_t plans;          /* so many times the elimination was planned */
    int64_t fronts;
    int64_t entries;        /* of L and D */
    int64_t planned;        /* entries of L and D where no pivot is delayed */
    int64_t operations;     /* multiplications with additions, of the elimination */
    int64_t delayed;        /* pivots that a front has left to the one above */
    int64_t pairs;          /* pivots of two */
    int64_t replaced;       /* pivots that were zero, and replaced */
} kkt_facts;

typedef struct kkt kkt;

/* NULL where there is no memory. */
API kkt *kkt_new(const kkt_pattern *pattern, const kkt_arrays *arrays);
API void kkt_free(kkt *system);
/* Forget the scale of the last matrix, but not the plan: the same matrices have the same factors again. */
API void kkt_restart(kkt *system);
API kkt_options *kkt_options_of(kkt *system);
API const kkt_facts *kkt_facts_of(const kkt *system);

/* These take the address of a pointer, so that a prepared call is one cell of memory. */
API int64_t kkt_refactor(kkt *const *system);

/* KKT_OK, unless a number is not finite or there is no memory.  An inertia that is not (n, m, 0) may be told before the
 * factorisation is complete: the array then holds one that is wrong in the same direction, and there is nothing to solve
 * with. */
API int64_t kkt_attempt(kkt *const *system);
API int64_t kkt_solve(kkt *const *system);
API int64_t kkt_solve_both(kkt *const *system);

#endif
