/* The optimality conditions at a point: as stated, and as a projection equation; and Newton's system for the latter. */
#include "active_set.h"
#include "iteration.h"

/* Bounds beyond this are none. */
#define NO_BOUND 1e+300

/* Violation of the bounds, relative to max(1, |bound|). */
ALWAYS_INLINE double overstepped(double value, double lower, double upper) {
    double worst = 0.0;
    if (lower > -NO_BOUND) worst = nanmax(worst, (lower - value) / nanmax(1.0, fabs(lower)));
    if (upper < NO_BOUND) worst = nanmax(worst, (value - upper) / nanmax(1.0, fabs(upper)));
    return worst;
}

/* Multiplier times the distance to its bound; far bounds count as near. */
ALWAYS_INLINE double product(double multiplier, double value, double lower, double upper) {
    double slack = multiplier > 0.0 ? upper - value : value - lower;
    return fabs(multiplier * nanmin(nanmax(slack, 0.0), 1.0));
}

void conditions_state(primal_dual *p, int64_t given) {
    const program *nlp = p->nlp;
    int64_t n = nlp->n, m = nlp->m;
    const double *restrict x = p->x, *restrict y = p->y, *restrict r = p->r, *restrict gradient = p->gradient;
    const double *restrict jac = p->jac, *restrict x_lower = nlp->x_lower, *restrict x_upper = nlp->x_upper;
    const double *restrict row_lower = nlp->row_lower, *restrict row_upper = nlp->row_upper;
    double *restrict z = p->z, *restrict lagrangian = p->lagrangian;
    double term = 0.0;
    double check = 0.0;
    double most = 0.0;
#pragma omp simd reduction(+ : check) reduction(highest : most)
    for (int64_t i = 0; i < n; i++) {
        double value = gradient[i];
        lagrangian[i] = value;
        most = nanmax(most, fabs(value));
        check += value * 0.0;
    }
    p->largest_gradient = most + check;
    for (int64_t e = 0; e < nlp->jac_entries; e++) {
        double value = jac[e] * y[nlp->jac_rows[e]];
        lagrangian[nlp->jac_cols[e]] += value;
        term = nanmax(term, fabs(value));
        check += value * 0.0;
    }
    p->largest_term = term + check;
    double total = 0.0;
    double stationarity = 0.0;
    double complementarity = 0.0;
    double violation = 0.0;
    double largest = 0.0;
#pragma omp simd reduction(+ : total, check) reduction(highest : largest, stationarity, complementarity, violation)
    for (int64_t i = 0; i < n; i++) {
        double slope = lagrangian[i];
        double multiplier = z[i];
        if (given == 0) {
            double room = slope > 0.0 ? x[i] - x_lower[i] : x_upper[i] - x[i];
            multiplier = room < 1.0 || x_lower[i] == x_upper[i] ? -slope : 0.0;
            z[i] = multiplier;
        }
        total += fabs(multiplier);
        largest = nanmax(largest, fabs(multiplier));
        stationarity = nanmax(stationarity, fabs(slope + multiplier));
        complementarity = nanmax(complementarity, product(multiplier, x[i], x_lower[i], x_upper[i]));
        double worst = overstepped(x[i], x_lower[i], x_upper[i]);
        check += x[i] * 0.0;
        violation = nanmax(violation, worst);
    }
#pragma omp simd reduction(+ : total, check) reduction(highest : complementarity, violation)
    for (int64_t k = 0; k < m; k++) {
        total += fabs(y[k]);
        complementarity = nanmax(complementarity, product(y[k], r[k], row_lower[k], row_upper[k]));
        double worst = overstepped(r[k], row_lower[k], row_upper[k]);
        check += r[k] * 0.0;
        violation = nanmax(violation, worst);
    }
    p->stationarity = stationarity + check;
    p->complementarity = complementarity;
    p->violation = violation + check;
    p->largest_multiplier = largest;
    p->multipliers = total;
}

/* grad f + J^T y. */
static void gradient_of_lagrangian(primal_dual *p) {
    const program *nlp = p->nlp;
    const double *restrict jac = p->jac, *restrict y = p->y;
    double *restrict out = p->lagrangian;
    point_copy(nlp->n, p->gradient, out);
    for (int64_t e = 0; e < nlp->jac_entries; e++) out[nlp->jac_cols[e]] += jac[e] * y[nlp->jac_rows[e]];
}

