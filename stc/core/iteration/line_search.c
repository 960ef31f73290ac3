/* Which steps are good enough: a filter line search on (constraint violation, barrier function).
 *
 * A. Waechter and L. T. Biegler, Line search filter methods for nonlinear programming: motivation and global convergence,
 * SIAM J. Optim. 16 (2005), with the second-order correction and the constants of their 2006 paper.  state.h has the
 * numbers s and the calls.
 *
 * The filter: pairs of violation and barrier function that later points must not be dominated by.
 *
 * R. Fletcher and S. Leyffer, Nonlinear programming without a penalty function, Math. Program. 91 (2002). */
#include "../native.h"
#include "kernels.h"
#include "line_search.h"
#include "state.h"

#define LINE_SEARCH_GAMMA_THETA 1e-05
#define LINE_SEARCH_GAMMA_PHI 1e-08
/* In an array that holds a filter: the number of pairs, the largest violation accepted, then the pairs. */
enum {
    COUNT = 0,
    LINE_SEARCH_LARGEST = 1,
    LINE_SEARCH_FIRST = 2,
};
/* Pairs that there is room for; the oldest gives way to one more. */
enum {
    ROOM = 1000,
};
#define DELTA 1.0
#define S_THETA 1.1
#define S_PHI 2.3
#define ETA 1e-08
#define GAMMA_ALPHA 0.05
enum {
    MOST_CORRECTIONS = 4,
};
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
#define EPSILON 0x1.0000000000000p-52
/* How a search may end. */
enum {
    TAKEN = 0,
    NOT_TAKEN = 1,
    LINE_SEARCH_CALL_MISSING = 2,
    NOT_FINITE = 3,
};
/* What a point tried may be: refused, acceptable by its barrier function, or by the filter, which is then extended. */
enum {
    LINE_SEARCH_REFUSED = 0,
    DESCENT = 1,
    OUTSIDE = 2,
};

int64_t line_search_accepts(const double *restrict filter, double theta, double phi) {
    if (!(theta <= filter[LINE_SEARCH_LARGEST])) return 0;
    const double *pairs = filter + LINE_SEARCH_FIRST;
    for (int64_t k = 0; k < (int64_t)filter[COUNT]; k++)
        if (!(theta <= pairs[2 * k] || phi <= pairs[2 * k + 1])) return 0;
    return 1;
}

void line_search_add(double *restrict filter, double theta, double phi) {
    double *pairs = filter + LINE_SEARCH_FIRST;
    phi = phi - LINE_SEARCH_GAMMA_PHI * theta;
    theta = (1.0 - LINE_SEARCH_GAMMA_THETA) * theta;
    int64_t count = (int64_t)filter[COUNT];
    int64_t kept = 0;
    for (int64_t k = count == ROOM ? 1 : 0; k < count; k++) {
        if (pairs[2 * k] < theta || pairs[2 * k + 1] < phi) {
            pairs[2 * kept] = pairs[2 * k];
            pairs[2 * kept + 1] = pairs[2 * k + 1];
            kept++;
        }
    }
    pairs[2 * kept] = theta;
    pairs[2 * kept + 1] = phi;
    filter[COUNT] = (double)(kept + 1);
}

/* base ** exponent of a number that is not negative. */
static double power(double base, double exponent) {
    return base > 0.0 ? exp(exponent * log(base)) : 0.0;
}

/* The fraction of a step below which none can be expected to be acceptable. */
static double smallest_fraction(double theta, double slope, const double *restrict s) {
    double smallest = LINE_SEARCH_GAMMA_THETA;
    if (slope < 0.0) {
        smallest = dmin(smallest, LINE_SEARCH_GAMMA_PHI * theta / -slope);
        if (theta <= s[SMALL_THETA])
            smallest = dmin(smallest, DELTA * power(theta, S_THETA) / dmax(power(-slope, S_PHI), SMALLEST_POWER));
    }
    return dmax(GAMMA_ALPHA * smallest, 1e-14);
}

/* Whether the point tried is good enough, after a fraction alpha of the step. */
static int64_t judge(double alpha, double trial_theta, double trial_phi, const double *restrict filter,
                     const double *restrict s) {
    if (line_search_accepts(filter, trial_theta, trial_phi) == 0) return LINE_SEARCH_REFUSED;
    double theta = s[FROM_THETA];
    double phi = s[FROM_PHI];
    double slope = s[FROM_SLOPE];
    double noise = 10.0 * EPSILON * fabs(phi);
    if (theta <= s[SMALL_THETA] && slope < 0.0 && alpha * power(-slope, S_PHI) > DELTA * power(theta, S_THETA))
        return trial_phi - phi - noise <= ETA * alpha * slope ? DESCENT : LINE_SEARCH_REFUSED;
    if (trial_theta <= (1.0 - LINE_SEARCH_GAMMA_THETA) * theta ||
        trial_phi - phi - noise <= -LINE_SEARCH_GAMMA_PHI * theta) {
        return OUTSIDE;
    }
    return LINE_SEARCH_REFUSED;
}

