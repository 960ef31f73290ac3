/* Points of the iteration: each pass goes once over the vectors and leaves a few numbers. */
#include "iteration.h"

/* Products of gaps between these are collected before their logarithm is taken. */
#define SMALLEST_PRODUCT 1e-140
#define LARGEST_PRODUCT 1e+140
/* See multiplier_scale. */
#define MEAN_MULTIPLIER 100.0
#define LARGEST_MULTIPLIER 1000.0
/* Gap multipliers stay within this factor of mu / gap. */
#define NEAR_CENTRE 10000000000.0

double point_log_sum(int64_t count, const double *values) {
    double total = 0.0;
    double product = 1.0;
    for (int64_t k = 0; k < count; k++) {
        double value = values[k];
        if (!(value > 0.0)) return value * 0.0 / 0.0;
        if (value < SMALLEST_PRODUCT || value > LARGEST_PRODUCT) {
            total += log(value);
        } else {
            product *= value;
            if (product < SMALLEST_PRODUCT || product > LARGEST_PRODUCT) {
                total += log(product);
                product = 1.0;
            }
        }
    }
    return total + log(product);
}

/* Bounded, because multipliers that grow without limit are no sign of optimality. */
double point_multiplier_scale(double total, int64_t count) {
    return nanmin(nanmax(total / imax(count, 1) / MEAN_MULTIPLIER, 1.0), LARGEST_MULTIPLIER);
}

void point_measure(iteration *it, double mu) {
    const formulation *form = it->form;
    const iterate *now = it->now;
    int64_t size = form->size, m = form->m, gaps = form->gaps;
    const int64_t *restrict index = form->index;
    const double *restrict sign = form->sign, *restrict w = now->w, *restrict y = now->y, *restrict z = now->z;
    const double *restrict gap = now->gap, *restrict c = now->c, *restrict dual = now->dual;
    double *restrict residual = it->residual;
    double z_sum = 0.0;
    double products = 0.0;
    double largest = 0.0;
#pragma omp simd reduction(+ : z_sum, products) reduction(highest : largest)
    for (int64_t k = 0; k < gaps; k++) {
        double product = gap[k] * z[k];
        z_sum += z[k];
        products += product;
        largest = nanmax(largest, fabs(product - mu));
    }
    it->complementarity = largest + products * 0.0;
    it->products = products;
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
    it->dual = largest + check;
    it->dual_squared = squared;
    it->farthest = far;
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
    it->primal = largest + check;
    it->primal_squared = squared;
    it->dual_error = it->dual / point_multiplier_scale(y_sum + z_sum, m + gaps);
    it->gap_error = it->complementarity / point_multiplier_scale(z_sum, gaps);
    it->error = nanmax(nanmax(it->dual_error, it->primal), it->gap_error);
}