void conditions_balance(primal_dual *p, const double *restrict balanced) {
    const program *nlp = p->nlp;
    int64_t n = nlp->n, m = nlp->m;
    const double *restrict x = p->x, *restrict y = p->y, *restrict r = p->r, *restrict lagrangian = p->lagrangian;
    const double *restrict x_lower = nlp->x_lower, *restrict x_upper = nlp->x_upper;
    const double *restrict row_lower = nlp->row_lower, *restrict row_upper = nlp->row_upper;
    double *restrict z = p->z;
    gradient_of_lagrangian(p);
    double check = 0.0;
    double total = 0.0;
    double dual = 0.0;
#pragma omp simd reduction(+ : check, total) reduction(highest : dual)
    for (int64_t i = 0; i < n; i++) {
        double slope = lagrangian[i];
        check += slope * 0.0;
        double multiplier = balanced[i] != 0.0 ? -slope : z[i];
        z[i] = multiplier;
        total += fabs(multiplier);
        dual = nanmax(dual, fabs(slope + multiplier));
        if (multiplier != 0.0) dual = nanmax(dual, product(multiplier, x[i], x_lower[i], x_upper[i]));
    }
    double violation = 0.0;
#pragma omp simd reduction(+ : total, check) reduction(highest : dual, violation)
    for (int64_t k = 0; k < m; k++) {
        total += fabs(y[k]);
        if (y[k] != 0.0) dual = nanmax(dual, product(y[k], r[k], row_lower[k], row_upper[k]));
        violation = nanmax(violation, nanmax(row_lower[k] - r[k], r[k] - row_upper[k]));
        check += r[k] * 0.0;
    }
    p->violation = violation;
    p->stationarity = dual + check;
    p->multipliers = total;
}

/* The largest violation and dual residual, and the sum of multipliers, of some conditions. */
typedef struct {
    double primal, dual, total;
} parts;

/* Where each value ends when pushed and clipped, and which ones are clipped.
 *
 * A push away from the bound nearby leaves that bound; it does not reach the one on the other side. fixed ones
 * are active always. The push is minus the gradient of variables, or the multiplier of rows. */
static parts project(int64_t count, bool gradient, const double *restrict value, const double *restrict push,
                     const double *restrict lower, const double *restrict upper, const double *restrict fixed,
                     double *restrict target, double *restrict active) {
    double primal = 0.0;
    double dual = 0.0;
    double total = 0.0;
    double check = 0.0;
    for (int64_t k = 0; k < count; k++) {
        double low = lower[k];
        double high = upper[k];
        double v = value[k];
        double p = gradient ? -push[k] : push[k];
        double pushed = v + p;
        double goal = nanmin(nanmax(pushed, low), high);
        double clipped = 0.0;
        if (pushed < low || pushed > high) {
            clipped = 1.0;
            if (low < high) {
                if (p > 0.0) {
                    if (pushed > high && v - low < high - v) clipped = 0.0;
                } else if (pushed < low && high - v < v - low) {
                    clipped = 0.0;
                }
            }
        }
        if (fixed[k] != 0.0) clipped = 1.0;
        active[k] = clipped;
        target[k] = goal;
        check += pushed * 0.0;
        if (clipped != 0.0)
            primal = nanmax(primal, fabs(v - goal));
        else
            dual = nanmax(dual, fabs(p));
        if (clipped != 0.0 || !gradient) total += fabs(p);
    }
    return (parts){primal + check, dual + check, total};
}

int64_t conditions_project(primal_dual *p) {
    const program *nlp = p->nlp;
    int64_t n = nlp->n, m = nlp->m;
    gradient_of_lagrangian(p);
    parts of_x = project(n, true, p->x, p->lagrangian, nlp->x_lower, nlp->x_upper, nlp->held, p->x_target, p->active_x);
    parts rows = project(m, false, p->r, p->y, nlp->row_lower, nlp->row_upper, nlp->equality, p->row_target, p->active_rows);
    double dual = dmax(of_x.dual, rows.dual);
    double scale = point_multiplier_scale(of_x.total + rows.total, n + m);
    p->error = dmax(dmax(of_x.primal, rows.primal), dual / scale);
    double check = p->error + of_x.dual + rows.dual + p->derivatives_status[0];
    return check - check == 0.0 ? 0 : 1;
}

void conditions_restrict(primal_dual *p) {
    const program *nlp = p->nlp;
    const linear_system *kkt = p->kkt;
    int64_t n = nlp->n, m = nlp->m;
    const double *restrict jac = p->jac, *restrict hess = p->hess, *restrict active_x = p->active_x;
    const double *restrict active_rows = p->active_rows, *restrict lagrangian = p->lagrangian;
    double *restrict dx = p->dx, *restrict dy = p->dy, *restrict rhs = kkt->rhs, *restrict out_hess = kkt->hess;
    double moved = 0.0;
#pragma omp simd reduction(highest : moved)
    for (int64_t i = 0; i < n; i++) {
        dx[i] = active_x[i] != 0.0 ? p->x_target[i] - p->x[i] : 0.0;
        rhs[i] = -lagrangian[i];
        moved = nanmax(moved, fabs(dx[i]));
    }
    double pulled = 0.0;
    for (int64_t k = 0; k < m; k++) {
        dy[k] = active_rows[k] != 0.0 ? 0.0 : -p->y[k];
        rhs[n + k] = active_rows[k] != 0.0 ? p->row_target[k] - p->r[k] : 0.0;
        pulled = nanmax(pulled, fabs(dy[k]));
    }
    double high = 0.0;
#pragma omp simd reduction(highest : high)
    for (int64_t e = 0; e < nlp->hess_entries; e++) {
        out_hess[e] = hess[e];
        high = nanmax(high, fabs(hess[e]));
    }
    p->largest_curvature = high;
    point_copy(nlp->jac_entries, jac, kkt->jac);
    if (moved > 0.0) {
        for (int64_t e = 0; e < nlp->hess_entries; e++) {
            int64_t i = nlp->hess_rows[e];
            int64_t j = nlp->hess_cols[e];
            rhs[i] -= hess[e] * dx[j];
            if (i != j) rhs[j] -= hess[e] * dx[i];
        }
    }
    if (moved > 0.0 || pulled > 0.0) {
        for (int64_t e = 0; e < nlp->jac_entries; e++) {
            int64_t k = nlp->jac_rows[e];
            int64_t i = nlp->jac_cols[e];
            rhs[i] -= jac[e] * dy[k];
            rhs[n + k] -= jac[e] * dx[i] * active_rows[k];
        }
    }
    for (int64_t i = 0; i < n; i++)
        if (active_x[i] != 0.0) rhs[i] = 0.0;
}

