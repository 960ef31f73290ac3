/* Points of the iteration, compiled: each pass goes once over the vectors and leaves a few numbers.
 *
 * Those that find the step from one point to the next are in step.h.
 *
 * Vectors are those of stc.solver.workspace.Workspace, s is its array of numbers (state.h).
 * index, sign, kind, free and moving describe the form of the problem (stc.solver.formulation),
 * start, order and rows the columns of J (column_times):
 * rows are equalities, inequalities or ignored (EQUALITY, INEQUALITY, IGNORED).
 *
 * Products with long vectors and sparse matrices in coordinate form, compiled, on one thread.
 *
 * BLAS is not asked for dot products: it wakes its threads for vectors of ten thousand entries, which takes longer than
 * the product and keeps the other core from those who need it. */
#include "../native.h"
#include "kernels.h"
#include "state.h"

/* Products of gaps between these are collected before their logarithm is taken. */
#define UNDERFLOW 1e-140
#define OVERFLOW 1e+140
/* See multiplier_scale. */
#define MEAN_MULTIPLIER 100.0
#define LARGEST_MULTIPLIER 1000.0
/* Gap multipliers stay within this factor of mu / gap. */
#define NEAR_CENTRE 10000000000.0

double kernels_log_sum(int64_t count, const double *restrict values) {
    double total = 0.0;
    double product = 1.0;
    for (int64_t k = 0; k < count; k++) {
        double value = values[k];
        if (!(value > 0.0)) return value * 0.0 / 0.0;
        if (value < UNDERFLOW || value > OVERFLOW) {
            total += log(value);
        } else {
            product *= value;
            if (product < UNDERFLOW || product > OVERFLOW) {
                total += log(product);
                product = 1.0;
            }
        }
    }
    return total + log(product);
}

double kernels_multiplier_scale(double total, int64_t count) {
    return nanmin(nanmax(total / imax(count, 1) / MEAN_MULTIPLIER, 1.0), LARGEST_MULTIPLIER);
}

void kernels_measure(int64_t size, int64_t m, int64_t gaps, double unit, const int64_t *restrict index,
                     const double *restrict sign, const double *restrict mu, const double *restrict w,
                     const double *restrict y, const double *restrict z, const double *restrict gap,
                     const double *restrict c, const double *restrict dual, double *restrict residual,
                     double *restrict s) {
    s[STATED] = s[OBJECTIVE] / unit;
    double z_sum = 0.0;
    double products = 0.0;
    double largest = 0.0;
    double target = mu[0];
#pragma omp simd reduction(+ : z_sum, products) reduction(highest : largest)
    for (int64_t k = 0; k < gaps; k++) {
        double product = gap[k] * z[k];
        z_sum += z[k];
        products += product;
        largest = nanmax(largest, fabs(product - target));
    }
    s[COMPLEMENTARITY] = largest + products * 0.0;
    s[Z_SUM] = z_sum;
    s[PRODUCTS] = products;
    for (int64_t i = 0; i < size; i++) residual[i] = dual[i];
    for (int64_t k = 0; k < gaps; k++) residual[index[k]] -= sign[k] * z[k];
    largest = 0.0;
    double squared = 0.0;
    double far = 0.0;
    double check = 0.0;
#pragma omp simd reduction(+ : squared, check) reduction(highest : largest, far)
    for (int64_t i = 0; i < size; i++) {
        double value = residual[i];
        largest = nanmax(largest, fabs(value));
        squared += value * value;
        check += value * 0.0;
        far = nanmax(far, fabs(w[i]));
    }
    s[DUAL] = largest + check;
    s[DUAL_SQUARED] = squared;
    s[FARTHEST] = far;
    largest = 0.0;
    squared = 0.0;
    double y_sum = 0.0;
    check = 0.0;
#pragma omp simd reduction(+ : squared, check, y_sum) reduction(highest : largest)
    for (int64_t r = 0; r < m; r++) {
        double value = c[r];
        largest = nanmax(largest, fabs(value));
        squared += value * value;
        check += value * 0.0;
        y_sum += fabs(y[r]);
    }
    s[PRIMAL] = largest + check;
    s[PRIMAL_SQUARED] = squared;
    s[Y_SUM] = y_sum;
    s[DUAL_ERROR] = s[DUAL] / kernels_multiplier_scale(y_sum + z_sum, m + gaps);
    s[GAP_ERROR] = s[COMPLEMENTARITY] / kernels_multiplier_scale(z_sum, gaps);
    s[ERROR] = nanmax(nanmax(s[DUAL_ERROR], s[PRIMAL]), s[GAP_ERROR]);
}

