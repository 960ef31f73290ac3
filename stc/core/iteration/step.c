/* The step of an iteration: right-hand sides, what follows from a solution, and how far it may go. */
#include "iteration.h"

/* What a shift may add to the curvature of a variable that only the objective bends: so much of what it has, and so
 * much of the shift. */
#define SHARE 0.1
#define SLIGHT 0.001
/* How much of the rows' part of the Hessian is used where the whole of it makes the matrix indefinite. */
#define ROWS_SHARE 0.4
/* The fraction of a step below which bounds are in its way, where there are many. */
#define SHORT_STEP 0.2
/* Gaps that are looked at for one trial after the other, so that they stay at hand. */
enum { STEP_BLOCK = 512 };
/* The centring parameters to choose from. */
enum { TRIALS = 15 };
static const double CENTRING[TRIALS] = {1e-4, 1e-3, 3e-3, 0.01, 0.03, 0.06, 0.1, 0.2,
                                        0.35, 0.6,  1.0,  2.0,  5.0,  20.0, 100.0};

void step_diagonals(iteration *it) {
    const formulation *form = it->form;
    int64_t n = form->n, m = form->m, gaps = form->gaps;
    const int64_t *restrict index = form->index;
    const double *restrict z = it->now->z, *restrict gap = it->now->gap;
    double *restrict ratio = it->ratio, *restrict sigma = it->sigma;
    for (int64_t i = 0; i < n + m; i++) sigma[i] = 0.0;
    for (int64_t k = 0; k < gaps; k++) ratio[k] = z[k] / gap[k];
    for (int64_t k = 0; k < gaps; k++) sigma[index[k]] += ratio[k];
    for (int64_t i = 0; i < n; i++)
        it->primal_diagonal[i] = form->free[i] != 0.0 ? sigma[i] + form->extra_diagonal[i] : 1.0;
    for (int64_t r = 0; r < m; r++) {
        it->dual_diagonal[r] = 1.0 / nanmax(sigma[n + r], EPSILON);
        if (form->kind[r] == IGNORED) it->dual_diagonal[r] = 1.0;
    }
    point_copy(form->hess_entries, it->at->hess, it->kkt->hess);
    point_copy(form->jac_entries, it->at->jac, it->kkt->jac);
}

/* Where the rows' part of the Hessian is damped, shifts are larger for large variables, so that steps
 * are kept short relative to them: rates and accelerations of a fast motion should change less, of itself, than
 * slow ones. (As trust regions are scaled: D. W. Marquardt, J. SIAM 11, 1963; J. J. More, LNM 630, 1978.)
 *
 * A variable that only the objective bends, upwards, as torques are, makes no matrix indefinite: it gets
 * little of a shift, so that steps stay long in its direction. (As modified factorisations shift a diagonal only where
 * that is needed: P. E. Gill and W. Murray, Math. Program. 7, 1974; R. B. Schnabel and E. Eskow, SIAM J. Sci. Stat.
 * Comput. 11, 1990.) */
void step_shifted(iteration *it) {
    const formulation *form = it->form;
    int64_t n = form->n, m = form->m;
    const double *restrict free = form->free, *restrict w = it->now->w, *restrict own = it->primal_diagonal;
    double *restrict shifts = it->shifts, *restrict primal = it->kkt->primal, *restrict dual = it->kkt->dual;
    double shift = it->shift;
    bool sized = shift > 0.0 && it->whole == 0;
    for (int64_t i = 0; i < n; i++) {
        shifts[i] = shift * free[i];
        if (sized) shifts[i] *= sqrt(sqrt(1.0 + w[i] * w[i]));
    }
    for (int64_t k = 0; k < form->convex_entries; k++) {
        int64_t i = form->convex_variable[k];
        double curvature = own[i] + it->at->hess[form->convex_entry[k]];
        if (curvature > 0.0) shifts[i] = nanmin(shifts[i], SHARE * curvature + SLIGHT * shifts[i]);
    }
    for (int64_t i = 0; i < n; i++) primal[i] = own[i] + shifts[i];
    for (int64_t r = 0; r < m; r++) dual[r] = form->kind[r] == EQUALITY ? it->dual_shift : it->dual_diagonal[r];
}

