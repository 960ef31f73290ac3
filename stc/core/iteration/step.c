/* The step of an iteration, compiled: right-hand sides, what follows from a solution, and how far it may go.
 *
 * See kernels.h for the vectors and the array of numbers. */
#include "../native.h"
#include "kernels.h"
#include "state.h"
#include "step.h"

/* What a shift may add to the curvature of a variable that only the objective bends: so much of what it has, and so
 * much of the shift. */
#define SHARE 0.1
#define SLIGHT 0.001
/* How much of the rows' part of the Hessian is used where the whole of it makes the matrix indefinite. */
#define ROWS_SHARE 0.4
/* Gaps that are looked at for one trial after the other, so that they stay at hand. */
enum {
    STEP_BLOCK = 512,
};

void step_diagonals(int64_t n, int64_t m, int64_t gaps, const int64_t *restrict index, const double *restrict free,
                    const int32_t *restrict kind, const double *restrict extra, double smallest,
                    const double *restrict z, const double *restrict gap, double *restrict ratio,
                    double *restrict sigma, double *restrict primal, double *restrict d) {
    for (int64_t i = 0; i < n + m; i++) sigma[i] = 0.0;
    for (int64_t k = 0; k < gaps; k++) ratio[k] = z[k] / gap[k];
    for (int64_t k = 0; k < gaps; k++) sigma[index[k]] += ratio[k];
    for (int64_t i = 0; i < n; i++) primal[i] = free[i] != 0.0 ? sigma[i] + extra[i] : 1.0;
    for (int64_t r = 0; r < m; r++) {
        d[r] = 1.0 / nanmax(sigma[n + r], smallest);
        if (kind[r] == IGNORED) d[r] = 1.0;
    }
}

void step_shifted(int64_t n, int64_t m, const double *restrict free, const int32_t *restrict kind,
                  const double *restrict w, const double *restrict primal, const double *restrict d, int64_t convex,
                  const int64_t *restrict variable, const int64_t *restrict entry, const double *restrict hess,
                  double *restrict shifts, double *restrict out_primal, double *restrict out_dual,
                  const double *restrict s) {
    double shift = s[SHIFT];
    bool sized = shift > 0.0 && s[WHOLE] == 0.0;
    for (int64_t i = 0; i < n; i++) {
        shifts[i] = shift * free[i];
        if (sized) shifts[i] *= sqrt(sqrt(1.0 + w[i] * w[i]));
    }
    for (int64_t k = 0; k < convex; k++) {
        int64_t i = variable[k];
        double curvature = primal[i] + hess[entry[k]];
        if (curvature > 0.0) shifts[i] = nanmin(shifts[i], SHARE * curvature + SLIGHT * shifts[i]);
    }
    for (int64_t i = 0; i < n; i++) out_primal[i] = primal[i] + shifts[i];
    for (int64_t r = 0; r < m; r++) out_dual[r] = kind[r] == EQUALITY ? s[DUAL_SHIFT] : d[r];
}

void step_damped(int64_t entries, const double *restrict bend, const double *restrict hess, double *restrict out) {
    for (int64_t e = 0; e < entries; e++) out[e] = bend[e] + ROWS_SHARE * (hess[e] - bend[e]);
}

void step_mean_centre(int64_t gaps, const double *restrict gap, double *restrict centre, const double *restrict s) {
    double average = s[PRODUCTS] / gaps;
    for (int64_t k = 0; k < gaps; k++) centre[k] = average / gap[k];
}

void step_mu_centre(int64_t gaps, const double *restrict mu, const double *restrict gap, double *restrict centre) {
    for (int64_t k = 0; k < gaps; k++) centre[k] = mu[0] / gap[k];
}