void kernels_overstepped(int64_t row_count, const int64_t *restrict row_places, const double *restrict row_limits,
                         const double *restrict row_units, const double *restrict r, int64_t x_count,
                         const int64_t *restrict x_places, const double *restrict x_limits,
                         const double *restrict x_units, const double *restrict x, double *restrict out) {
    double worst = 0.0;
    double check = 0.0;
#pragma omp simd reduction(+ : check) reduction(highest : worst)
    for (int64_t k = 0; k < row_count; k++) {
        double value = r[row_places[k]];
        check += value * 0.0;
        worst = nanmax(worst, (row_limits[k] - value) * row_units[k]);
    }
#pragma omp simd reduction(highest : worst)
    for (int64_t k = 0; k < x_count; k++) worst = nanmax(worst, (x_limits[k] - x[x_places[k]]) * x_units[k]);
    out[0] = check == 0.0 ? worst : INFINITY;
}

void kernels_copy(int64_t count, const double *restrict source, double *restrict target) {
    for (int64_t i = 0; i < count; i++) target[i] = source[i];
}

void kernels_place(int64_t n, int64_t size, const double *restrict alpha, const double *restrict w,
                   const double *restrict dw, double *restrict trial, double *restrict x) {
    for (int64_t i = 0; i < size; i++) trial[i] = w[i] + alpha[0] * dw[i];
    for (int64_t i = 0; i < n; i++) x[i] = trial[i];
}

void kernels_inspect(int64_t n, int64_t m, int64_t gaps, const int64_t *restrict index, const double *restrict sign,
                     const double *restrict bound, const int32_t *restrict kind, const double *restrict w,
                     const double *restrict r, double *restrict gap, double *restrict c, double *restrict s) {
    double theta = 0.0;
#pragma omp simd reduction(+ : theta)
    for (int64_t k = 0; k < m; k++) {
        double value = r[k] - w[n + k];
        value = kind[k] == IGNORED ? 0.0 : value;
        c[k] = value;
        theta += fabs(value);
    }
    double smallest = 1e+300;
#pragma omp simd reduction(lowest : smallest)
    for (int64_t k = 0; k < gaps; k++) {
        double value = sign[k] * (w[index[k]] - bound[k]);
        gap[k] = value;
        smallest = nanmin(smallest, value);
    }
    s[TRIAL_THETA] = theta;
    s[TRIAL_GAP] = smallest;
    s[TRIAL_LOGARITHMS] = kernels_log_sum(gaps, gap);
}

/* A column of J times y: its entries are jac[order[k]], in row rows[k], for k from begin on. */
ALWAYS_INLINE double column_times(int64_t begin, int64_t end, const int32_t *restrict order,
                                  const int32_t *restrict rows, const double *restrict jac,
                                  const double *restrict y) {
    double total = 0.0;
    for (int64_t k = begin; k < end; k++) total += jac[order[k]] * y[rows[k]];
    return total;
}

void kernels_blend(int64_t n, int64_t m, int64_t gaps, const int64_t *restrict index, const double *restrict sign,
                   const double *restrict shifts, const double *restrict moving, const int32_t *restrict start,
                   const int32_t *restrict order, const int32_t *restrict rows, const double *restrict jac,
                   const double *restrict alpha, const double *restrict shifted, const double *restrict mu,
                   const double *restrict residual, const double *restrict dw, const double *restrict dy,
                   const double *restrict dz, const double *restrict y, const double *restrict z,
                   const double *restrict trial_gap, double *restrict left, double *restrict turn,
                   double *restrict trial_y, double *restrict trial_z, double *restrict evaluated_y,
                   const double *restrict s) {
    double primal = alpha[0];
    double dual = s[DUAL_STEP];
    double fraction = primal;
    if (primal != dual || shifted[0] != 0.0) {
        for (int64_t i = 0; i < n; i++) turn[i] = column_times(start[i], start[i + 1], order, rows, jac, dy);
        for (int64_t r = 0; r < m; r++) turn[n + r] = -dy[r];
        for (int64_t i = 0; i < n + m; i++) left[i] = 0.0;
        for (int64_t k = 0; k < gaps; k++) left[index[k]] += sign[k] * dz[k];
        for (int64_t i = 0; i < n + m; i++) {
            turn[i] *= moving[i];
            left[i] = (1.0 - primal) * residual[i] + (primal - dual) * left[i];
        }
        for (int64_t i = 0; i < n; i++) left[i] -= primal * shifted[0] * shifts[i] * dw[i];
        double length = 0.0;
        double product = 0.0;
#pragma omp simd reduction(+ : length, product)
        for (int64_t i = 0; i < n + m; i++) {
            length += turn[i] * turn[i];
            product += left[i] * turn[i];
        }
        if (length != 0.0) fraction = nanmin(nanmax(primal - product / length, 0.0), 1.0);
    }
    for (int64_t r = 0; r < m; r++) {
        trial_y[r] = y[r] + fraction * dy[r];
        evaluated_y[r] = trial_y[r];
    }
    for (int64_t k = 0; k < gaps; k++) {
        double value = z[k] + dual * dz[k];
        double centre = mu[0] / trial_gap[k];
        trial_z[k] = nanmin(nanmax(value, centre / NEAR_CENTRE), NEAR_CENTRE * centre);
    }
}

