/* The symbolic part: in which order unknowns are eliminated, and which fronts that makes. */
#ifndef STC_ORDER_H
#define STC_ORDER_H

#include <stdint.h>

/* Entries off the diagonal by unknown: neighbours of i are index[start[i]] to index[start[i + 1] - 1], and entry[...] is
 * the number of each one's entry. */
typedef struct {
    int32_t size;
    int64_t *start;  /* (size + 1,) */
    int32_t *index;  /* both directions */
    int32_t *entry;
} graph;

/* Fronts in an order in which children come before their parents, a parent right after its last child.  Positions are those in
 * the order of elimination. */
typedef struct {
    int32_t size, fronts;
    int32_t *order;     /* unknown at each position, (size,) */
    int32_t *position;  /* its inverse */
    int32_t *first;     /* first position of each front, (fronts + 1,) */
    int32_t *parent;    /* (fronts,), -1 for roots */
    int32_t *children;  /* how many each has */
    int64_t *row_start; /* (fronts + 1,) */
    int32_t *rows;      /* unknowns that a front leaves entries to, in the order of elimination */
    int32_t *local;     /* where each of them is in the parent: among its own and its rows */
    int32_t *entry_start; /* (size + 1,): entries below the diagonal by column */
    int32_t *entry_row;   /* the row, an unknown */
    int32_t *entry_local; /* its place within the front of its column */
    int32_t *entry;       /* number of the entry */
    int64_t entries, operations; /* of L and D, and of the elimination where no pivot is delayed */
} plan;

/* one, other: the unknowns of every entry, variables before rows; magnitude: of every entry, scaled; stage: negative for
 * unknowns that are not to be eliminated, and make the last front; weak: unknowns that are no pivots by themselves, as far
 * as is known; matrices: so many are eliminated at once.  NULL where there is no memory. */
plan *plan_new(int32_t size, int64_t entries, const int32_t *one, const int32_t *other, const double *magnitude,
               int32_t variables, const int32_t *stage, const uint8_t *weak, int32_t matrices);
void plan_free(plan *p);

/* mate[i]: the unknown that i is eliminated together with, or -1.  0, or -1 where there is no memory. */
int match_rows(const graph *couplings, const double *magnitude, int32_t variables, const uint8_t *left_out, const int32_t *stage,
               int32_t *mate);

/* Elements in the order of elimination. */
typedef struct {
    int32_t *element; /* of each node: which element eliminates it; elements are named by one of their nodes */
    int32_t *parent;  /* of each element, -1 for roots */
    int32_t *sequence; /* elements in order of elimination */
    int32_t count;
} degree_order;
/* Minimum degree of a graph of nodes of some weight (start, index as above), those of lower stages first. */
int minimum_degree(int32_t nodes, const int64_t *start, const int32_t *index, const int32_t *weight, const int32_t *stage,
                   int32_t stages, degree_order *out);

#endif