void step_bend(iteration *it) {
    const evaluation *at = it->at;
    int64_t n = it->form->n, m = it->form->m, entries = it->form->hess_entries;
    point_copy(entries, at->hess, it->bend);
    point_copy(n, it->now->w, at->x);
    for (int64_t r = 0; r < m; r++) at->y[r] = 0.0;
    invoke(it->calls, DERIVATIVES);
    for (int64_t e = 0; e < entries; e++) {
        double whole = it->bend[e];
        it->bend[e] = at->hess[e];
        at->hess[e] = whole;
    }
    point_copy(m, it->now->y, at->y);
}

void step_damp(iteration *it) {
    const double *restrict bend = it->bend, *restrict hess = it->at->hess;
    double *restrict out = it->kkt->hess;
    for (int64_t e = 0; e < it->form->hess_entries; e++) out[e] = bend[e] + ROWS_SHARE * (hess[e] - bend[e]);
}

/* The right-hand side of the reduced system, for gaps' multipliers that are to become centre, 0 where that is NULL.
 *
 * c is the residual of the rows; without one: the part that is linear in centre. */
static void right_hand_side(iteration *it, const double *restrict centre, const double *restrict c,
                            double *restrict rhs) {
    const formulation *form = it->form;
    int64_t n = form->n, m = form->m;
    const double *restrict dual = it->now->dual;
    double *restrict pull = it->pull;
    for (int64_t i = 0; i < n + m; i++) pull[i] = 0.0;
    if (centre != NULL)
        for (int64_t k = 0; k < form->gaps; k++) pull[form->index[k]] += form->sign[k] * centre[k];
    if (c != NULL)
        for (int64_t i = 0; i < n + m; i++) pull[i] -= dual[i];
    for (int64_t i = 0; i < n; i++) rhs[i] = pull[i];
    for (int64_t r = 0; r < m; r++) {
        double value = form->kind[r] == INEQUALITY ? it->dual_diagonal[r] * pull[n + r] : 0.0;
        rhs[n + r] = c != NULL ? value - c[r] : value;
    }
}

/* The steps of variables, slacks and gap multipliers from the solution of that system. */
static void recover(iteration *it, const double *restrict centre, const double *restrict c,
                    const double *restrict solution, const step *found) {
    const formulation *form = it->form;
    int64_t n = form->n, m = form->m, gaps = form->gaps;
    const double *restrict sign = form->sign, *restrict free = form->free, *restrict jac = it->at->jac;
    const double *restrict ratio = it->ratio, *restrict z = it->now->z;
    double *restrict dw = found->dw, *restrict dy = found->dy, *restrict dz = found->dz;
    for (int64_t i = 0; i < n; i++) dw[i] = solution[i] * free[i];
    double *slacks = dw + n;
    for (int64_t r = 0; r < m; r++) {
        slacks[r] = 0.0;
        dy[r] = solution[n + r];
    }
    for (int64_t k = 0; k < form->slack_entries; k++) {
        int64_t e = form->slack_entry[k];
        slacks[form->jac_rows[e]] += jac[e] * dw[form->jac_cols[e]];
    }
    for (int64_t r = 0; r < m; r++) {
        double value = c != NULL ? slacks[r] + c[r] : slacks[r];
        slacks[r] = form->kind[r] == INEQUALITY ? value : 0.0;
    }
    for (int64_t k = 0; k < gaps; k++)
        dz[k] = (centre != NULL ? centre[k] : 0.0) - ratio[k] * (sign[k] * dw[form->index[k]]);
    if (c != NULL)
        for (int64_t k = 0; k < gaps; k++) dz[k] -= z[k];
}

/* The step towards mu that removes the residual c of the rows. */
static void solve_towards_mu(iteration *it, const double *c, const step *found) {
    for (int64_t k = 0; k < it->form->gaps; k++) it->centre[k] = it->mu / it->now->gap[k];
    right_hand_side(it, it->centre, c, it->kkt->rhs);
    invoke(it->calls, SOLVE);
    recover(it, it->centre, c, it->kkt->solution, found);
}

void step_newton(iteration *it) { solve_towards_mu(it, it->now->c, it->step); }

void step_correct(iteration *it) { solve_towards_mu(it, it->correction_c, it->correction); }

void step_predict(iteration *it) {
    int64_t gaps = it->form->gaps;
    const linear_system *kkt = it->kkt;
    double average = it->products / gaps;
    for (int64_t k = 0; k < gaps; k++) it->centre[k] = average / it->now->gap[k];
    right_hand_side(it, NULL, it->now->c, kkt->rhs);
    right_hand_side(it, it->centre, NULL, kkt->second_rhs);
    invoke(it->calls, SOLVE_BOTH);
    recover(it, NULL, it->now->c, kkt->solution, it->affine);
    recover(it, it->centre, NULL, kkt->second_solution, it->centring);
    step_choose_centring(it);
}

