/* The step of an iteration, compiled: right-hand sides, what follows from a solution, and how far it may go. */
#ifndef STC_STEP_H
#define STC_STEP_H

#include "../native.h"

/* ratio = z / gap, its sum per entry of w, and the diagonals without shifts. */
API void step_diagonals(int64_t n, int64_t m, int64_t gaps, const int64_t *restrict index,
                        const double *restrict free, const int32_t *restrict kind, const double *restrict extra,
                        double smallest, const double *restrict z, const double *restrict gap,
                        double *restrict ratio, double *restrict sigma, double *restrict primal,
                        double *restrict d);

/* The diagonals with the shifts (n,) of the Hessian and of the equality rows.
 *
 * Where the rows' part of the Hessian is damped, shifts are larger for large variables w (n + m,), so that steps
 * are kept short relative to them: rates and accelerations of a fast motion should change less, of itself, than
 * slow ones. (As trust regions are scaled: D. W. Marquardt, J. SIAM 11, 1963; J. J. More, LNM 630, 1978.)
 *
 * A variable (convex,) that only the objective bends, upwards, as torques are, makes no matrix indefinite: it gets
 * little of a shift, so that steps stay long in its direction. (As modified factorisations shift a diagonal only where
 * that is needed: P. E. Gill and W. Murray, Math. Program. 7, 1974; R. B. Schnabel and E. Eskow, SIAM J. Sci. Stat.
 * Comput. 11, 1990.) */
API void step_shifted(int64_t n, int64_t m, const double *restrict free, const int32_t *restrict kind,
                      const double *restrict w, const double *restrict primal, const double *restrict d,
                      int64_t convex, const int64_t *restrict variable, const int64_t *restrict entry,
                      const double *restrict hess, double *restrict shifts, double *restrict out_primal,
                      double *restrict out_dual, const double *restrict s);

/* The Hessian hess with a share of the rows' part of it: bend is the objective's. */
API void step_damped(int64_t entries, const double *restrict bend, const double *restrict hess,
                     double *restrict out);

/* The target of equal products of gaps and multipliers, as large as they are on average. */
API void step_mean_centre(int64_t gaps, const double *restrict gap, double *restrict centre,
                          const double *restrict s);

/* mu / gap. */
API void step_mu_centre(int64_t gaps, const double *restrict mu, const double *restrict gap,
                        double *restrict centre);

/* Of the reduced system, for gaps' multipliers that are to become centre.
 *
 * Without residuals: the part that is linear in centre. */
API void step_right_hand_side(int64_t n, int64_t m, int64_t gaps, int64_t with_residuals,
                              const int64_t *restrict index, const double *restrict sign,
                              const int32_t *restrict kind, const double *restrict centre,
                              const double *restrict dual, const double *restrict c, const double *restrict d,
                              double *restrict pull, double *restrict rhs);

/* Steps of variables, slacks and gap multipliers from the solution of the reduced system.
 *
 * entry (entries,) are those of jac in rows that have a slack. */
API void step_recover(int64_t n, int64_t m, int64_t gaps, int64_t with_residuals, int64_t entries,
                      const int64_t *restrict entry, const int64_t *restrict index, const double *restrict sign,
                      const double *restrict free, const int32_t *restrict kind, const int64_t *restrict rows,
                      const int64_t *restrict cols, const double *restrict jac, const double *restrict c,
                      const double *restrict z, const double *restrict ratio, const double *restrict centre,
                      const double *restrict solution, double *restrict dw, double *restrict dy,
                      double *restrict dz);

/* How far the bounds let a step go, and how it begins. */
API void step_lengths(int64_t n, int64_t m, int64_t gaps, const int64_t *restrict index,
                      const double *restrict sign, const double *restrict tau, const double *restrict w,
                      const double *restrict z, const double *restrict gap, const double *restrict gradient,
                      const double *restrict dw, const double *restrict dy, const double *restrict dz,
                      double *restrict s);

/* out = one + factor * other. */
API void step_combine(int64_t count, const double *restrict factor, const double *restrict one,
                      const double *restrict other, double *restrict out);

/* The centring parameter of those in grid (count,) whose step is predicted to leave the smallest squared error.
 *
 * A step for sigma is affine + sigma * centring; moving and rows are the numbers of dual and primal
 * conditions.  Where even the best step is less than short_, bounds are in its way: products are not made smaller.
 *
 * gap_1, gap_2: room, (gaps,); fall: room, (4 BLOCK,); trials: room, (4 count,). */
API void step_choose_centring(int64_t gaps, int64_t count, double moving, double rows, double smallest_tau,
                              double short_, const int64_t *restrict index, const double *restrict sign,
                              const double *restrict grid, const double *restrict gap, const double *restrict z,
                              const double *restrict affine, const double *restrict affine_z,
                              const double *restrict centring, const double *restrict centring_z,
                              double *restrict gap_1, double *restrict gap_2, double *restrict fall,
                              double *restrict trials, double *restrict s);

/* The system whose solution makes the Lagrangian's gradient smallest.
 *
 * Equality rows are softened, against dependent ones, by NOTHING times the square of the largest entry of J. */
API void step_least_squares(int64_t n, int64_t m, int64_t gaps, int64_t entries, int64_t curved,
                            const int64_t *restrict index, const double *restrict sign, const double *restrict free,
                            const int32_t *restrict kind, const double *restrict z, const double *restrict gradient,
                            const double *restrict jac, double *restrict pull, double *restrict out_hess,
                            double *restrict out_jac, double *restrict primal, double *restrict dual,
                            double *restrict rhs);

#endif
