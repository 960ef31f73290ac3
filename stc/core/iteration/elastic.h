/* The elastic form of a problem (stc/solver/elastic.py), and programs whose complementary products
 * are a penalty (stc/solver/penalised.py).
 *
 * Unknowns are those of the problem, then p and q, (m) each; entries of the Jacobian those of the problem, then the
 * columns of p and q. */
#ifndef STC_ELASTIC_H
#define STC_ELASTIC_H

#include "iteration.h"

/* price * sum(p + q) + 1/2 * curvature * |x - reference|^2, rows r(x) - p + q. */
typedef API_STRUCT {
    int64_t n, m, jac_entries;          /* of the problem */
    double price;
    const double *free;                 /* 1 for variables that may change, (n) */
    const double *curvature, *reference;
    const evaluation *own, *at;         /* of the problem, and of its elastic form */
} elastic_program;

API void elastic_values(elastic_program *e);
/* But for the parts of p and q, which are constant. */
API void elastic_derivatives(elastic_program *e);

/* Rows that are left, and the objective with the others. */
API void elastic_take_values(int64_t m, const int64_t *kept, int64_t count, const int64_t *product,
                             const double *all_f, const double *all_r, double *f, double *r);
/* Those of rows that are left as they are, those of products the factor of the objective. */
API void elastic_give_multipliers(int64_t m, const int64_t *kept, int64_t count, const int64_t *product,
                                  const double *y, const double *weight, double *all_y);
/* The Jacobian of rows that are left, and the gradient with the others. */
API void elastic_take_derivatives(int64_t n, int64_t entries, const int64_t *kept, int64_t count,
                                  const int64_t *product, const int64_t *cols, const double *all_gradient,
                                  const double *all_jac, double *gradient, double *jac);

#endif
