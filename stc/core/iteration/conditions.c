/* The optimality conditions at a point, compiled: as stated, and as a projection equation. */
#include "../native.h"
#include "conditions.h"

/* Places in the results of stated_conditions. */
enum {
    STATIONARITY = 0,
    CONDITIONS_COMPLEMENTARITY = 1,
    CONDITIONS_VIOLATION = 2,
    GRADIENT = 3, /* largest entries, and sums of multipliers */
    TERM = 4,
    MULTIPLIER = 5,
    SUM = 6,
};
/* Bounds beyond this are none. */
#define NONE 1e+300
/* Places in the results of point_conditions. */
enum {
    POINT_VIOLATION = 0,
    POINT_DUAL = 1,
    POINT_SUM = 2,
};

/* Violation of the bounds, relative to max(1, |bound|). */
ALWAYS_INLINE double overstepped(double value, double lower, double upper) {
    double worst = 0.0;
    if (lower > -NONE) worst = nanmax(worst, (lower - value) / nanmax(1.0, fabs(lower)));
    if (upper < NONE) worst = nanmax(worst, (value - upper) / nanmax(1.0, fabs(upper)));
    return worst;
}

/* Multiplier times the distance to its bound; far bounds count as near. */
ALWAYS_INLINE double product(double multiplier, double value, double lower, double upper) {
    double slack = multiplier > 0.0 ? upper - value : value - lower;
    return fabs(multiplier * nanmin(nanmax(slack, 0.0), 1.0));
}

void conditions_stated_conditions(int64_t n, int64_t m, int64_t entries, int64_t given, const double *restrict x,
                                  const double *restrict y, double *restrict z, const double *restrict r,
                                  const double *restrict gradient, const int32_t *restrict rows,
                                  const int32_t *restrict cols, const double *restrict jac,
                                  const double *restrict x_lower, const double *restrict x_upper,
                                  const double *restrict row_lower, const double *restrict row_upper,
                                  double *restrict lagrangian, double *restrict out) {
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
    out[GRADIENT] = most + check;
    for (int64_t e = 0; e < entries; e++) {
        double value = jac[e] * y[rows[e]];
        lagrangian[cols[e]] += value;
        term = nanmax(term, fabs(value));
        check += value * 0.0;
    }
    out[TERM] = term + check;
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
    out[STATIONARITY] = stationarity + check;
    out[CONDITIONS_COMPLEMENTARITY] = complementarity;
    out[CONDITIONS_VIOLATION] = violation + check;
    out[MULTIPLIER] = largest;
    out[SUM] = total;
}

void conditions_project_entries(int64_t count, int64_t gradient, const double *restrict value,
                                const double *restrict push, const double *restrict lower,
                                const double *restrict upper, const double *restrict fixed, double *restrict target,
                                double *restrict active, double *restrict out) {
    double primal = 0.0;
    double dual = 0.0;
    double total = 0.0;
    double check = 0.0;
    for (int64_t k = 0; k < count; k++) {
        double low = lower[k];
        double high = upper[k];
        double v = value[k];
        double p = gradient != 0 ? -push[k] : push[k];
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
        if (clipped != 0.0 || gradient == 0) total += fabs(p);
    }
    out[0] = primal + check;
    out[1] = dual + check;
    out[2] = total;
}

void conditions_restrict(int64_t n, int64_t m, int64_t entries, int64_t curved, const int64_t *restrict rows,
                         const int64_t *restrict cols, const int64_t *restrict hess_rows,
                         const int64_t *restrict hess_cols, const double *restrict jac, const double *restrict hess,
                         const double *restrict active_x, const double *restrict active_rows,
                         const double *restrict x, const double *restrict y, const double *restrict r,
                         const double *restrict lagrangian, const double *restrict x_target,
                         const double *restrict row_target, double *restrict dx, double *restrict dy,
                         double *restrict out_hess, double *restrict out_jac, double *restrict rhs,
                         double *restrict largest) {
    double moved = 0.0;
#pragma omp simd reduction(highest : moved)
    for (int64_t i = 0; i < n; i++) {
        dx[i] = active_x[i] != 0.0 ? x_target[i] - x[i] : 0.0;
        rhs[i] = -lagrangian[i];
        moved = nanmax(moved, fabs(dx[i]));
    }
    double pulled = 0.0;
    for (int64_t k = 0; k < m; k++) {
        dy[k] = active_rows[k] != 0.0 ? 0.0 : -y[k];
        rhs[n + k] = active_rows[k] != 0.0 ? row_target[k] - r[k] : 0.0;
        pulled = nanmax(pulled, fabs(dy[k]));
    }
    double high = 0.0;
#pragma omp simd reduction(highest : high)
    for (int64_t e = 0; e < curved; e++) {
        out_hess[e] = hess[e];
        high = nanmax(high, fabs(hess[e]));
    }
    largest[0] = high;
    for (int64_t e = 0; e < entries; e++) out_jac[e] = jac[e];
    if (moved > 0.0) {
        for (int64_t e = 0; e < curved; e++) {
            int64_t i = hess_rows[e];
            int64_t j = hess_cols[e];
            rhs[i] -= hess[e] * dx[j];
            if (i != j) rhs[j] -= hess[e] * dx[i];
        }
    }
    if (moved > 0.0 || pulled > 0.0) {
        for (int64_t e = 0; e < entries; e++) {
            int64_t k = rows[e];
            int64_t i = cols[e];
            rhs[i] -= jac[e] * dy[k];
            rhs[n + k] -= jac[e] * dx[i] * active_rows[k];
        }
    }
    for (int64_t i = 0; i < n; i++)
        if (active_x[i] != 0.0) rhs[i] = 0.0;
}

