/* LDL^T of a sparse symmetric matrix in a window that slides over the stages, with threshold pivoting. */
#ifndef STC_ELIMINATION_H
#define STC_ELIMINATION_H

#include "../native.h"

/* Factorise; the window must be zero and is left so when the result is 0.
 *
 * size, stages, variables: N, number of stages, how many of the N unknowns are variables of the problem.
 * threshold: u above.
 * tiny: columns no larger than this, times their growth, are zero pivots.
 * replacement: magnitude of what replaces them: plus for variables, minus for rows.
 * delay_limit: with more unknowns delayed than this, lower thresholds are accepted.
 * most_held: with more than this that even the lowest threshold refuses, the matrix is given up as singular.
 * capacity: room in indices and in factors.
 * stride: slots of the window.
 * held_from: first slot for delayed unknowns.
 * planned: whether the plan's patterns hold for this matrix.
 * stage_pointers: positions of each stage, (stages + 1,).
 * pointers, columns, values: the matrix (see values.h).
 * order: unknown at each position, (N,).
 * planned_slot: slot at each position, (N,).
 * targets: where the entries of values go in the window, (N + E,).
 * enter_pointers, entering: the positions that enter the window at each stage, (stages + 1,) and (N,).
 * inner_top, top: slots in use at each stage, without and with those of leaves, (stages,).
 * plan_kind: 1 or 2 where a planned pivot begins, 0 for the second of a pair, -1 without plan, (N,).
 * plan_group: how many unknowns are eliminated together from here on, 0 where no group begins, -1 for
 *     leaves, which are first in their stages, (N,).
 * plan_start, plan_count, plan_slots: the slots of a group's columns.
 * surplus_start, surplus_count: others that they may have when not all goes to plan.
 * state, state_starts, state_rows, state_columns: what may be in the window before each stage unplanned.
 * growth: work space (see pivots.h), (stride,).
 * slot: work space; afterwards -1 - stage with the stage at which a position was eliminated, (N,).
 * counts: results, (COUNTS,).
 * Returns:
 *     0, 1 when the factors are full, 2 when the window is full, 3 when the matrix was given up: all unknowns that are
 *     left count as zero pivots then, and nothing can be solved with the factors. */
API int64_t elimination_factorize(
    int64_t size, int64_t stages, int64_t variables, double threshold, double tiny, double replacement,
    int64_t delay_limit, int64_t most_held, int64_t capacity, int64_t stride, int64_t held_from, int64_t planned,
    const int32_t *restrict stage_pointers, const int32_t *restrict pointers, const int32_t *restrict columns,
    const double *restrict values, const int32_t *restrict order, const int32_t *restrict planned_slot,
    const int32_t *restrict targets, const int32_t *restrict enter_pointers, const int32_t *restrict entering,
    const int32_t *restrict inner_top, const int32_t *restrict top, const int32_t *restrict plan_kind,
    const int32_t *restrict plan_group, const int32_t *restrict plan_start, const int32_t *restrict plan_count,
    const int32_t *restrict surplus_start, const int32_t *restrict surplus_count,
    const int32_t *restrict plan_slots, const int32_t *restrict state, const int32_t *restrict state_starts,
    const int32_t *restrict state_rows, const int32_t *restrict state_columns, double *restrict window,
    double *restrict panel, double *restrict lower, double *restrict sums, const double *restrict masks,
    double *restrict spread_1, double *restrict spread_2, int32_t *restrict slot, int32_t *restrict owner,
    double *restrict growth, int32_t *restrict queue, int32_t *restrict found_1, int32_t *restrict found_2,
    int32_t *restrict found_12, double *restrict values_1, double *restrict values_2, double *restrict first_12,
    double *restrict second_12, int32_t *restrict pivots, int32_t *restrict starts, int32_t *restrict indices,
    double *restrict factors, double *restrict inverse, int64_t *restrict counts);

#endif
