/* The optimality conditions at a point, compiled: as stated, and as a projection equation. */
#ifndef STC_CONDITIONS_H
#define STC_CONDITIONS_H

#include "../native.h"

/* See stc.solver.residuals.assess; without given multipliers of the bounds, z (n,) is chosen. */
API void conditions_stated_conditions(int64_t n, int64_t m, int64_t entries, int64_t given,
                                      const double *restrict x, const double *restrict y, double *restrict z,
                                      const double *restrict r, const double *restrict gradient,
                                      const int32_t *restrict rows, const int32_t *restrict cols,
                                      const double *restrict jac, const double *restrict x_lower,
                                      const double *restrict x_upper, const double *restrict row_lower,
                                      const double *restrict row_upper, double *restrict lagrangian,
                                      double *restrict out);

/* Where each value ends when pushed and clipped, and which ones are clipped.
 *
 * A push away from the bound nearby leaves that bound; it does not reach the one on the other side. fixed ones
 * are active always. The push is minus the gradient of variables, or the multiplier of rows.
 *
 * Results: the largest violation, the largest dual residual, the sum of the multipliers. */
API void conditions_project_entries(int64_t count, int64_t gradient, const double *restrict value,
                                    const double *restrict push, const double *restrict lower,
                                    const double *restrict upper, const double *restrict fixed,
                                    double *restrict target, double *restrict active, double *restrict out);

/* Matrix and right-hand side of the Newton step on an active set.
 *
 * dx and dy become the part of the step that the active set fixes: variables go to their bounds, multipliers
 * of rows that are not active to zero. The matrix has all entries, whatever is active: diagonals tell that (see
 * restricted_diagonals). largest[0] becomes the largest entry of the Hessian. */
API void conditions_restrict(int64_t n, int64_t m, int64_t entries, int64_t curved, const int64_t *restrict rows,
                             const int64_t *restrict cols, const int64_t *restrict hess_rows,
                             const int64_t *restrict hess_cols, const double *restrict jac,
                             const double *restrict hess, const double *restrict active_x,
                             const double *restrict active_rows, const double *restrict x, const double *restrict y,
                             const double *restrict r, const double *restrict lagrangian,
                             const double *restrict x_target, const double *restrict row_target,
                             double *restrict dx, double *restrict dy, double *restrict out_hess,
                             double *restrict out_jac, double *restrict rhs, double *restrict largest);

/* What a step does: pull = -(gradient + H d + J^T y) and moved = J d.
 *
 * Returns 0, or nan where the step or the multipliers are not finite. */
API double conditions_respond(int64_t n, int64_t m, int64_t entries, int64_t curved, const int64_t *restrict rows,
                              const int64_t *restrict cols, const int64_t *restrict hess_rows,
                              const int64_t *restrict hess_cols, const double *restrict jac,
                              const double *restrict hess, const double *restrict gradient,
                              const double *restrict d, const double *restrict y, double *restrict pull,
                              double *restrict moved);

/* The active set that a solution for active suggests; returns in how many constraints they differ.
 *
 * slack: smallest violation, and multiplier of the wrong sign, that counts.
 * equal: 1 for constraints that are active always, whose sign is 0.
 * move: what the step changes, low and high how far it may. */
API int64_t conditions_better_signs(int64_t count, double slack, const int32_t *restrict active,
                                    const double *restrict equal, const double *restrict move,
                                    const double *restrict multiplier, const double *restrict low,
                                    const double *restrict high, int32_t *restrict out);

/* grad f + J^T y. */
API void conditions_gradient_of_lagrangian(int64_t n, int64_t entries, const int64_t *restrict rows,
                                           const int64_t *restrict cols, const double *restrict y,
                                           const double *restrict gradient, const double *restrict jac,
                                           double *restrict out);

/* Gradient of the Lagrangian, multipliers of bounds (n,) where balanced is not 0, and the errors. */
API void conditions_point_conditions(int64_t n, int64_t m, int64_t entries, const double *restrict balanced,
                                     const int64_t *restrict rows, const int64_t *restrict cols,
                                     const double *restrict x, const double *restrict y, double *restrict z,
                                     const double *restrict r, const double *restrict gradient,
                                     const double *restrict jac, const double *restrict x_lower,
                                     const double *restrict x_upper, const double *restrict row_lower,
                                     const double *restrict row_upper, double *restrict lagrangian,
                                     double *restrict out);

/* Diagonals that hold active variables and leave out rows that are not active, nearly: as a barrier's do.
 *
 * shift_x, shift_y: of variables and rows.
 * firm: of variables at their bounds; loose: of rows that are not active; soft: of active inequalities, at least.
 * fixed, equality: 1 for variables that have no derivatives, and for equations. */
API void conditions_restricted_diagonals(int64_t n, int64_t m, double shift_x, double shift_y, double firm,
                                         double loose, double soft, const double *restrict fixed,
                                         const double *restrict equality, const double *restrict active_x,
                                         const double *restrict active_rows, double *restrict primal,
                                         double *restrict dual);

/* Right-hand side of another step on an active set that a point is on already: it fixes nothing more. */
API void conditions_remaining(int64_t n, int64_t m, const double *restrict active_x,
                              const double *restrict active_rows, const double *restrict lagrangian,
                              const double *restrict row_target, const double *restrict r, double *restrict dx,
                              double *restrict dy, double *restrict rhs);

/* The point after a Newton step on the active set, inside the bounds; what that fixes does not move any further.
 *
 * Results: the largest change of a variable; 0, or nan where the step is not finite. */
API void conditions_advance(int64_t n, int64_t m, const double *restrict active_x,
                            const double *restrict active_rows, const double *restrict x, const double *restrict y,
                            const double *restrict dx, const double *restrict dy, const double *restrict solution,
                            const double *restrict lower, const double *restrict upper, double *restrict next_x,
                            double *restrict next_y, double *restrict out);

#endif
