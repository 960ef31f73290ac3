/* Solving with the factors of a chain, refined: what its runs of stages do, and how that is put together. */
#ifndef STC_CHAIN_SOLVE_H
#define STC_CHAIN_SOLVE_H

#include "../native.h"

/* Substitute forward with the factors of stages that follow one another.
 *
 * apart: whether others are at other stages meanwhile: then a vector of its own is used, aside, in which what
 *     is left to the stages from tail to size is found.
 * begin, end: where the unknowns of these stages are in vectors.
 * progress: CHECKED, whether solution is to be found, from the right-hand side that is there, or change;
 *     WHICH of two.
 * other arguments: see solve. */
API void chain_solve_forward_run(int64_t apart, int64_t begin, int64_t end, int64_t tail, int64_t size,
                                 const int64_t *restrict progress, int64_t distance, int64_t stages,
                                 const int64_t *restrict table, const int32_t *restrict code, int64_t stride,
                                 const double *restrict factors, double *restrict work, double *restrict solution,
                                 double *restrict change, double *restrict aside, double *restrict other_solution,
                                 double *restrict other_change, double *restrict other_aside);

/* Substitute back with the factors of these stages; arguments as for forward_run.
 *
 * Where it is CHECKED, what solution leaves of the right-hand side is subtracted from change: left has the
 * stages' own part of that, and what is to be added to the stages from tail on. */
API void chain_solve_backward_run(int64_t apart, int64_t begin, int64_t end, int64_t tail, int64_t size,
                                  const int64_t *restrict progress, int64_t distance, int64_t stages,
                                  const int64_t *restrict table, const int32_t *restrict code, int64_t stride,
                                  const double *restrict units, const double *restrict factors,
                                  const double *restrict matrix, double *restrict work, double *restrict solution,
                                  double *restrict change, double *restrict aside, double *restrict left,
                                  double *restrict other_solution, double *restrict other_change,
                                  double *restrict other_aside, double *restrict other_left);

/* Solve K x = rhs, refined.
 *
 * both: whether to do the same for other_rhs, in common passes; report then tells of the less accurate.
 * calls, place: where the calls of the runs of stages are among the prepared ones: FORWARD and so on from
 *     place on; runs: see chain_elimination.eliminate; tail: where the unknowns of the last run begin.
 * progress: tells the runs what to do; aside, left: a vector each of the second part's own.
 * stages ... scale: see chain_elimination.eliminate_run; size: N.
 * rhs, result: (N,); report: see kkt_arrays; the other arrays are work space. */
API void chain_solve_solve(int64_t both, int64_t refinements, const double *accuracy, const int64_t *calls,
                           int64_t place, int64_t runs, int64_t tail, int64_t *progress, int64_t stages,
                           const int64_t *table, const int32_t *code, const int32_t *index, int64_t size,
                           int64_t stride, const double *matrix, const double *scale, double *work, double *norms_,
                           const double *aside, const double *left, const double *other_aside,
                           const double *other_left, const double *rhs, double *scaled_rhs, double *solution,
                           double *change, double *kept, double *result, const double *other_rhs,
                           double *other_scaled_rhs, double *other_solution, double *other_change,
                           double *other_kept, double *other_result, double *report, double *other_report);

#endif
