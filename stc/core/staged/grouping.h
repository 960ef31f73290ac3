/* Consecutive pivots of a stage's order that are eliminated together, in panels (see panel.h). */
#ifndef STC_GROUPING_H
#define STC_GROUPING_H

#include "../native.h"

/* Cut the order that order_stage has found into groups.
 *
 * top, count, order, kinds, starts, lists: its arguments and results.
 * before: the sizes as they were, (top * top,).
 * sizes: those that it left, to which entries are added that it may have missed.
 * cover: nonzero where the window may have an entry in whatever order the groups' pivots are taken, (top * top,);
 *     the same for what is left afterwards.
 * bits: work space, ((top + SETS) * words_of(top),); mark, found: (top,); work, best, cut: (count + 1,).
 * group: how many unknowns the group has that begins at a place of the order, 0 where none begins, (count,).
 * fixed: whether its rows do not all couple afterwards, so that the order inside matters, (count,).
 * group_starts: the rows of the group at place k are group_rows[group_starts[k]:group_starts[k + 1]],
 *     (count + 1,).
 * surplus_starts: other rows that it may have are
 *     group_rows[surplus_starts[k]:surplus_starts[k + 1]], (count + 1,).
 * group_rows: room for 2 * count * top.
 * Returns:
 *     The number of entries in group_rows. */
API int64_t grouping_group_stage(int64_t top, int64_t count, const int32_t *restrict order,
                                 const int32_t *restrict kinds, const int32_t *restrict starts,
                                 const int32_t *restrict lists, const double *restrict before,
                                 int64_t *restrict bits, double *restrict sizes, double *restrict cover,
                                 int32_t *restrict mark, int32_t *restrict found, double *restrict work,
                                 double *restrict best, int32_t *restrict cut_, int32_t *restrict group,
                                 int32_t *restrict fixed, int32_t *restrict group_starts,
                                 int32_t *restrict surplus_starts, int32_t *restrict group_rows);

#endif
