/* What is done with the segments of one part of a horizon, while another thread may be at those of another part. */
#ifndef STC_SEGMENTED_PARTS_H
#define STC_SEGMENTED_PARTS_H

#include "../native.h"

/* Numbers that eliminate notes of the rows of a part. */
enum {
    SPREADS = 16,
};
/* How far a solve is: refinements so far, and whether either solution is still to be refined. */
enum {
    SEGMENTED_PARTS_STEPS = 0,
    ACTIVE = 1,
    OTHER_ACTIVE = 2,
};
/* Largest magnitudes that a part finds: those of subtract_segments, then of the scaled right-hand sides. */
enum {
    RIGHT = 4,
    OTHER_RIGHT = 5,
    NORMS = 8,
};
/* Where the phases of a solve are among the prepared calls. */
enum {
    SEGMENTED_PARTS_FORWARD = 0,
    SEGMENTED_PARTS_BACKWARD = 1,
    SEGMENTED_PARTS_RETURN = 2,
};

/* Eliminate the segments of a part (see eliminate); state[COUNTED] becomes what that returns.
 *
 * length, rest: numbers of result, and of most from outer on, to be cleared first. */
API void segmented_parts_eliminate_part(int64_t groups, const int64_t *restrict table,
                                        const int32_t *restrict index, const int32_t *restrict code, double growth,
                                        double suspect, const double *restrict given, double *restrict ring,
                                        const double *restrict diagonal, const double *restrict scale,
                                        double *restrict result, double *restrict work, double *restrict scales,
                                        double *restrict known, double *restrict made, double *restrict matrix,
                                        double *restrict row_most, double *restrict most, double *restrict spread,
                                        double *restrict factors, double *restrict state, int64_t length,
                                        int64_t outer, int64_t rest);

/* Bring a part of the right-hand side, from begin to end, and substitute forward (see forward).
 *
 * left: where what is left to the rest is added; from outer on, so many numbers are cleared there first. */
API void segmented_parts_forward_part(int64_t both, int64_t distance, int64_t groups, const int64_t *restrict table,
                                      const int32_t *restrict index, const int32_t *restrict code,
                                      const double *restrict factors, double *restrict part,
                                      const int64_t *restrict progress, double *restrict norms, int64_t begin,
                                      int64_t end, int64_t outer, int64_t cleared, const double *restrict scale,
                                      const double *restrict rhs, double *restrict scaled_rhs,
                                      const double *restrict change, double *restrict between,
                                      double *restrict left, const double *restrict other_rhs,
                                      double *restrict other_scaled_rhs, const double *restrict other_change,
                                      double *restrict other_between, double *restrict other_left);

/* Substitute back (see backward), refine the solution, and find its residual, change.
 *
 * What the rest has of the solution is there; left and cleared as for forward_part. */
API void segmented_parts_backward_part(
    int64_t both, int64_t distance, int64_t groups, const int64_t *restrict table, const int32_t *restrict index,
    const int32_t *restrict code, const double *restrict factors, const double *restrict matrix,
    double *restrict work, double *restrict part, const int64_t *restrict progress, double *restrict norms,
    int64_t begin, int64_t end, int64_t outer, int64_t cleared, const double *restrict between,
    double *restrict kept, double *restrict solution, const double *restrict scaled_rhs, double *restrict change,
    double *restrict left, const double *restrict other_between, double *restrict other_kept,
    double *restrict other_solution, const double *restrict other_scaled_rhs, double *restrict other_change,
    double *restrict other_left);

/* Return a part of the solution to the unknowns' own order. */
API void segmented_parts_return_part(int64_t both, int64_t begin, int64_t end, const int32_t *restrict index,
                                     const double *restrict scale, const double *restrict solution,
                                     double *restrict result, const double *restrict other_solution,
                                     double *restrict other_result);

#endif
