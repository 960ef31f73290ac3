/* What the functions of batch.h keep. */
#ifndef STC_BATCH_STATE_H
#define STC_BATCH_STATE_H

#include "batch.h"
#include "system.h"
#include "vec8.h"

/* Groups of the same length. */
typedef struct {
    int32_t own, variables, ends, entries;
    const int32_t *one, *other, *stage;
    plan *plan;
    int32_t *depth; /* of each front, the roots' being 0 */
    int32_t *inner; /* how many of the rows of each front are no ends */
    uint8_t *weak;  /* unknowns that have been delayed, being no pivots in their fronts */
} batch_shape;

/* Pivots that were taken together: D^-1 begins at `factor_at`, a vector for each pivot of one and three for those of
 * two, then L: the rows of the pivots, each up to its pivot, and the columns of the other rows. */
typedef struct {
    int64_t factor_at, row_at;  /* positions: of the pivots, then of the rows */
    int32_t count, rows;
    uint32_t pairs;
} batch_panel;

typedef struct {
    batch_shape *shape;
    int32_t segments, part;
    int64_t at;             /* in vectors, of its first unknown */
    const int32_t *given_unknown, *given_source, *end, *result;
    int32_t *unknown;       /* (own, 8), in the order of elimination */
    int32_t *source;        /* (entries, 8), by columns in the order of elimination */
    double *matrix;         /* (own, 8) and (entries, 8): scaled, in that order */
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
    double *result;         /* like rest_given */
    double *sum[2];         /* of the rest, for either right-hand side */
    double *most;           /* of the rest's rows */
    int64_t refused, no_memory, negative, operations, delayed;
    double wasted, work;    /* operations, about: those that delayed pivots add, and those planned */
    double check, spread, largest, smallest, length[2], highest[2], remaining[2];
} batch_work;

typedef struct {
    batch_shape *shapes;
    batch_group *groups;
    batch_work *parts;
    double *diagonal;       /* of all unknowns, not scaled */
    double *scale, *most;
    double *vector[8];
    double *rest_matrix;    /* diagonal and entries, scaled */
    arena memory;
    int64_t outer, length;  /* of vectors: where the rest begins, and in all */
    int64_t vectors;        /* of all matrices */
    int64_t planned, replan, fresh, pause, wait; /* plans made; whether another is due; whether the scale is to be sought; matrices to be left out */
    double wasted;          /* operations beyond those planned, as a multiple of these, since the plan was made */
    int64_t watched;        /* whether groups that the scale does not serve are not to be eliminated */
    double trusted;         /* factors are not tried below so much growth */
    unknowns unknowns[2];
    int64_t both, steps, probing;
    int64_t distance;       /* how many numbers ahead factors are asked for, 0 where they are near */
} batch_state;

#define BATCH_STATE(b) ((batch_state *)(intptr_t)(b)->state)

/* See batch_tree.h and batch_solve.h. */
void batch_eliminate_group(const batch *b, batch_work *w, batch_group *g);
void batch_forward(const batch *b, batch_work *w);
void batch_backward(const batch *b, batch_work *w);
void batch_return(const batch *b, batch_work *w);

#endif