void step_right_hand_side(int64_t n, int64_t m, int64_t gaps, int64_t with_residuals, const int64_t *restrict index,
                          const double *restrict sign, const int32_t *restrict kind, const double *restrict centre,
                          const double *restrict dual, const double *restrict c, const double *restrict d,
                          double *restrict pull, double *restrict rhs) {
    for (int64_t i = 0; i < n + m; i++) pull[i] = 0.0;
    for (int64_t k = 0; k < gaps; k++) pull[index[k]] += sign[k] * centre[k];
    if (with_residuals != 0)
        for (int64_t i = 0; i < n + m; i++) pull[i] -= dual[i];
    for (int64_t i = 0; i < n; i++) rhs[i] = pull[i];
    for (int64_t r = 0; r < m; r++) {
        double value = 0.0;
        if (kind[r] == INEQUALITY) value = d[r] * pull[n + r];
        if (with_residuals != 0) value -= c[r];
        rhs[n + r] = value;
    }
}

void step_recover(int64_t n, int64_t m, int64_t gaps, int64_t with_residuals, int64_t entries,
                  const int64_t *restrict entry, const int64_t *restrict index, const double *restrict sign,
                  const double *restrict free, const int32_t *restrict kind, const int64_t *restrict rows,
                  const int64_t *restrict cols, const double *restrict jac, const double *restrict c,
                  const double *restrict z, const double *restrict ratio, const double *restrict centre,
                  const double *restrict solution, double *restrict dw, double *restrict dy, double *restrict dz) {
    for (int64_t i = 0; i < n; i++) dw[i] = solution[i] * free[i];
    double *slacks = dw + n;
    for (int64_t r = 0; r < m; r++) {
        slacks[r] = 0.0;
        dy[r] = solution[n + r];
    }
    for (int64_t k = 0; k < entries; k++) {
        int64_t e = entry[k];
        slacks[rows[e]] += jac[e] * dw[cols[e]];
    }
    for (int64_t r = 0; r < m; r++) {
        double value = slacks[r];
        if (with_residuals != 0) value += c[r];
        slacks[r] = kind[r] == INEQUALITY ? value : 0.0;
    }
    for (int64_t k = 0; k < gaps; k++) {
        double value = centre[k] - ratio[k] * (sign[k] * dw[index[k]]);
        dz[k] = value;
    }
    if (with_residuals != 0)
        for (int64_t k = 0; k < gaps; k++) dz[k] -= z[k];
}

void step_lengths(int64_t n, int64_t m, int64_t gaps, const int64_t *restrict index, const double *restrict sign,
                  const double *restrict tau, const double *restrict w, const double *restrict z,
                  const double *restrict gap, const double *restrict gradient, const double *restrict dw,
                  const double *restrict dy, const double *restrict dz, double *restrict s) {
    double fall = 0.0;
    double fall_z = 0.0;
    double log_slope = 0.0;
#pragma omp simd reduction(+ : log_slope) reduction(highest : fall, fall_z)
    for (int64_t k = 0; k < gaps; k++) {
        double change = sign[k] * dw[index[k]] / gap[k];
        fall = nanmax(fall, -change);
        log_slope += change;
        fall_z = nanmax(fall_z, -dz[k] / z[k]);
    }
    double fraction = tau[0];
    s[REACH] = fraction / nanmax(fall, NOTHING);
    s[PRIMAL_STEP] = fall <= fraction ? 1.0 : fraction / fall;
    s[DUAL_STEP] = fall_z <= fraction ? 1.0 : fraction / fall_z;
    s[LOG_SLOPE] = log_slope;
    double slope = 0.0;
    double squared = 0.0;
#pragma omp simd reduction(+ : slope, squared)
    for (int64_t i = 0; i < n; i++) {
        slope += gradient[i] * dw[i];
        squared += dw[i] * dw[i];
    }
    s[SLOPE] = slope;
    s[LENGTH] = sqrt(squared);
    double check = 0.0;
    double most = 0.0;
#pragma omp simd reduction(+ : check) reduction(highest : most)
    for (int64_t i = 0; i < n + m; i++) {
        most = nanmax(most, fabs(dw[i]) / (1.0 + fabs(w[i])));
        check += dw[i] * 0.0;
    }
#pragma omp simd reduction(+ : check)
    for (int64_t r = 0; r < m; r++) check += dy[r] * 0.0;
#pragma omp simd reduction(+ : check)
    for (int64_t k = 0; k < gaps; k++) check += dz[k] * 0.0;
    s[RELATIVE] = most;
    s[FINITE] = check;
}