double conditions_respond(int64_t n, int64_t m, int64_t entries, int64_t curved, const int64_t *restrict rows,
                          const int64_t *restrict cols, const int64_t *restrict hess_rows,
                          const int64_t *restrict hess_cols, const double *restrict jac,
                          const double *restrict hess, const double *restrict gradient, const double *restrict d,
                          const double *restrict y, double *restrict pull, double *restrict moved) {
    double check = 0.0;
#pragma omp simd reduction(+ : check)
    for (int64_t i = 0; i < n; i++) {
        pull[i] = -gradient[i];
        check += d[i] * 0.0;
    }
#pragma omp simd reduction(+ : check)
    for (int64_t k = 0; k < m; k++) {
        moved[k] = 0.0;
        check += y[k] * 0.0;
    }
    for (int64_t e = 0; e < curved; e++) {
        int64_t i = hess_rows[e];
        int64_t j = hess_cols[e];
        pull[i] -= hess[e] * d[j];
        if (i != j) pull[j] -= hess[e] * d[i];
    }
    for (int64_t e = 0; e < entries; e++) {
        int64_t k = rows[e];
        int64_t i = cols[e];
        pull[i] -= jac[e] * y[k];
        moved[k] += jac[e] * d[i];
    }
    return check;
}

int64_t conditions_better_signs(int64_t count, double slack, const int32_t *restrict active,
                                const double *restrict equal, const double *restrict move,
                                const double *restrict multiplier, const double *restrict low,
                                const double *restrict high, int32_t *restrict out) {
    int64_t different = 0;
    for (int64_t k = 0; k < count; k++) {
        int64_t now = active[k];
        int64_t new = 0;
        if (equal[k] == 0.0) {
            if (now > 0)
                new = multiplier[k] >= -slack ? now : 0;
            else if (now < 0)
                new = multiplier[k] <= slack ? now : 0;
            else if (move[k] > high[k] + slack)
                new = !(move[k] < low[k] - slack) ? 1 : 0;
            else if (move[k] < low[k] - slack)
                new = -1;
        }
        out[k] = (int32_t)new;
        different += new != now;
    }
    return different;
}

void conditions_gradient_of_lagrangian(int64_t n, int64_t entries, const int64_t *restrict rows,
                                       const int64_t *restrict cols, const double *restrict y,
                                       const double *restrict gradient, const double *restrict jac,
                                       double *restrict out) {
    for (int64_t i = 0; i < n; i++) out[i] = gradient[i];
    for (int64_t e = 0; e < entries; e++) out[cols[e]] += jac[e] * y[rows[e]];
}

void conditions_point_conditions(int64_t n, int64_t m, int64_t entries, const double *restrict balanced,
                                 const int64_t *restrict rows, const int64_t *restrict cols,
                                 const double *restrict x, const double *restrict y, double *restrict z,
                                 const double *restrict r, const double *restrict gradient,
                                 const double *restrict jac, const double *restrict x_lower,
                                 const double *restrict x_upper, const double *restrict row_lower,
                                 const double *restrict row_upper, double *restrict lagrangian,
                                 double *restrict out) {
    conditions_gradient_of_lagrangian(n, entries, rows, cols, y, gradient, jac, lagrangian);
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
    out[POINT_VIOLATION] = violation;
    out[POINT_DUAL] = dual + check;
    out[POINT_SUM] = total;
}

void conditions_restricted_diagonals(int64_t n, int64_t m, double shift_x, double shift_y, double firm,
                                     double loose, double soft, const double *restrict fixed,
                                     const double *restrict equality, const double *restrict active_x,
                                     const double *restrict active_rows, double *restrict primal,
                                     double *restrict dual) {
    for (int64_t i = 0; i < n; i++) primal[i] = active_x[i] == 0.0 ? shift_x : fixed[i] != 0.0 ? 1.0 : firm;
    for (int64_t k = 0; k < m; k++)
        dual[k] = active_rows[k] == 0.0 ? loose : equality[k] != 0.0 ? shift_y : nanmax(soft, shift_y);
}

void conditions_remaining(int64_t n, int64_t m, const double *restrict active_x, const double *restrict active_rows,
                          const double *restrict lagrangian, const double *restrict row_target,
                          const double *restrict r, double *restrict dx, double *restrict dy,
                          double *restrict rhs) {
    for (int64_t i = 0; i < n; i++) {
        dx[i] = 0.0;
        rhs[i] = -lagrangian[i] * (1.0 - active_x[i]);
    }
    for (int64_t k = 0; k < m; k++) {
        dy[k] = 0.0;
        rhs[n + k] = (row_target[k] - r[k]) * active_rows[k];
    }
}

void conditions_advance(int64_t n, int64_t m, const double *restrict active_x, const double *restrict active_rows,
                        const double *restrict x, const double *restrict y, const double *restrict dx,
                        const double *restrict dy, const double *restrict solution, const double *restrict lower,
                        const double *restrict upper, double *restrict next_x, double *restrict next_y,
                        double *restrict out) {
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
    out[0] = largest;
    out[1] = check;
}
