/* A system of segments and a rest: equilibrating it, eliminating, and solving with the factors of both. */
#ifndef STC_SEGMENTED_PASSES_H
#define STC_SEGMENTED_PASSES_H

#include "../native.h"

/* Results of eliminate_all. */
enum {
    SEGMENTED_PASSES_REFUSED = 1,
    STALE_SCALE = 2,
    DOUBTED_SCALE = 3,
};

/* Collect the diagonal, (n + m,); p and d begin at given[at].
 *
 * curvatures: so many entries of H are given first; found[0] becomes 1 where one of them is not zero, else 0.
 * checked: so many given entries are checked besides the diagonal.
 * Returns:
 *     0, or 1 when not all is finite. */
API int64_t segmented_passes_diagonal_of(int64_t n, int64_t m, int64_t at, int64_t curvatures, int64_t curved,
                                         const int32_t *restrict curved_variable,
                                         const int32_t *restrict curved_source, int64_t checked,
                                         const double *restrict given, double *restrict diagonal,
                                         int64_t *restrict found);

/* Make scale serve the matrix (see values.h.equilibrate); whether it did not do so before. */
API int64_t segmented_passes_equilibrate_all(int64_t sweeps, int64_t fetched, int64_t groups,
                                             const int64_t *restrict table, const int32_t *restrict index,
                                             const int32_t *restrict code, int64_t outer, int64_t rest,
                                             int64_t entries, const int32_t *restrict first,
                                             const int32_t *restrict second, const int32_t *restrict source,
                                             const double *restrict given, const double *restrict diagonal,
                                             double *restrict scale, double *restrict most, double *restrict scales,
                                             double *restrict part);

/* Load the rest, eliminate the segments and add what they leave to the rest, result.
 *
 * calls, place: where eliminate_part of all parts is among the prepared calls.
 * parts: how many there are; states, spreads: of each part.
 * length: of result and of each of other_results, those of the parts but the first; other_most: what is
 *     most to these.
 * Returns:
 *     0, REFUSED when a pivot was not accepted or an entry is not finite, STALE_SCALE when the scale does not
 *     serve the matrix, DOUBTED_SCALE when it was not tested but perhaps does not; state[COUNTED] becomes the
 *     number of negative pivots. */
API int64_t segmented_passes_eliminate_all(const int64_t *calls, int64_t place, int64_t parts, double *states,
                                           const double *spreads, int64_t length, const double *other_results,
                                           const double *other_most, const int32_t *index, const double *given,
                                           const double *diagonal, const double *scale, double *most,
                                           double *result, double *state, int64_t outer, int64_t rest,
                                           int64_t entries, const int32_t *target, const int32_t *first,
                                           const int32_t *second, const int32_t *source, int64_t variables,
                                           int64_t filled, double *rest_matrix);

/* Solve K x = rhs: the segments' part, the rest's, the segments' again; refined.
 *
 * both: whether to do the same for other_rhs, in common passes; report then tells of the less accurate.
 * calls, place: where the calls of the parts are among the prepared ones: FORWARD and so on from place on.
 * parts: how many there are; progress tells them how far this is; norms: NORMS of each; left: what the
 *     parts but the first leave to the rest, a vector of each; high: work space.
 * rest_matrix: what eliminate_all has kept of the rest.
 * rest_place: the rest's solves among the prepared calls, of one right-hand side and of both; rest_rhs ...: their arrays.
 * rhs, result: (N,); report: see kkt_arrays; the other arrays are work space. */
API void segmented_passes_solve_all(int64_t both, int64_t refinements, const double *accuracy, const int64_t *calls,
                                    int64_t place, int64_t parts, int64_t *progress, const double *norms, double *high,
                                    const double *left, const double *other_left, const int32_t *index, int64_t outer,
                                    int64_t rest, int64_t entries, const int32_t *first, const int32_t *second,
                                    const double *rest_matrix, const double *scale, int64_t rest_place, double *rest_rhs,
                                    const double *rest_solution, double *other_rest_rhs,
                                    const double *other_rest_solution, const double *rhs, double *scaled_rhs,
                                    double *solution, double *change, double *between, double *kept, double *result,
                                    const double *other_rhs, double *other_scaled_rhs, double *other_solution,
                                    double *other_change, double *other_between, double *other_kept,
                                    double *other_result, double *report, double *other_report);

#endif
