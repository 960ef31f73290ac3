/* Which pivots of a chain's stage make a panel, and panels written down as chain_panel reads them. */
#include "../native.h"
#include "chain_elimination.h"
#include "chain_panel_plan.h"

/* Cycles that a panel takes, that it takes for each block of columns, and for each block of a row that it changes; by
 * members. */
#define PANEL_OF_1 40.0
#define PANEL_OF_4 85.0
#define PANEL_OF_2 55.0
#define COLUMNS_OF_1 6.0
#define COLUMNS_OF_4 20.0
#define COLUMNS_OF_2 10.0
#define BLOCK_OF_1 1.8
#define BLOCK_OF_4 3.2
#define BLOCK_OF_2 2.3
/* More than any number of cycles. */
#define CHAIN_PANEL_PLAN_FAR 1e+300

int64_t chain_panel_plan_collect_panels(int64_t size, int64_t units, const int32_t *restrict high,
                                        const int32_t *restrict members, const int32_t *restrict reach,
                                        const int32_t *restrict came, int32_t *restrict union_,
                                        int32_t *restrict tops, int32_t *restrict together, int32_t *restrict begin,
                                        int32_t *restrict rows) {
    int64_t count = 0;
    int64_t last = units;
    while (last > 0) {
        count++;
        last = came[last];
    }
    last = units;
    for (int64_t k = 0; k < count; k++) {
        tops[count - 1 - k] = came[last]; /* the first unit, for now */
        last = came[last];
    }
    int64_t listed = 0;
    for (int64_t k = 0; k < count; k++) {
        int64_t first = tops[k];
        int64_t end = k + 1 < count ? tops[k + 1] : units;
        int64_t total = 0;
        for (int64_t u = first; u < end; u++) {
            total += members[u];
            for (int64_t r = 0; r < size; r++) union_[r] = (int32_t)imax(union_[r], reach[u * size + r]);
        }
        begin[k] = (int32_t)listed;
        for (int64_t r = 0, end_r = high[first] - total + 1; r < end_r; r++) {
            if (union_[r] != 0) {
                rows[listed] = (int32_t)r;
                listed++;
            }
        }
        for (int64_t r = 0; r < size; r++) union_[r] = 0;
        tops[k] = high[first];
        together[k] = (int32_t)total;
    }
    begin[count] = (int32_t)listed;
    return count;
}

void chain_panel_plan_write_panels(int64_t count, int64_t size, int64_t stride, const int32_t *restrict high,
                                   const int32_t *restrict members, const int32_t *restrict begin,
                                   const int32_t *restrict rows, const int32_t *restrict kinds,
                                   int32_t *restrict blocks, int32_t *restrict lists, int32_t *restrict places,
                                   int32_t *restrict filled, int64_t *restrict totals) {
    int64_t at = 0;
    int64_t factors = 0;
    int64_t operations = 0;
    int64_t width = floor_div(stride, CHAIN_ELIMINATION_BLOCK);
    for (int64_t p = 0; p < count; p++) {
        int64_t top = high[p];
        int64_t own = members[p];
        int64_t down = begin[p + 1] - begin[p];
        const int32_t *below = rows + begin[p];
        places[2 * p] = (int32_t)at;
        places[2 * p + 1] = (int32_t)factors;
        int64_t held = 0;
        for (int64_t e = 0; e < down; e++) {
            int64_t block = floor_div(below[down - 1 - e], CHAIN_ELIMINATION_BLOCK);
            if (held == 0 || blocks[imax(held - 1, 0)] != block) {
                blocks[held] = (int32_t)block;
                held++;
            }
        }
        if (down == 0) {
            blocks[0] = 0;
            held = 1;
        }
        int64_t pivot = size - 1 - top;
        int32_t *panel = lists + at;
        panel[0] = (int32_t)own;
        panel[1] = kinds[pivot] == 2 ? 2 : 1;
        panel[2] = own > 1 && kinds[imax(pivot + own - 2, 0)] == 2 ? 2 : 1;
        panel[3] = (int32_t)top;
        panel[4] = (int32_t)held;
        panel[5] = (int32_t)down;
        int64_t corner =
            own == 4 ? 2 * CHAIN_ELIMINATION_BLOCK : CHAIN_ELIMINATION_BLOCK; /* what is kept before the factors */
        int64_t before = 0; /* rows of higher blocks */
        int32_t *pairs = panel + 6 + 2 * held;
        for (int64_t b = 0; b < held; b++) {
            int64_t after = before;
            while (after < down &&
                   floor_div(below[imax(down - 1 - after, 0)], CHAIN_ELIMINATION_BLOCK) == blocks[b]) {
                int64_t row = below[down - 1 - after];
                pairs[2 * after] = (int32_t)(row * stride);
                pairs[2 * after + 1] =
                    (int32_t)(corner + CHAIN_ELIMINATION_BLOCK * own * b + floor_mod(row, CHAIN_ELIMINATION_BLOCK));
                after++;
            }
            before = after;
            panel[6 + 2 * b] = (int32_t)(CHAIN_ELIMINATION_BLOCK * (int64_t)blocks[b]);
            panel[7 + 2 * b] = (int32_t)after;
        }
        for (int64_t e = 0; e < down + own; e++) {
            int64_t row = top - own + 1 + e - down;
            if (e < down) row = below[e];
            for (int64_t b = 0; b < held; b++) filled[row * width + blocks[b]] = 1;
            for (int64_t k = 0; k < own; k++) filled[row * width + floor_div(top - k, CHAIN_ELIMINATION_BLOCK)] = 1;
        }
        at += 6 + 2 * held + 2 * down;
        factors += corner + CHAIN_ELIMINATION_BLOCK * own * held;
        operations += own * down * (down + 1 + own);
    }
    totals[0] = at;
    totals[1] = factors;
    totals[2] = operations;
}