void step_lengths(iteration *it) {
    const formulation *form = it->form;
    int64_t n = form->n, m = form->m, gaps = form->gaps;
    const int64_t *restrict index = form->index;
    const double *restrict sign = form->sign, *restrict w = it->now->w, *restrict z = it->now->z;
    const double *restrict gap = it->now->gap, *restrict gradient = it->at->gradient;
    const double *restrict dw = it->step->dw, *restrict dy = it->step->dy, *restrict dz = it->step->dz;
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
    double fraction = it->tau;
    it->reach = fraction / nanmax(fall, NOTHING);
    it->primal_step = fall <= fraction ? 1.0 : fraction / fall;
    it->dual_step = fall_z <= fraction ? 1.0 : fraction / fall_z;
    it->log_slope = log_slope;
    double slope = 0.0;
    double squares = 0.0;
#pragma omp simd reduction(+ : slope, squares)
    for (int64_t i = 0; i < n; i++) {
        slope += gradient[i] * dw[i];
        squares += dw[i] * dw[i];
    }
    it->slope = slope;
    it->length = sqrt(squares);
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
    it->relative = most;
    it->finite = check;
}

static void add(int64_t count, double factor, const double *restrict one, const double *restrict other,
                double *restrict out) {
    for (int64_t i = 0; i < count; i++) out[i] = one[i] + factor * other[i];
}

void step_combine(iteration *it, double factor) {
    const step *a = it->affine, *b = it->centring;
    add(it->form->size, factor, a->dw, b->dw, it->step->dw);
    add(it->form->m, factor, a->dy, b->dy, it->step->dy);
    add(it->form->gaps, factor, a->dz, b->dz, it->step->dz);
}

/* By how much gaps change in the affine and in the centring step. */
typedef struct {
    double *affine, *centring;
} changes;

/* Collect what the gaps of a block change by, and by which share of them they fall at most, for each trial. */
static void steps_to_bounds(const iteration *it, int64_t begin, int64_t end, changes of_gaps, double *restrict falls,
                            double *restrict falls_z) {
    const formulation *form = it->form;
    const int64_t *restrict index = form->index;
    const double *restrict sign = form->sign, *restrict gap = it->now->gap, *restrict z = it->now->z;
    const double *restrict affine = it->affine->dw, *restrict affine_z = it->affine->dz;
    const double *restrict centring = it->centring->dw, *restrict centring_z = it->centring->dz;
    double *restrict gap_1 = of_gaps.affine, *restrict gap_2 = of_gaps.centring;
    double fall_1[STEP_BLOCK], fall_2[STEP_BLOCK], fall_z1[STEP_BLOCK], fall_z2[STEP_BLOCK];
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
    for (int64_t trial = 0; trial < TRIALS; trial++) {
        double parameter = CENTRING[trial];
        double most = falls[trial];
        double most_z = falls_z[trial];
#pragma omp simd reduction(highest : most, most_z)
        for (int64_t k = 0; k < end - begin; k++) {
            most = nanmax(most, fall_1[k] + parameter * fall_2[k]);
            most_z = nanmax(most_z, fall_z1[k] + parameter * fall_z2[k]);
        }
        falls[trial] = most;
        falls_z[trial] = most_z;
    }
}

/* The sum of the squares of products of a block's gaps and multipliers after fractions a and b of a trial's step. */
static double squared_products(const iteration *it, int64_t begin, int64_t end, changes of_gaps, double parameter,
                               double a, double b) {
    const double *restrict gap = it->now->gap, *restrict z = it->now->z;
    const double *restrict affine_z = it->affine->dz, *restrict centring_z = it->centring->dz;
    const double *restrict gap_1 = of_gaps.affine, *restrict gap_2 = of_gaps.centring;
    double squares = 0.0;
#pragma omp simd reduction(+ : squares)
    for (int64_t k = begin; k < end; k++) {
        double product = (gap[k] + a * (gap_1[k] + parameter * gap_2[k])) *
                         (z[k] + b * (affine_z[k] + parameter * centring_z[k]));
        squares += product * product;
    }
    return squares;
}

/* The centring parameter whose step is predicted to leave the smallest squared error: the quality function.
 *
 * Where even the best step is short, many bounds are in its way: products are not made smaller. */
