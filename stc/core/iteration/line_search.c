/* Which steps are good enough: a filter line search on (constraint violation, barrier function).
 *
 * A. Waechter and L. T. Biegler, Line search filter methods for nonlinear programming: motivation and global convergence,
 * SIAM J. Optim. 16 (2005), with the second-order correction and the constants of their 2006 paper.  The filter: R.
 * Fletcher and S. Leyffer, Nonlinear programming without a penalty function, Math. Program. 91 (2002). */
#include "iteration.h"

#define GAMMA_THETA 1e-05
#define GAMMA_PHI 1e-08
#define DELTA 1.0
#define S_THETA 1.1
#define S_PHI 2.3
#define ETA 1e-08
#define GAMMA_ALPHA 0.05
enum { MOST_CORRECTIONS = 4 };
#define CORRECTION_PROGRESS 0.99
#define SMALLEST_POWER 1e-300
/* By how much a step is lengthened at a time, and at least. */
#define LONGER 2.0
#define WORTHWHILE 1.25
/* Share of the fall that the Lagrangian's slope promises, which has to come true for that. */
#define LIKELY 0.25
/* Share of the same slope that is to be the barrier function's, rather than the violation's. */
#define DOWNHILL 0.5
/* How far the Lagrangian may be from the parabola through what was found before, relative to its fall. */
#define SURE 0.3

/* What a point tried may be: refused, acceptable by its barrier function, or by the filter, which is then extended. */
typedef enum { REFUSED = 0, DESCENT = 1, OUTSIDE = 2 } verdict;

int64_t line_search_accepts(const filter *f, double theta, double phi) {
    if (!(theta <= f->largest)) return 0;
    for (int64_t k = 0; k < f->count; k++)
        if (!(theta <= f->pairs[2 * k] || phi <= f->pairs[2 * k + 1])) return 0;
    return 1;
}

void line_search_add(filter *f, double theta, double phi) {
    double *pairs = f->pairs;
    phi = phi - GAMMA_PHI * theta;
    theta = (1.0 - GAMMA_THETA) * theta;
    int64_t kept = 0;
    for (int64_t k = f->count == ROOM ? 1 : 0; k < f->count; k++) {
        if (pairs[2 * k] < theta || pairs[2 * k + 1] < phi) {
            pairs[2 * kept] = pairs[2 * k];
            pairs[2 * kept + 1] = pairs[2 * k + 1];
            kept++;
        }
    }
    pairs[2 * kept] = theta;
    pairs[2 * kept + 1] = phi;
    f->count = kept + 1;
}

/* base ** exponent of a number that is not negative. */
static double power(double base, double exponent) {
    return base > 0.0 ? exp(exponent * log(base)) : 0.0;
}

/* The fraction of the step below which none can be expected to be acceptable. */
static double smallest_fraction(const iteration *it) {
    double theta = it->from_theta;
    double slope = it->from_slope;
    double smallest = GAMMA_THETA;
    if (slope < 0.0) {
        smallest = dmin(smallest, GAMMA_PHI * theta / -slope);
        if (theta <= it->small_theta)
            smallest = dmin(smallest, DELTA * power(theta, S_THETA) / dmax(power(-slope, S_PHI), SMALLEST_POWER));
    }
    return dmax(GAMMA_ALPHA * smallest, 1e-14);
}

/* The barrier function. */
static double barrier_of(const iteration *it, const iterate *point) {
    return it->form->gaps > 0 ? point->f - it->mu * point->logarithms : point->f;
}

/* The same plus the violations times the multipliers that the step leads to. */
static double lagrangian_after(const iteration *it, const iterate *point) {
    const double *restrict y = it->now->y, *restrict dy = it->step->dy, *restrict c = point->c;
    double total = barrier_of(it, point);
#pragma omp simd reduction(+ : total)
    for (int64_t r = 0; r < it->form->m; r++) total += (y[r] + dy[r]) * c[r];
    return total;
}

/* Whether the point tried is good enough, after a fraction alpha of the step. */
static verdict judge(const iteration *it, double alpha) {
    double trial_theta = it->trial->theta;
    double trial_phi = barrier_of(it, it->trial);
    if (!line_search_accepts(it->filter, trial_theta, trial_phi)) return REFUSED;
    double theta = it->from_theta;
    double slope = it->from_slope;
    double gain = trial_phi - it->from_phi - 10.0 * EPSILON * fabs(it->from_phi);
    if (theta <= it->small_theta && slope < 0.0 && alpha * power(-slope, S_PHI) > DELTA * power(theta, S_THETA))
        return gain <= ETA * alpha * slope ? DESCENT : REFUSED;
    return trial_theta <= (1.0 - GAMMA_THETA) * theta || gain <= -GAMMA_PHI * theta ? OUTSIDE : REFUSED;
}

/* Whether functions are defined at the point tried, and no gap is closed there. */
static bool is_inside(const iteration *it) {
    double total = it->trial->f + it->trial->theta;
    return total - total == 0.0 && it->trial->smallest_gap > 0.0;
}

