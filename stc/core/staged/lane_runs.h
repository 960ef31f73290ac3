/* Entries of several steps loaded at once by eight segments, where they follow one another in memory. */
#ifndef STC_LANE_RUNS_H
#define STC_LANE_RUNS_H

#include "../native.h"

/* The entries of RUN steps in a row that follow one another in memory, as kernels leave them, are brought at once. How
 * many there are is listed first: entries whose runs begin with step 0, 1, 2 and 3 in all lanes; then pairs of entries
 * that take turns in memory, whose runs are half as many steps and begin with step 0 and 1; then others. After these
 * numbers come the entries. */
enum {
    RUN = 4,
};

/* Bring the entries of a step, and of the next ones as far as they follow in memory, to ring.
 *
 * There, a step has its entries, count vectors, in the places of the one RUN before, which has been done with.
 * When each number is fetched at its turn, that takes eight lines of memory for a vector, and all of them for the next
 * step again.
 *
 * steps: how many there are; runs: see RUN; sources: where each step's entries are in given. */
API void lane_runs_bring_entries(int64_t step, int64_t steps, int64_t count, const int32_t *restrict runs,
                                 const int32_t *restrict sources, const double *restrict given,
                                 double *restrict ring);

#endif