/* What a panel takes that couples with the marked rows below last. */
static double cycles(int64_t members, int64_t last, const int32_t *restrict union_) {
    int64_t rows = 0;
    int64_t blocks = 0;
    int64_t changed = 0;
    int64_t k = last - 1;
    while (k >= 0) {
        int64_t begin = floor_div(k, CHAIN_ELIMINATION_BLOCK) * CHAIN_ELIMINATION_BLOCK;
        int64_t before = rows;
        for (int64_t r = begin; r < k + 1; r++) rows += union_[r];
        if (rows > before) {
            blocks++;
            changed += rows;
        }
        k = begin - 1;
    }
    blocks = imax(blocks, 1);
    if (members == 4) return PANEL_OF_4 + COLUMNS_OF_4 * blocks + BLOCK_OF_4 * changed;
    if (members == 2) return PANEL_OF_2 + COLUMNS_OF_2 * blocks + BLOCK_OF_2 * changed;
    return PANEL_OF_1 + COLUMNS_OF_1 * blocks + BLOCK_OF_1 * changed;
}

void chain_panel_plan_join(int64_t size, int64_t units, const int32_t *restrict high,
                           const int32_t *restrict members, int32_t *restrict coupled, int32_t *restrict union_,
                           int32_t *restrict reach, double *restrict cost, int32_t *restrict came) {
    for (int64_t u = 0; u < units; u++) {
        int64_t below = high[u] - members[u] + 1;
        int32_t *own = reach + u * size;
        const int32_t *top = coupled + high[u] * size;
        const int32_t *other = coupled + below * size;
        for (int64_t r = 0; r < below; r++) own[r] = (int32_t)imax(top[r], other[r]);
        for (int64_t r = 0; r < below; r++) {
            if (own[r] != 0) {
                int32_t *row = coupled + r * size;
                for (int64_t e = 0; e < below; e++) row[e] = (int32_t)imax(row[e], own[e]);
            }
        }
    }
    for (int64_t u = 1; u < units + 1; u++) cost[u] = CHAIN_PANEL_PLAN_FAR;
    for (int64_t u = 0; u < units; u++) {
        int64_t together = 0;
        int64_t last = u;
        while (last < units && together < 4) {
            together += members[last];
            int32_t *own = reach + last * size;
            int64_t below = high[last] - members[last] + 1;
            for (int64_t r = 0; r < below; r++) union_[r] = (int32_t)imax(union_[r], own[r]);
            last++;
            /* Two that make one pivot begin at an even place. */
            bool apart = members[u] == 1 && last > u + 1 && members[imin(u + 1, units - 1)] == 2;
            if ((together == 1 || together == 2 || together == 4) && !apart) {
                double total = cost[u] + cycles(together, below, union_);
                if (total < cost[last]) {
                    cost[last] = total;
                    came[last] = (int32_t)u;
                }
            }
        }
        for (int64_t r = 0; r < size; r++) union_[r] = 0;
    }
}