void step_choose_centring(iteration *it) {
    int64_t gaps = it->form->gaps;
    double average = it->products / gaps;
    changes of_gaps = {it->scratch, it->scratch + gaps};
    /* First by how much gaps and multipliers fall at most, then how far to go; the error without products, and them. */
    double reaches[TRIALS], reaches_z[TRIALS], errors[TRIALS], products[TRIALS];
    for (int64_t trial = 0; trial < TRIALS; trial++) {
        reaches[trial] = 1e-300;
        reaches_z[trial] = 1e-300;
        products[trial] = 0.0;
    }
    for (int64_t begin = 0; begin < gaps; begin += STEP_BLOCK)
        steps_to_bounds(it, begin, imin(begin + STEP_BLOCK, gaps), of_gaps, reaches, reaches_z);
    int64_t likely = 0;
    for (int64_t trial = 0; trial < TRIALS; trial++) {
        double tau = nanmax(SMALLEST_TAU, 1.0 - CENTRING[trial] * average);
        reaches[trial] = nanmin(1.0, tau / reaches[trial]);
        reaches_z[trial] = nanmin(1.0, tau / reaches_z[trial]);
        double dual = squared(1.0 - reaches_z[trial]) * it->dual_squared / (double)it->form->moving_entries;
        double rows = (double)imax(1, it->form->m);
        errors[trial] = dual + squared(1.0 - reaches[trial]) * it->primal_squared / rows;
        if (errors[trial] < errors[likely]) likely = trial;
    }
    /* Those whose error is no less without products than the likeliest one's with them are out of the question. */
    for (int64_t begin = 0; begin < gaps; begin += STEP_BLOCK)
        products[likely] += squared_products(it, begin, imin(begin + STEP_BLOCK, gaps), of_gaps, CENTRING[likely],
                                             reaches[likely], reaches_z[likely]);
    double enough = errors[likely] + products[likely] / gaps;
    for (int64_t begin = 0; begin < gaps; begin += STEP_BLOCK) {
        for (int64_t trial = 0; trial < TRIALS; trial++) {
            if (trial != likely && errors[trial] < enough)
                products[trial] += squared_products(it, begin, imin(begin + STEP_BLOCK, gaps), of_gaps,
                                                    CENTRING[trial], reaches[trial], reaches_z[trial]);
        }
    }
    int64_t best = likely;
    double least = enough;
    for (int64_t trial = 0; trial < TRIALS; trial++) {
        if (trial != likely && errors[trial] < enough) {
            double error = errors[trial] + products[trial] / gaps;
            if (error < least || (error == least && trial < best)) {
                best = trial;
                least = error;
            }
        }
    }
    double short_step = it->form->many_gaps ? SHORT_STEP : 0.0;
    it->centring_parameter = reaches[best] >= short_step ? CENTRING[best] : nanmax(CENTRING[best], 1.0);
}

/* Equality rows are softened, against dependent ones, by NOTHING times the square of the largest entry of J. */
void step_least_squares(iteration *it) {
    const formulation *form = it->form;
    const linear_system *kkt = it->kkt;
    int64_t n = form->n, m = form->m;
    const double *restrict jac = it->at->jac;
    double *restrict pull = it->pull, *restrict out_jac = kkt->jac;
    for (int64_t e = 0; e < form->hess_entries; e++) kkt->hess[e] = 0.0;
    double largest = 0.0;
#pragma omp simd reduction(highest : largest)
    for (int64_t e = 0; e < form->jac_entries; e++) {
        out_jac[e] = jac[e];
        largest = nanmax(largest, fabs(jac[e]));
    }
    double soft = NOTHING * nanmin(1.0, largest * largest);
    for (int64_t i = 0; i < n + m; i++) pull[i] = 0.0;
    for (int64_t k = 0; k < form->gaps; k++) pull[form->index[k]] += form->sign[k] * it->now->z[k];
    for (int64_t i = 0; i < n; i++) {
        kkt->primal[i] = 1.0;
        kkt->rhs[i] = (pull[i] - it->at->gradient[i]) * form->free[i];
    }
    for (int64_t r = 0; r < m; r++) {
        kkt->dual[r] = form->kind[r] == EQUALITY ? soft : 1.0;
        kkt->rhs[n + r] = form->kind[r] == INEQUALITY ? pull[n + r] : 0.0;
    }
}