void step_combine(int64_t count, const double *restrict factor, const double *restrict one,
                  const double *restrict other, double *restrict out) {
    for (int64_t i = 0; i < count; i++) out[i] = one[i] + factor[0] * other[i];
}

/* Collect what some gaps change by, and by which share of them at most, for each of grid (count,). */
ALWAYS_INLINE void steps_to_bounds(int64_t begin, int64_t end, int64_t count, const int64_t *restrict index,
                                   const double *restrict sign, const double *restrict grid,
                                   const double *restrict gap, const double *restrict z,
                                   const double *restrict affine, const double *restrict affine_z,
                                   const double *restrict centring, const double *restrict centring_z,
                                   double *restrict gap_1, double *restrict gap_2, double *restrict fall,
                                   double *restrict falls, double *restrict falls_z) {
    double *fall_1 = fall + 0;
    double *fall_2 = fall + STEP_BLOCK;
    double *fall_z1 = fall + 2 * STEP_BLOCK;
    double *fall_z2 = fall + 3 * STEP_BLOCK;
    for (int64_t k = begin; k < end; k++) {
        gap_1[k] = sign[k] * affine[index[k]];
        gap_2[k] = sign[k] * centring[index[k]];
    }
    for (int64_t k = begin; k < end; k++) {
        double inverse = -1.0 / gap[k];
        fall_1[k - begin] = gap_1[k] * inverse;
        fall_2[k - begin] = gap_2[k] * inverse;
        double inverse_z = -1.0 / z[k];
        fall_z1[k - begin] = affine_z[k] * inverse_z;
        fall_z2[k - begin] = centring_z[k] * inverse_z;
    }
    for (int64_t trial = 0; trial < count; trial++) {
        double sigma = grid[trial];
        double most = falls[trial];
        double most_z = falls_z[trial];
#pragma omp simd reduction(highest : most, most_z)
        for (int64_t k = 0; k < end - begin; k++) {
            most = nanmax(most, fall_1[k] + sigma * fall_2[k]);
            most_z = nanmax(most_z, fall_z1[k] + sigma * fall_z2[k]);
        }
        falls[trial] = most;
        falls_z[trial] = most_z;
    }
}

/* The sum of the squares of products of some gaps and multipliers after a step. */
ALWAYS_INLINE double squares(int64_t begin, int64_t end, double sigma, double a, double b,
                             const double *restrict gap, const double *restrict z, const double *restrict affine_z,
                             const double *restrict centring_z, const double *restrict gap_1,
                             const double *restrict gap_2) {
    double squares = 0.0;
#pragma omp simd reduction(+ : squares)
    for (int64_t k = begin; k < end; k++) {
        double product =
            (gap[k] + a * (gap_1[k] + sigma * gap_2[k])) * (z[k] + b * (affine_z[k] + sigma * centring_z[k]));
        squares += product * product;
    }
    return squares;
}