/* The barrier function. */
static double barrier_of(int64_t gaps, double f, double logarithms, const double *restrict s) {
    return gaps > 0 ? f - s[MU] * logarithms : f;
}

/* Whether functions are defined at the point tried, and no gap is closed there. */
static int64_t is_inside(const double *restrict f, const double *restrict s) {
    double total = f[0] + s[TRIAL_THETA];
    return total - total == 0.0 && s[TRIAL_GAP] > 0.0 ? 1 : 0;
}

/* Make the point tried the iterate; 0 where a derivative is undefined there. */
static int64_t take(const int64_t *calls, int64_t kind, double alpha, double *alphas, double *mu, double *shifted,
                    double *filter, const double *s) {
    alphas[0] = alpha;
    mu[0] = s[MU];
    shifted[0] = s[SHIFT] != 0.0 && s[EQUATIONS] != 0.0 ? 1.0 : 0.0;
    invoke(calls, MOVE);
    if (s[MOVED] == 0.0) {
        invoke(calls, RETURN);
        return 0;
    }
    if (kind == OUTSIDE) line_search_add(filter, s[FROM_THETA], s[FROM_PHI]);
    return 1;
}

/* Second-order correction: try the step that also removes the violation seen at the point tried.
 *
 * Returns: What the point tried last is. */
static int64_t correct(const int64_t *calls, int64_t n, int64_t m, int64_t gaps, const int64_t *index,
                       const double *sign, double alpha, const double *w, const double *c, const double *gap,
                       double *trial_w, const double *trial_c, double *x, const double *f, const double *dw,
                       double *residual, double *mu, const double *report, const double *filter, const double *s) {
    for (int64_t r = 0; r < m; r++) residual[r] = alpha * c[r] + trial_c[r];
    double last = s[TRIAL_THETA];
    for (int64_t turn = 0; turn < MOST_CORRECTIONS; turn++) {
        mu[0] = s[MU];
        invoke(calls, CENTRE);
        invoke(calls, CORRECTION);
        if (report[0] > s[DOUBT]) return LINE_SEARCH_REFUSED;
        double fall = 0.0;
        for (int64_t k = 0; k < gaps; k++) fall = dmax(fall, -sign[k] * dw[index[k]] / gap[k]);
        double length = fall <= s[TAU] ? 1.0 : s[TAU] / fall;
        for (int64_t i = 0; i < n + m; i++) trial_w[i] = w[i] + length * dw[i];
        for (int64_t i = 0; i < n; i++) x[i] = trial_w[i];
        invoke(calls, TRY_POINT);
        if (is_inside(f, s) == 0) return LINE_SEARCH_REFUSED;
        double now = s[TRIAL_THETA];
        int64_t kind = judge(alpha, now, barrier_of(gaps, f[0], s[TRIAL_LOGARITHMS], s), filter, s);
        if (kind != LINE_SEARCH_REFUSED) return kind;
        if (now > CORRECTION_PROGRESS * last) return LINE_SEARCH_REFUSED;
        last = now;
        for (int64_t r = 0; r < m; r++) residual[r] = length * residual[r] + trial_c[r];
    }
    return LINE_SEARCH_REFUSED;
}

/* Whether more than all of the step may be better: a shift has made it short, and will do so again.
 *
 * Not so with the rows' part of the Hessian damped: there the shift falls from step to step. */
static int64_t may_lengthen(const double *restrict s) {
    bool shortened = s[SHIFT] != 0.0 && s[WHOLE] != 0.0 && s[TINY] == 0.0;
    return s[LENGTHENS] != 0.0 && shortened && s[LIMIT] >= 1.0 ? 1 : 0;
}

/* How much of the step to take, one or more, where all of it has just been tried and would do.
 *
 * A shift bounds the step as a trust region does, and those are made larger where their model is right (A. R. Conn,
 * N. I. M. Gould and Ph. L. Toint, Trust-region methods, SIAM 2000, 6.1). Along the step that is as if the shift were
 * smaller, even where the matrix would be indefinite. The model is the Lagrangian with the multipliers that go with
 * the step, which knows of the rows' curvature: it has to fall as foreseen, and that mostly by the barrier function;
 * and the violation may grow as curvature makes it. Linear rows, which all of the step meets, are met.
 * What is found is the point tried. */
