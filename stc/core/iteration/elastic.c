/* The elastic form of a problem and its linear system (stc/solver/elastic.py), and programs whose complementary products
 * are a penalty (stc/solver/penalised.py).
 *
 * Unknowns are those of the problem, (n,), then p and q, (m,) each; entries of the Jacobian those of the problem, then the
 * columns of p and q. */
#include "../native.h"
#include "elastic.h"

/* The calls of an attempt to factorise: what comes before, and the attempt of the problem's own system. */
enum { ELASTIC_ELIMINATE = 0, ELASTIC_ATTEMPT = 1 };

void elastic_values(int64_t n, int64_t m, double price, const double *restrict curvature,
                    const double *restrict reference, const double *restrict own_r,
                    const double *restrict own_status, const double *restrict x, double *restrict f,
                    double *restrict r, double *restrict status) {
    double away = 0.0;
#pragma omp simd reduction(+ : away)
    for (int64_t k = 0; k < n; k++) {
        double way = x[k] - reference[k];
        away += curvature[k] * way * way;
    }
    double total = 0.0;
#pragma omp simd reduction(+ : total)
    for (int64_t k = 0; k < m; k++) {
        double p = x[n + k];
        double q = x[n + m + k];
        r[k] = own_r[k] - p + q;
        total += p + q;
    }
    f[0] = price * total + 0.5 * away;
    status[0] = own_status[0] + 0.0 * f[0];
}

void elastic_derivatives(int64_t n, int64_t entries, const double *restrict free, const double *restrict curvature,
                         const double *restrict reference, const double *restrict own_jac, const double *restrict x,
                         double *restrict gradient, double *restrict jac) {
    for (int64_t k = 0; k < n; k++) gradient[k] = free[k] * curvature[k] * (x[k] - reference[k]);
    for (int64_t k = 0; k < entries; k++) jac[k] = own_jac[k];
}

void elastic_state(double unit, const double *restrict f, double *restrict stated) {
    stated[0] = f[0] / unit;
}

void elastic_eliminate(int64_t n, int64_t m, int64_t entries, const double *restrict jac,
                       const double *restrict primal, const double *restrict dual, double *restrict inverse,
                       double *restrict own_jac, double *restrict own_primal, double *restrict own_dual) {
    for (int64_t k = 0; k < entries; k++) own_jac[k] = jac[k];
    for (int64_t k = 0; k < n; k++) own_primal[k] = primal[k];
    const double *of_p = jac + entries;
    const double *of_q = jac + entries + m;
    for (int64_t k = 0; k < m; k++) {
        inverse[k] = 1.0 / primal[n + k];
        inverse[m + k] = 1.0 / primal[n + m + k];
        own_dual[k] = dual[k] + of_p[k] * of_p[k] * inverse[k] + of_q[k] * of_q[k] * inverse[m + k];
    }
}

int64_t elastic_attempt(const int64_t *calls, int64_t m, const int64_t *own_inertia, int64_t *inertia) {
    invoke(calls, ELASTIC_ELIMINATE);
    int64_t ended = invoke(calls, ELASTIC_ATTEMPT);
    if (ended == 0) {
        inertia[0] = own_inertia[0] + 2 * m;
        inertia[1] = own_inertia[1];
        inertia[2] = own_inertia[2];
    }
    return ended;
}

void elastic_hand_on(int64_t n, int64_t m, int64_t entries, const double *restrict jac,
                     const double *restrict inverse, const double *restrict rhs, double *restrict own_rhs) {
    const double *of_p = jac + entries;
    const double *of_q = jac + entries + m;
    for (int64_t k = 0; k < n; k++) own_rhs[k] = rhs[k];
    for (int64_t k = 0; k < m; k++) {
        double pulls = of_p[k] * inverse[k] * rhs[n + k] + of_q[k] * inverse[m + k] * rhs[n + m + k];
        own_rhs[n + k] = rhs[n + 2 * m + k] - pulls;
    }
}

void elastic_complete(int64_t n, int64_t m, int64_t entries, const double *restrict jac,
                      const double *restrict inverse, const double *restrict rhs,
                      const double *restrict own_solution, double *restrict solution) {
    const double *of_p = jac + entries;
    const double *of_q = jac + entries + m;
    for (int64_t k = 0; k < n; k++) solution[k] = own_solution[k];
    for (int64_t k = 0; k < m; k++) {
        double dy = own_solution[n + k];
        solution[n + k] = inverse[k] * (rhs[n + k] - of_p[k] * dy);
        solution[n + m + k] = inverse[m + k] * (rhs[n + m + k] - of_q[k] * dy);
        solution[n + 2 * m + k] = dy;
    }
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
