/* The elastic form of a problem and its linear system; see stc/solver/elastic.py and penalised.py. */
#ifndef STC_ELASTIC_H
#define STC_ELASTIC_H

#include "../native.h"

/* The elastic objective and rows, from the problem's own. */
API void elastic_values(int64_t n, int64_t m, double price, const double *restrict curvature,
                        const double *restrict reference, const double *restrict own_r,
                        const double *restrict own_status, const double *restrict x, double *restrict f,
                        double *restrict r, double *restrict status);

/* The elastic gradient and Jacobian, but for the parts of p and q, which are constant. */
API void elastic_derivatives(int64_t n, int64_t entries, const double *restrict free,
                             const double *restrict curvature, const double *restrict reference,
                             const double *restrict own_jac, const double *restrict x, double *restrict gradient,
                             double *restrict jac);

/* Note the problem's own objective in the user's terms. */
API void elastic_state(double unit, const double *restrict f, double *restrict stated);

/* Hand on a matrix without p and q, whose diagonal is inverted, (2 * m,). */
API void elastic_eliminate(int64_t n, int64_t m, int64_t entries, const double *restrict jac,
                           const double *restrict primal, const double *restrict dual, double *restrict inverse,
                           double *restrict own_jac, double *restrict own_primal, double *restrict own_dual);

/* Factorise where all goes as it did before; what the problem's own system says of it. */
API int64_t elastic_attempt(const int64_t *calls, int64_t m, const int64_t *own_inertia, int64_t *inertia);

/* The right-hand side without p and q. */
API void elastic_hand_on(int64_t n, int64_t m, int64_t entries, const double *restrict jac,
                         const double *restrict inverse, const double *restrict rhs, double *restrict own_rhs);

/* The solution with p and q. */
API void elastic_complete(int64_t n, int64_t m, int64_t entries, const double *restrict jac,
                          const double *restrict inverse, const double *restrict rhs,
                          const double *restrict own_solution, double *restrict solution);

/* Rows that are left, and the objective with the others. */
API void elastic_take_values(int64_t m, const int64_t *restrict kept, int64_t count,
                             const int64_t *restrict product, const double *restrict all_f,
                             const double *restrict all_r, double *restrict f, double *restrict r);

/* Those of rows that are left as they are, those of products the factor of the objective. */
API void elastic_give_multipliers(int64_t m, const int64_t *restrict kept, int64_t count,
                                  const int64_t *restrict product, const double *restrict y,
                                  const double *restrict weight, double *restrict all_y);

/* The Jacobian of rows that are left, and the gradient with the others. */
API void elastic_take_derivatives(int64_t n, int64_t entries, const int64_t *restrict kept, int64_t count,
                                  const int64_t *restrict product, const int64_t *restrict cols,
                                  const double *restrict all_gradient, const double *restrict all_jac,
                                  double *restrict gradient, double *restrict jac);

#endif