/* Second-order correction: try the step that also removes the violation seen at the point tried. */
static verdict correct(iteration *it, double alpha) {
    const formulation *form = it->form;
    const iterate *now = it->now, *trial = it->trial;
    const double *dw = it->correction->dw;
    double *residual = it->correction_c;
    for (int64_t r = 0; r < form->m; r++) residual[r] = alpha * now->c[r] + trial->c[r];
    double last = trial->theta;
    for (int64_t turn = 0; turn < MOST_CORRECTIONS; turn++) {
        step_correct(it);
        if (it->kkt->report[0] > it->doubt) return REFUSED;
        double fall = 0.0;
        for (int64_t k = 0; k < form->gaps; k++) fall = dmax(fall, -form->sign[k] * dw[form->index[k]] / now->gap[k]);
        double length = fall <= it->tau ? 1.0 : it->tau / fall;
        for (int64_t i = 0; i < form->size; i++) trial->w[i] = now->w[i] + length * dw[i];
        for (int64_t i = 0; i < form->n; i++) it->at->x[i] = trial->w[i];
        point_try(it);
        if (!is_inside(it)) return REFUSED;
        verdict found = judge(it, alpha);
        if (found != REFUSED) return found;
        if (trial->theta > CORRECTION_PROGRESS * last) return REFUSED;
        last = trial->theta;
        for (int64_t r = 0; r < form->m; r++) residual[r] = length * residual[r] + trial->c[r];
    }
    return REFUSED;
}

/* Whether more than all of the step may be better: a shift has made it short, and will do so again.
 *
 * Not so with the rows' part of the Hessian damped: there the shift falls from step to step. */
static bool may_lengthen(const iteration *it) {
    return it->lengthens && it->shift != 0.0 && it->whole && !it->tiny && it->primal_step >= 1.0;
}

/* How much of the step to take, one or more, where all of it has just been tried and would do.
 *
 * A shift bounds the step as a trust region does, and those are made larger where their model is right (A. R. Conn,
 * N. I. M. Gould and Ph. L. Toint, Trust-region methods, SIAM 2000, 6.1). Along the step that is as if the shift were
 * smaller, even where the matrix would be indefinite. The model is the Lagrangian with the multipliers that go with
 * the step, which knows of the rows' curvature: it has to fall as foreseen, and that mostly by the barrier function;
 * and the violation may grow as curvature makes it. Linear rows, which all of the step meets, are met.
 * What is found is the point tried. */
static double lengthen(iteration *it) {
    double before = lagrangian_after(it, it->now);
    double slope = it->from_slope - (before - it->from_phi);
    double change = lagrangian_after(it, it->trial) - before;
    double theta = it->trial->theta;
    double alpha = 1.0;
    if (!(slope < 0.0 && it->from_slope <= DOWNHILL * slope && change <= LIKELY * slope)) return alpha;
    double bend = change - slope;
    for (;;) {
        double longer = dmin(LONGER * alpha, it->reach);
        if (longer < WORTHWHILE * alpha) return alpha;
        point_try_step(it, longer);
        bool better = false;
        if (is_inside(it)) {
            double further = lagrangian_after(it, it->trial) - before;
            double foreseen = longer * (slope + longer * bend);
            bool falls = further <= change + LIKELY * (longer - alpha) * slope;
            bool bends = it->trial->theta <= LONGER * LONGER * theta;
            if (falls && bends && fabs(further - foreseen) <= SURE * fabs(foreseen)) {
                better = judge(it, longer) != REFUSED;
                change = further;
                theta = it->trial->theta;
            }
        }
        if (!better) {
            point_try_step(it, alpha);
            return alpha;
        }
        alpha = longer;
    }
}

/* Move the iterate along the step by the largest fraction that the bounds allow, halved again and again, that will do.
 *
 * Where all of the step will, more than that may be taken (lengthen). */
static int64_t backtrack(iteration *it) {
    double limit = it->primal_step;
    double theta = it->from_theta;
    double smallest = dmax(smallest_fraction(it), it->shortest * limit);
    bool first = true;
    double alpha = limit;
    while (alpha >= smallest || first) {
        point_try_step(it, alpha);
        if (is_inside(it)) {
            verdict found = it->tiny ? DESCENT : judge(it, alpha);
            if (found == REFUSED && first && it->trial->theta >= theta && theta > 0.0) {
                found = correct(it, alpha);
            } else if (found != REFUSED && first && may_lengthen(it)) {
                alpha = lengthen(it);
                if (alpha > limit) found = judge(it, alpha);
            }
            it->alpha = alpha;
            if (found != REFUSED && point_move(it)) {
                if (found == OUTSIDE) line_search_add(it->filter, theta, it->from_phi);
                it->length_taken = alpha;
                return TAKEN;
            }
        }
        first = false;
        alpha *= 0.5;
    }
    return NOT_TAKEN;
}

int64_t line_search_search(iteration *it) {
    const iterate *now = it->now;
    it->length_taken = 0.0;
    if (it->changed) it->filter->count = 0;
    it->ended_by = NOT_FINITE;
    if (it->finite == 0.0) {
        it->from_theta = now->theta;
        it->from_phi = barrier_of(it, now);
        it->from_slope = it->slope - it->mu * it->log_slope;
        it->tiny = it->relative < 10.0 * EPSILON && now->theta < SMALL_VIOLATION;
        it->ended_by = backtrack(it);
    }
    return it->ended_by;
}
