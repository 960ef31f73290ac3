/* Entries of several steps loaded at once by eight segments, where they follow one another in memory.
 *
 * Kernels leave each entry of four or eight frames next to each other.  To load one step after the other takes eight lines
 * of memory for a vector of eight segments, and all of these again for the next step.  Here four steps of an entry are
 * loaded and transposed, where all segments begin at the same place of such blocks. */
#include "../native.h"
#include "../vec8.h"
#include "lane_runs.h"

enum {
    PAIRED = RUN,
    SINGLE = RUN + (RUN / 2),
    LISTED = SINGLE + 1,
};

/* Bring an entry of some steps to where these are in ring; sources are those of the first step of all. */
ALWAYS_INLINE void bring_one(int64_t begin, int64_t end, int64_t entry, int64_t count,
                             const int32_t *restrict sources, const double *restrict given, double *restrict ring) {
    for (int64_t step = begin; step < end; step++) {
        store8(ring, 8 * (floor_mod(step, RUN) * count + entry),
               gather8(given, sources, 8 * (step * count + entry)));
    }
}

void lane_runs_bring_entries(int64_t step, int64_t steps, int64_t count, const int32_t *restrict runs,
                             const int32_t *restrict sources, const double *restrict given, double *restrict ring) {
    const int32_t *own = sources + 8 * step * count;
    int64_t first = 8 * count * floor_mod(step, RUN);
    int64_t second = 8 * count * floor_mod(step + 1, RUN);
    int64_t third = 8 * count * floor_mod(step + 2, RUN);
    int64_t fourth = 8 * count * floor_mod(step + 3, RUN);
    const int32_t *listed = runs + LISTED;
    for (int64_t phase = 0; phase < RUN; phase++) {
        int64_t number = runs[phase];
        if (floor_mod(step, RUN) == phase) {
            if (step + RUN <= steps) {
                for (int64_t k = 0; k < number; k++) {
                    int64_t at = 8 * (int64_t)listed[k];
                    spread8(given, own, at, ring, first + at, second + at, third + at, fourth + at);
                }
            } else {
                for (int64_t k = 0; k < number; k++) bring_one(step, steps, listed[k], count, sources, given, ring);
            }
        } else if (step == 0) {
            for (int64_t k = 0; k < number; k++)
                bring_one(0, imin(phase, steps), listed[k], count, sources, given, ring);
        }
        listed = listed + number;
    }
    for (int64_t phase = 0; phase < RUN >> 1; phase++) {
        int64_t number = runs[PAIRED + phase];
        if (floor_mod(step, RUN >> 1) == phase) {
            if (step + (RUN >> 1) <= steps) {
                for (int64_t k = 0; k < number; k++) {
                    int64_t one = 8 * (int64_t)listed[2 * k];
                    int64_t other = 8 * (int64_t)listed[2 * k + 1];
                    spread8(given, own, one, ring, first + one, first + other, second + one, second + other);
                }
            } else {
                for (int64_t k = 0; k < 2 * number; k++)
                    bring_one(step, steps, listed[k], count, sources, given, ring);
            }
        } else if (step == 0) {
            for (int64_t k = 0; k < 2 * number; k++)
                bring_one(0, imin(phase, steps), listed[k], count, sources, given, ring);
        }
        listed = listed + 2 * number;
    }
    for (int64_t k = 0; k < runs[SINGLE]; k++) bring_one(step, step + 1, listed[k], count, sources, given, ring);
}