static double lengthen(const int64_t *calls, int64_t m, int64_t gaps, const double *y, const double *c,
                       const double *dy, const double *trial_c, const double *f, double *alphas,
                       const double *filter, const double *s) {
    double before = kernels_lagrangian_after(m, s[FROM_PHI], y, dy, c);
    double slope = s[FROM_SLOPE] - (before - s[FROM_PHI]);
    double change =
        kernels_lagrangian_after(m, barrier_of(gaps, f[0], s[TRIAL_LOGARITHMS], s), y, dy, trial_c) - before;
    double theta = s[TRIAL_THETA];
    double alpha = 1.0;
    if (!(slope < 0.0 && s[FROM_SLOPE] <= DOWNHILL * slope && change <= LIKELY * slope)) return alpha;
    double bend = change - slope;
    for (;;) {
        double longer = dmin(LONGER * alpha, s[REACH]);
        if (longer < WORTHWHILE * alpha) return alpha;
        alphas[0] = longer;
        invoke(calls, TRY_STEP);
        int64_t better = LINE_SEARCH_REFUSED;
        if (is_inside(f, s) != 0) {
            double phi = barrier_of(gaps, f[0], s[TRIAL_LOGARITHMS], s);
            double further = kernels_lagrangian_after(m, phi, y, dy, trial_c) - before;
            double foreseen = longer * (slope + longer * bend);
            bool falls = further <= change + LIKELY * (longer - alpha) * slope;
            bool bends = s[TRIAL_THETA] <= LONGER * LONGER * theta;
            if (falls && bends && fabs(further - foreseen) <= SURE * fabs(foreseen)) {
                better = judge(longer, s[TRIAL_THETA], phi, filter, s);
                change = further;
                theta = s[TRIAL_THETA];
            }
        }
        if (better == LINE_SEARCH_REFUSED) {
            alphas[0] = alpha;
            invoke(calls, TRY_STEP);
            return alpha;
        }
        alpha = longer;
    }
}

int64_t line_search_backtrack(const int64_t *calls, int64_t n, int64_t m, int64_t gaps, const int64_t *index,
                              const double *sign, const double *w, const double *y, const double *c,
                              const double *gap, const double *dy, double *trial_w, const double *trial_c,
                              double *x, const double *f, const double *dw, double *residual, double *alphas,
                              double *mu, double *shifted, const double *report, double *filter, double *s) {
    double theta = s[FROM_THETA];
    double limit = s[LIMIT];
    s[LENGTH_TAKEN] = 0.0;
    double smallest = dmax(smallest_fraction(theta, s[FROM_SLOPE], s), s[SHORTEST] * limit);
    bool first = true;
    double alpha = limit;
    while (alpha >= smallest || first) {
        alphas[0] = alpha;
        invoke(calls, TRY_STEP);
        if (is_inside(f, s) != 0) {
            int64_t kind = DESCENT;
            if (s[TINY] == 0.0)
                kind = judge(alpha, s[TRIAL_THETA], barrier_of(gaps, f[0], s[TRIAL_LOGARITHMS], s), filter, s);
            if (kind == LINE_SEARCH_REFUSED && first && s[TRIAL_THETA] >= theta && theta > 0.0) {
                if (calls[2 * CORRECTION] == 0) return LINE_SEARCH_CALL_MISSING;
                kind = correct(calls, n, m, gaps, index, sign, alpha, w, c, gap, trial_w, trial_c, x, f, dw,
                               residual, mu, report, filter, s);
            } else if (kind != LINE_SEARCH_REFUSED && first && may_lengthen(s) != 0) {
                alpha = lengthen(calls, m, gaps, y, c, dy, trial_c, f, alphas, filter, s);
                if (alpha > limit) {
                    double phi = barrier_of(gaps, f[0], s[TRIAL_LOGARITHMS], s);
                    kind = judge(alpha, s[TRIAL_THETA], phi, filter, s);
                }
            }
            if (kind != LINE_SEARCH_REFUSED && take(calls, kind, alpha, alphas, mu, shifted, filter, s) != 0) {
                s[LENGTH_TAKEN] = alpha;
                return TAKEN;
            }
        }
        first = false;
        alpha *= 0.5;
    }
    return NOT_TAKEN;
}

int64_t line_search_search(const int64_t *calls, int64_t n, int64_t m, int64_t gaps, const int64_t *index,
                           const double *sign, const double *w, const double *y, const double *c, const double *gap,
                           const double *dy, double *trial_w, const double *trial_c, double *x, const double *f,
                           const double *dw, double *residual, double *alphas, double *mu, double *shifted,
                           const double *report, double *filter, double *s) {
    s[LENGTH_TAKEN] = 0.0;
    if (s[CHANGED] != 0.0) filter[0] = 0.0;
    int64_t ended = NOT_FINITE;
    if (s[FINITE] == 0.0) {
        double theta = s[THETA];
        s[FROM_THETA] = theta;
        s[FROM_PHI] = barrier_of(gaps, s[OBJECTIVE], s[LOGARITHMS], s);
        s[FROM_SLOPE] = s[SLOPE] - s[MU] * s[LOG_SLOPE];
        s[LIMIT] = s[PRIMAL_STEP];
        s[TINY] = s[RELATIVE] < 10.0 * EPSILON && theta < SMALL_VIOLATION ? 1.0 : 0.0;
        ended = line_search_backtrack(calls, n, m, gaps, index, sign, w, y, c, gap, dy, trial_w, trial_c, x, f, dw,
                                      residual, alphas, mu, shifted, report, filter, s);
    }
    s[ENDED_BY] = (double)ended;
    return ended;
}