/* dual = (grad f + J^T y, -y); 0, or nan where a derivative, of which status tells, is not finite. */
static double lagrangian(int64_t n, int64_t m, const double *restrict moving, const int32_t *restrict start,
                         const int32_t *restrict order, const int32_t *restrict rows, const double *restrict y,
                         const double *restrict gradient, const double *restrict jac, const double *restrict status,
                         double *restrict dual) {
    double check = status[0];
    for (int64_t i = 0; i < n; i++)
        dual[i] = gradient[i] + column_times(start[i], start[i + 1], order, rows, jac, y);
    for (int64_t r = 0; r < m; r++) dual[n + r] = -y[r];
#pragma omp simd reduction(+ : check)
    for (int64_t i = 0; i < n + m; i++) {
        dual[i] *= moving[i];
        check += dual[i] * 0.0;
    }
    return check;
}

void kernels_move(int64_t n, int64_t m, int64_t gaps, const double *restrict moving, const int32_t *restrict start,
                  const int32_t *restrict order, const int32_t *restrict rows, const double *restrict gradient,
                  const double *restrict jac, const double *restrict status, const double *restrict trial_w,
                  const double *restrict trial_y, const double *restrict trial_z, const double *restrict trial_f,
                  const double *restrict trial_r, const double *restrict trial_gap, const double *restrict trial_c,
                  double *restrict trial_dual, double *restrict w, double *restrict y, double *restrict z,
                  double *restrict r, double *restrict gap, double *restrict c, double *restrict dual,
                  double *restrict s) {
    double check = lagrangian(n, m, moving, start, order, rows, trial_y, gradient, jac, status, trial_dual);
    if (check != 0.0) {
        s[MOVED] = 0.0;
        return;
    }
    s[MOVED] = 1.0;
    double step = 0.0;
#pragma omp simd reduction(highest : step)
    for (int64_t i = 0; i < n + m; i++) {
        step = nanmax(step, fabs(trial_w[i] - w[i]) / (1.0 + fabs(w[i])));
        w[i] = trial_w[i];
        dual[i] = trial_dual[i];
    }
    for (int64_t k = 0; k < m; k++) {
        y[k] = trial_y[k];
        r[k] = trial_r[k];
        c[k] = trial_c[k];
    }
    for (int64_t k = 0; k < gaps; k++) {
        z[k] = trial_z[k];
        gap[k] = trial_gap[k];
    }
    s[STEP] = step;
    s[OBJECTIVE] = trial_f[0];
    s[THETA] = s[TRIAL_THETA];
    s[LOGARITHMS] = s[TRIAL_LOGARITHMS];
}

void kernels_adopt(int64_t n, int64_t m, const double *restrict moving, const int32_t *restrict start,
                   const int32_t *restrict order, const int32_t *restrict rows, const double *restrict y,
                   const double *restrict gradient, const double *restrict jac, const double *restrict status,
                   double *restrict dual, const double *restrict f, double *restrict s) {
    lagrangian(n, m, moving, start, order, rows, y, gradient, jac, status, dual);
    s[OBJECTIVE] = f[0];
    s[THETA] = s[TRIAL_THETA];
    s[LOGARITHMS] = s[TRIAL_LOGARITHMS];
}

void kernels_push_inside(int64_t size, double push, const double *restrict lower, const double *restrict upper,
                         double *restrict w) {
    for (int64_t i = 0; i < size; i++) {
        double low = lower[i];
        double high = upper[i];
        double span = high - low;
        if (low > -INFINITY) low += push * dmin(dmax(1.0, fabs(low)), span);
        if (high < INFINITY) high -= push * dmin(dmax(1.0, fabs(high)), span);
        w[i] = dmin(dmax(w[i], low), high);
    }
}

void kernels_times(int64_t count, const int64_t *restrict rows, const int64_t *restrict cols,
                   const double *restrict values, const double *restrict v, double *restrict out) {
    for (int64_t e = 0; e < count; e++) out[rows[e]] += values[e] * v[cols[e]];
}

void kernels_symmetric_times(int64_t count, const int64_t *restrict rows, const int64_t *restrict cols,
                             const double *restrict values, const double *restrict v, double *restrict out) {
    for (int64_t e = 0; e < count; e++) {
        int64_t i = rows[e];
        int64_t j = cols[e];
        out[i] += values[e] * v[j];
        if (i != j) out[j] += values[e] * v[i];
    }
}
