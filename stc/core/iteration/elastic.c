/* The elastic form of a problem, and penalties: see elastic.h. */
#include "elastic.h"

void elastic_values(elastic_program *e) {
    int64_t n = e->n, m = e->m;
    const double *restrict x = e->at->x, *restrict own_r = e->own->r;
    double *restrict r = e->at->r;
    double away = 0.0;
#pragma omp simd reduction(+ : away)
    for (int64_t k = 0; k < n; k++) {
        double way = x[k] - e->reference[k];
        away += e->curvature[k] * way * way;
    }
    double total = 0.0;
#pragma omp simd reduction(+ : total)
    for (int64_t k = 0; k < m; k++) {
        double p = x[n + k];
        double q = x[n + m + k];
        r[k] = own_r[k] - p + q;
        total += p + q;
    }
    e->at->f[0] = e->price * total + 0.5 * away;
    e->at->values_status[0] = e->own->values_status[0] + 0.0 * e->at->f[0];
}

void elastic_derivatives(elastic_program *e) {
    for (int64_t k = 0; k < e->n; k++)
        e->at->gradient[k] = e->free[k] * e->curvature[k] * (e->at->x[k] - e->reference[k]);
    point_copy(e->jac_entries, e->own->jac, e->at->jac);
}

void elastic_take_values(int64_t m, const int64_t *restrict kept, int64_t count, const int64_t *restrict product,
                         const double *restrict all_f, const double *restrict all_r, double *restrict f,
                         double *restrict r) {
    double total = 0.0;
    for (int64_t k = 0; k < count; k++) total += all_r[product[k]];
    f[0] = all_f[0] + total;
    for (int64_t k = 0; k < m; k++) r[k] = all_r[kept[k]];
}

void elastic_give_multipliers(int64_t m, const int64_t *restrict kept, int64_t count,
                              const int64_t *restrict product, const double *restrict y,
                              const double *restrict weight, double *restrict all_y) {
    for (int64_t k = 0; k < count; k++) all_y[product[k]] = weight[0];
    for (int64_t k = 0; k < m; k++) all_y[kept[k]] = y[k];
}

void elastic_take_derivatives(int64_t n, int64_t entries, const int64_t *restrict kept, int64_t count,
                              const int64_t *restrict product, const int64_t *restrict cols,
                              const double *restrict all_gradient, const double *restrict all_jac,
                              double *restrict gradient, double *restrict jac) {
    for (int64_t i = 0; i < n; i++) gradient[i] = all_gradient[i];
    for (int64_t e = 0; e < count; e++) gradient[cols[e]] += all_jac[product[e]];
    for (int64_t e = 0; e < entries; e++) jac[e] = all_jac[kept[e]];
}
