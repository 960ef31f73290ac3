/* Which pivots of a chain's stage make a panel, and panels written down as chain_panel reads them. */
#ifndef STC_CHAIN_PANEL_PLAN_H
#define STC_CHAIN_PANEL_PLAN_H

#include "../native.h"

/* The panels that _join has found, in the order of their elimination, and how many. */
API int64_t chain_panel_plan_collect_panels(int64_t size, int64_t units, const int32_t *restrict high,
                                            const int32_t *restrict members, const int32_t *restrict reach,
                                            const int32_t *restrict came, int32_t *restrict union_,
                                            int32_t *restrict tops, int32_t *restrict together,
                                            int32_t *restrict begin, int32_t *restrict rows);

/* Write panels down as chain_panel reads them.
 *
 * count, high, members, begin, rows: see Panels; kinds: of the pivots, from the highest row downwards.
 * blocks: work space, (stride / BLOCK + 1,).
 * lists, places: what PANELS_AT and PLACES_AT are for.
 * filled: becomes 1 for the blocks of the window that panels change, (size * stride / BLOCK,).
 * totals: become the numbers in lists, those of the factors, and additions and multiplications. */
API void chain_panel_plan_write_panels(int64_t count, int64_t size, int64_t stride, const int32_t *restrict high,
                                       const int32_t *restrict members, const int32_t *restrict begin,
                                       const int32_t *restrict rows, const int32_t *restrict kinds,
                                       int32_t *restrict blocks, int32_t *restrict lists, int32_t *restrict places,
                                       int32_t *restrict filled, int64_t *restrict totals);

/* The rows that each pivot couples with, (units * size,), and where the best panel that ends before each begins.
 *
 * high, members: of each pivot, (units,).
 * coupled: which rows couple, (size * size,); filled as pivots fill it.
 * union: work space, zero, (size,); cost, came: (units + 1,). */
API void chain_panel_plan_join(int64_t size, int64_t units, const int32_t *restrict high,
                               const int32_t *restrict members, int32_t *restrict coupled, int32_t *restrict union_,
                               int32_t *restrict reach, double *restrict cost, int32_t *restrict came);

#endif