void point_overstepped(int64_t row_count, const int64_t *restrict row_places, const double *restrict row_limits,
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

void point_copy(int64_t count, const double *restrict source, double *restrict target) {
    for (int64_t i = 0; i < count; i++) target[i] = source[i];
}

/* Gaps, residual of the rows and what the filter asks of a point whose rows r have been evaluated. */
static void inspect(const formulation *form, const double *restrict r, iterate *point) {
    int64_t n = form->n, m = form->m, gaps = form->gaps;
    const int32_t *restrict kind = form->kind;
    const int64_t *restrict index = form->index;
    const double *restrict sign = form->sign, *restrict bound = form->bound, *restrict w = point->w;
    double *restrict gap = point->gap, *restrict c = point->c;
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
    point->theta = theta;
    point->smallest_gap = smallest;
    point->logarithms = point_log_sum(gaps, gap);
}

void point_try(iteration *it) {
    invoke(it->calls, VALUES);
    it->trial->f = it->at->f[0];
    inspect(it->form, it->at->r, it->trial);
}

void point_try_step(iteration *it, double alpha) {
    int64_t n = it->form->n, size = it->form->size;
    const double *restrict w = it->now->w, *restrict dw = it->step->dw;
    double *restrict trial = it->trial->w, *restrict x = it->at->x;
    it->alpha = alpha;
    for (int64_t i = 0; i < size; i++) trial[i] = w[i] + alpha * dw[i];
    for (int64_t i = 0; i < n; i++) x[i] = trial[i];
    point_try(it);
}

/* A column of J times y. */
ALWAYS_INLINE double column_times(int64_t begin, int64_t end, const int32_t *restrict order,
                                  const int32_t *restrict rows, const double *restrict jac,
                                  const double *restrict y) {
    double total = 0.0;
    for (int64_t k = begin; k < end; k++) total += jac[order[k]] * y[rows[k]];
    return total;
}

/* dual = (grad f + J^T y, -y); 0, or nan where a derivative is not finite. */
static double lagrangian(const formulation *form, const evaluation *at, const double *restrict y,
                         double *restrict dual) {
    int64_t n = form->n, m = form->m;
    const int32_t *restrict start = form->column_start, *restrict order = form->column_entry;
    const int32_t *restrict rows = form->column_row;
    const double *restrict moving = form->moving, *restrict gradient = at->gradient, *restrict jac = at->jac;
    double check = at->derivatives_status[0];
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

void point_evaluate(iteration *it) {
    const formulation *form = it->form;
    const evaluation *at = it->at;
    iterate *now = it->now;
    point_copy(form->n, now->w, at->x);
    point_copy(form->m, now->y, at->y);
    invoke(it->calls, VALUES);
    point_copy(form->m, at->r, now->r);
    inspect(form, at->r, now);
    invoke(it->calls, DERIVATIVES);
    lagrangian(form, at, now->y, now->dual);
    now->f = at->f[0];
}

/* Multipliers of the trial point.
 *
 * The rows' multipliers take that fraction of their step that leaves the smallest gradient of the Lagrangian, to
 * first order, when the primal and the dual variables take different fractions of theirs. A shift of the Hessian is
 * no part of the Lagrangian, and a large one shows in dy: it counts as well. */
static void blend(iteration *it) {
    const formulation *form = it->form;
    int64_t n = form->n, m = form->m, gaps = form->gaps;
    const int32_t *restrict start = form->column_start;
    const double *restrict residual = it->residual, *restrict dw = it->step->dw, *restrict dy = it->step->dy;
    const double *restrict dz = it->step->dz, *restrict y = it->now->y, *restrict z = it->now->z;
    const double *restrict trial_gap = it->trial->gap, *restrict moving = form->moving;
    double *restrict left = it->pull, *restrict turn = it->turn;
    double *restrict trial_y = it->trial->y, *restrict trial_z = it->trial->z, *restrict evaluated_y = it->at->y;
    bool shifted = it->shift != 0.0 && form->any_equality != 0;
    double primal = it->alpha;
    double dual = it->dual_step;
    double fraction = primal;
    if (primal != dual || shifted) {
        for (int64_t i = 0; i < n; i++)
            turn[i] = column_times(start[i], start[i + 1], form->column_entry, form->column_row, it->at->jac, dy);
        for (int64_t r = 0; r < m; r++) turn[n + r] = -dy[r];
        for (int64_t i = 0; i < n + m; i++) left[i] = 0.0;
        for (int64_t k = 0; k < gaps; k++) left[form->index[k]] += form->sign[k] * dz[k];
        for (int64_t i = 0; i < n + m; i++) {
            turn[i] *= moving[i];
            left[i] = (1.0 - primal) * residual[i] + (primal - dual) * left[i];
        }
        double by_shift = primal * (shifted ? 1.0 : 0.0);
        for (int64_t i = 0; i < n; i++) left[i] -= by_shift * it->shifts[i] * dw[i];
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
        double centre = it->mu / trial_gap[k];
        trial_z[k] = nanmin(nanmax(value, centre / NEAR_CENTRE), NEAR_CENTRE * centre);
    }
}

int64_t point_move(iteration *it) {
    const formulation *form = it->form;
    const evaluation *at = it->at;
    int64_t n = form->n, m = form->m, gaps = form->gaps;
    iterate *now = it->now, *trial = it->trial;
    blend(it);
    invoke(it->calls, DERIVATIVES);
    if (lagrangian(form, at, trial->y, trial->dual) != 0.0) {
        /* Those of the iterate again, as if none had been evaluated since. */
        point_copy(n, now->w, at->x);
        point_copy(m, now->y, at->y);
        invoke(it->calls, DERIVATIVES);
        return 0;
    }
    const double *restrict trial_w = trial->w;
    double *restrict w = now->w;
    double change = 0.0;
#pragma omp simd reduction(highest : change)
    for (int64_t i = 0; i < n + m; i++) {
        change = nanmax(change, fabs(trial_w[i] - w[i]) / (1.0 + fabs(w[i])));
        w[i] = trial_w[i];
    }
    point_copy(n + m, trial->dual, now->dual);
    point_copy(m, trial->y, now->y);
    point_copy(m, at->r, now->r);
    point_copy(m, trial->c, now->c);
    point_copy(gaps, trial->z, now->z);
    point_copy(gaps, trial->gap, now->gap);
    it->step_taken = change;
    now->f = trial->f;
    now->theta = trial->theta;
    now->logarithms = trial->logarithms;
    return 1;
}

void point_push_inside(const formulation *form, double push, double *restrict w) {
    for (int64_t i = 0; i < form->size; i++) {
        double low = form->lower[i];
        double high = form->upper[i];
        double span = high - low;
        if (low > -INFINITY) low += push * dmin(dmax(1.0, fabs(low)), span);
        if (high < INFINITY) high -= push * dmin(dmax(1.0, fabs(high)), span);
        w[i] = dmin(dmax(w[i], low), high);
    }
}