void conditions_restricted_diagonals(primal_dual *p, double shift_x, double shift_y, double firm) {
    const program *nlp = p->nlp;
    double *restrict primal = p->kkt->primal, *restrict dual = p->kkt->dual;
    for (int64_t i = 0; i < nlp->n; i++)
        primal[i] = p->active_x[i] == 0.0 ? shift_x : nlp->held[i] != 0.0 ? 1.0 : firm;
    for (int64_t k = 0; k < nlp->m; k++) {
        double active = nlp->equality[k] != 0.0 ? shift_y : nanmax(NOTHING, shift_y);
        dual[k] = p->active_rows[k] == 0.0 ? 1.0 / (NOTHING * NOTHING) : active;
    }
}

double conditions_respond(const primal_dual *p, const double *restrict d, const double *restrict y,
                          double *restrict pull, double *restrict moved) {
    const program *nlp = p->nlp;
    const double *restrict jac = p->jac, *restrict hess = p->hess, *restrict gradient = p->gradient;
    double check = 0.0;
#pragma omp simd reduction(+ : check)
    for (int64_t i = 0; i < nlp->n; i++) {
        pull[i] = -gradient[i];
        check += d[i] * 0.0;
    }
#pragma omp simd reduction(+ : check)
    for (int64_t k = 0; k < nlp->m; k++) {
        moved[k] = 0.0;
        check += y[k] * 0.0;
    }
    for (int64_t e = 0; e < nlp->hess_entries; e++) {
        int64_t i = nlp->hess_rows[e];
        int64_t j = nlp->hess_cols[e];
        pull[i] -= hess[e] * d[j];
        if (i != j) pull[j] -= hess[e] * d[i];
    }
    for (int64_t e = 0; e < nlp->jac_entries; e++) {
        int64_t k = nlp->jac_rows[e];
        int64_t i = nlp->jac_cols[e];
        pull[i] -= jac[e] * y[k];
        moved[k] += jac[e] * d[i];
    }
    return check;
}

void conditions_remain(primal_dual *p) {
    int64_t n = p->nlp->n;
    double *rhs = p->kkt->rhs;
    for (int64_t i = 0; i < n; i++) {
        p->dx[i] = 0.0;
        rhs[i] = -p->lagrangian[i] * (1.0 - p->active_x[i]);
    }
    for (int64_t k = 0; k < p->nlp->m; k++) {
        p->dy[k] = 0.0;
        rhs[n + k] = (p->row_target[k] - p->r[k]) * p->active_rows[k];
    }
}

int64_t conditions_advance(primal_dual *p, const primal_dual *next) {
    int64_t n = p->nlp->n, m = p->nlp->m;
    const double *restrict active_x = p->active_x, *restrict active_rows = p->active_rows, *restrict x = p->x;
    const double *restrict y = p->y, *restrict dx = p->dx, *restrict dy = p->dy;
    const double *restrict lower = p->nlp->x_lower, *restrict upper = p->nlp->x_upper;
    const double *restrict solution = p->kkt->solution;
    double *restrict next_x = next->x, *restrict next_y = next->y;
    double largest = 0.0;
    double check = 0.0;
#pragma omp simd reduction(+ : check) reduction(highest : largest)
    for (int64_t i = 0; i < n; i++) {
        double change = dx[i] + solution[i] * (1.0 - active_x[i]);
        largest = nanmax(largest, fabs(change));
        check += change * 0.0;
        next_x[i] = nanmin(nanmax(x[i] + change, lower[i]), upper[i]);
    }
#pragma omp simd reduction(+ : check)
    for (int64_t k = 0; k < m; k++) {
        double change = dy[k] + solution[n + k] * active_rows[k];
        check += change * 0.0;
        next_y[k] = y[k] + change;
    }
    p->change = largest;
    return check == 0.0;
}