void step_choose_centring(int64_t gaps, int64_t count, double moving, double rows, double smallest_tau,
                          double short_, const int64_t *restrict index, const double *restrict sign,
                          const double *restrict grid, const double *restrict gap, const double *restrict z,
                          const double *restrict affine, const double *restrict affine_z,
                          const double *restrict centring, const double *restrict centring_z,
                          double *restrict gap_1, double *restrict gap_2, double *restrict fall,
                          double *restrict trials, double *restrict s) {
    double average = s[PRODUCTS] / gaps;
    /* First by how much gaps and multipliers fall at most, then how far to go; then the error without products, and
     * with them. */
    double *reaches = trials + 0;
    double *reaches_z = trials + count;
    double *errors = trials + 2 * count;
    double *squares_ = trials + 3 * count;
    for (int64_t trial = 0; trial < count; trial++) {
        reaches[trial] = 1e-300;
        reaches_z[trial] = 1e-300;
        squares_[trial] = 0.0;
    }
    int64_t begin = 0;
    while (begin < gaps) {
        int64_t end = imin(begin + STEP_BLOCK, gaps);
        steps_to_bounds(begin, end, count, index, sign, grid, gap, z, affine, affine_z, centring, centring_z, gap_1,
                        gap_2, fall, reaches, reaches_z);
        begin = end;
    }
    int64_t likely = 0;
    for (int64_t trial = 0; trial < count; trial++) {
        double tau = nanmax(smallest_tau, 1.0 - grid[trial] * average);
        reaches[trial] = nanmin(1.0, tau / reaches[trial]);
        reaches_z[trial] = nanmin(1.0, tau / reaches_z[trial]);
        double dual = squared(1.0 - reaches_z[trial]) * s[DUAL_SQUARED] / moving;
        errors[trial] = dual + squared(1.0 - reaches[trial]) * s[PRIMAL_SQUARED] / rows;
        if (errors[trial] < errors[likely]) likely = trial;
    }
    /* Those whose error is no less without products than the likeliest one's with them are out of the question. */
    begin = 0;
    while (begin < gaps) {
        int64_t end = imin(begin + STEP_BLOCK, gaps);
        squares_[likely] += squares(begin, end, grid[likely], reaches[likely], reaches_z[likely], gap, z, affine_z,
                                    centring_z, gap_1, gap_2);
        begin = end;
    }
    double enough = errors[likely] + squares_[likely] / gaps;
    begin = 0;
    while (begin < gaps) {
        int64_t end = imin(begin + STEP_BLOCK, gaps);
        for (int64_t trial = 0; trial < count; trial++) {
            if (trial != likely && errors[trial] < enough) {
                squares_[trial] += squares(begin, end, grid[trial], reaches[trial], reaches_z[trial], gap, z,
                                           affine_z, centring_z, gap_1, gap_2);
            }
        }
        begin = end;
    }
    int64_t best = likely;
    double least = enough;
    for (int64_t trial = 0; trial < count; trial++) {
        if (trial != likely && errors[trial] < enough) {
            double error = errors[trial] + squares_[trial] / gaps;
            if (error < least || (error == least && trial < best)) {
                best = trial;
                least = error;
            }
        }
    }
    s[SIGMA] = reaches[best] >= short_ ? grid[best] : nanmax(grid[best], 1.0);
}

void step_least_squares(int64_t n, int64_t m, int64_t gaps, int64_t entries, int64_t curved,
                        const int64_t *restrict index, const double *restrict sign, const double *restrict free,
                        const int32_t *restrict kind, const double *restrict z, const double *restrict gradient,
                        const double *restrict jac, double *restrict pull, double *restrict out_hess,
                        double *restrict out_jac, double *restrict primal, double *restrict dual,
                        double *restrict rhs) {
    for (int64_t e = 0; e < curved; e++) out_hess[e] = 0.0;
    double largest = 0.0;
#pragma omp simd reduction(highest : largest)
    for (int64_t e = 0; e < entries; e++) {
        out_jac[e] = jac[e];
        largest = nanmax(largest, fabs(jac[e]));
    }
    double soft = NOTHING * nanmin(1.0, largest * largest);
    for (int64_t i = 0; i < n + m; i++) pull[i] = 0.0;
    for (int64_t k = 0; k < gaps; k++) pull[index[k]] += sign[k] * z[k];
    for (int64_t i = 0; i < n; i++) {
        primal[i] = 1.0;
        rhs[i] = (pull[i] - gradient[i]) * free[i];
    }
    for (int64_t r = 0; r < m; r++) {
        dual[r] = kind[r] == EQUALITY ? soft : 1.0;
        rhs[n + r] = kind[r] == INEQUALITY ? pull[n + r] : 0.0;
    }
}
