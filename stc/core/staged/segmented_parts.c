/* What is done with the segments of one part of a horizon, while another thread may be at those of another part.
 *
 * A part is some groups of segments, which follow one another in vectors.  It reads what the rest has and writes nothing
 * that is not its own: what it leaves to the rest goes to a vector of its own, unless it is the first part, which goes on
 * where the rest has begun.  How parts are put together, in an order that does not depend on threads, is in
 * segmented_passes.h. */
#include "../native.h"
#include "lane_rows.h"
#include "lane_solve.h"
#include "lane_state.h"
#include "lanes.h"
#include "segmented_parts.h"
#include "values.h"

ALWAYS_INLINE void clear(int64_t count, double *restrict x) {
    for (int64_t k = 0; k < count; k++) x[k] = 0.0;
}

void segmented_parts_eliminate_part(int64_t groups, const int64_t *restrict table, const int32_t *restrict index,
                                    const int32_t *restrict code, double growth, double suspect,
                                    const double *restrict given, double *restrict ring,
                                    const double *restrict diagonal, const double *restrict scale,
                                    double *restrict result, double *restrict work, double *restrict scales,
                                    double *restrict known, double *restrict made, double *restrict matrix,
                                    double *restrict row_most, double *restrict most, double *restrict spread,
                                    double *restrict factors, double *restrict state, int64_t length, int64_t outer,
                                    int64_t rest) {
    clear(length, result);
    clear(rest, most + outer);
    for (int64_t k = 0; k < SPREADS; k++) spread[k] = -STALE;
    int64_t negative = lanes_eliminate(groups, table, index, code, growth, suspect, given, ring, diagonal, scale,
                                       result, work, scales, known, made, matrix,
                                       (int64_t)state[LANE_STATE_WATCHED], row_most, most, spread, factors, state);
    state[COUNTED] = 1.0 * negative;
}

void segmented_parts_forward_part(int64_t both, int64_t distance, int64_t groups, const int64_t *restrict table,
                                  const int32_t *restrict index, const int32_t *restrict code,
                                  const double *restrict factors, double *restrict part,
                                  const int64_t *restrict progress, double *restrict norms, int64_t begin,
                                  int64_t end, int64_t outer, int64_t cleared, const double *restrict scale,
                                  const double *restrict rhs, double *restrict scaled_rhs,
                                  const double *restrict change, double *restrict between, double *restrict left,
                                  const double *restrict other_rhs, double *restrict other_scaled_rhs,
                                  const double *restrict other_change, double *restrict other_between,
                                  double *restrict other_left) {
    int64_t count = end - begin;
    const double *source = change + 0;
    const double *other_source = other_change + 0;
    if (progress[SEGMENTED_PARTS_STEPS] == 0) {
        norms[RIGHT] = values_bring_scaled(count, index + begin, scale + begin, rhs, scaled_rhs + begin);
        source = scaled_rhs + 0;
        if (both != 0) {
            norms[OTHER_RIGHT] =
                values_bring_scaled(count, index + begin, scale + begin, other_rhs, other_scaled_rhs + begin);
            other_source = other_scaled_rhs + 0;
        }
    }
    clear(cleared, left + outer);
    if (both != 0) {
        clear(cleared, other_left + outer);
        lane_solve_forward(1, distance, groups, table, index, code, factors, source, between, left, other_source,
                           other_between, other_left, part);
    } else {
        lane_solve_forward(0, distance, groups, table, index, code, factors, source, between, left, other_source,
                           other_between, other_left, part);
    }
}

/* See backward_part; both is a constant here. */
ALWAYS_INLINE void backward_part(int64_t both, int64_t distance, int64_t groups, const int64_t *restrict table,
                                 const int32_t *restrict index, const int32_t *restrict code,
                                 const double *restrict factors, const double *restrict matrix,
                                 double *restrict work, double *restrict part, const int64_t *restrict progress,
                                 double *restrict norms, int64_t begin, int64_t end, int64_t outer, int64_t cleared,
                                 const double *restrict between, double *restrict kept, double *restrict solution,
                                 const double *restrict scaled_rhs, double *restrict change, double *restrict left,
                                 const double *restrict other_between, double *restrict other_kept,
                                 double *restrict other_solution, const double *restrict other_scaled_rhs,
                                 double *restrict other_change, double *restrict other_left) {
    double *target = kept + 0;
    double *other_target = other_kept + 0;
    if (progress[SEGMENTED_PARTS_STEPS] == 0) {
        target = solution + 0;
        other_target = other_solution + 0;
    }
    lane_solve_backward(both, distance, groups, table, index, code, factors, between, target, other_between,
                        other_target, part);
    if (progress[SEGMENTED_PARTS_STEPS] > 0 && progress[ACTIVE] != 0)
        values_add_to(end - begin, kept + begin, solution + begin);
    if (progress[SEGMENTED_PARTS_STEPS] > 0 && progress[OTHER_ACTIVE] != 0)
        values_add_to(end - begin, other_kept + begin, other_solution + begin);
    clear(cleared, left + outer);
    if (both != 0) clear(cleared, other_left + outer);
    lane_rows_subtract_segments(both, distance, groups, table, index, code, matrix, solution, scaled_rhs, change,
                                left, other_solution, other_scaled_rhs, other_change, other_left, work, part,
                                norms);
}

void segmented_parts_backward_part(int64_t both, int64_t distance, int64_t groups, const int64_t *restrict table,
                                   const int32_t *restrict index, const int32_t *restrict code,
                                   const double *restrict factors, const double *restrict matrix,
                                   double *restrict work, double *restrict part, const int64_t *restrict progress,
                                   double *restrict norms, int64_t begin, int64_t end, int64_t outer,
                                   int64_t cleared, const double *restrict between, double *restrict kept,
                                   double *restrict solution, const double *restrict scaled_rhs,
                                   double *restrict change, double *restrict left,
                                   const double *restrict other_between, double *restrict other_kept,
                                   double *restrict other_solution, const double *restrict other_scaled_rhs,
                                   double *restrict other_change, double *restrict other_left) {
    if (both != 0) {
        backward_part(1, distance, groups, table, index, code, factors, matrix, work, part, progress, norms, begin,
                      end, outer, cleared, between, kept, solution, scaled_rhs, change, left, other_between,
                      other_kept, other_solution, other_scaled_rhs, other_change, other_left);
    } else {
        backward_part(0, distance, groups, table, index, code, factors, matrix, work, part, progress, norms, begin,
                      end, outer, cleared, between, kept, solution, scaled_rhs, change, left, other_between,
                      other_kept, other_solution, other_scaled_rhs, other_change, other_left);
    }
}

void segmented_parts_return_part(int64_t both, int64_t begin, int64_t end, const int32_t *restrict index,
                                 const double *restrict scale, const double *restrict solution,
                                 double *restrict result, const double *restrict other_solution,
                                 double *restrict other_result) {
    values_return_scaled(end - begin, index + begin, scale + begin, solution + begin, result);
    if (both != 0)
        values_return_scaled(end - begin, index + begin, scale + begin, other_solution + begin, other_result);
}
