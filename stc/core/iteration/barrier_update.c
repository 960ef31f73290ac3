/* How far the barrier parameter mu is reduced at each iteration, and the step that goes with it.
 *
 * While the iterates make progress, mu is chosen anew at each one from a model of the optimality error after the step
 * (J. Nocedal, A. Waechter and R. A. Waltz, Adaptive barrier update strategies for nonlinear interior methods, SIAM J.
 * Optim. 19, 2009: the quality function).  When they don't, it is held until the barrier problem is solved and then
 * reduced superlinearly (Fiacco and McCormick), which is what the convergence theory covers.  state.h has the numbers s
 * and the calls. */
#include "../native.h"
#include "barrier_update.h"
#include "line_search.h"
#include "state.h"

#define SOLVED 10.0 /* a barrier problem counts as solved when its error is below this multiple of mu */
#define LINEAR_DECREASE 0.2
#define BARRIER_UPDATE_MARGIN 1e-05
#define HELD_FRACTION 0.8
#define LARGEST_GROWTH 1000.0
/* Why no step was found. */
enum {
    BARRIER_UPDATE_CALL_MISSING = 1,
    DOUBTFUL_SOLUTION = 2,
};

/* Change the parameter, and the fraction of the way to the boundary with it. */
static void set_mu(double mu, double *restrict s) {
    if (mu != s[MU]) s[CHANGED] = 1.0;
    s[MU] = mu;
    s[TAU] = dmax(SMALLEST_TAU, 1.0 - mu);
}

void barrier_update_update(const int64_t *calls, int64_t gaps, double *target, double *accepted, double *s) {
    s[CHANGED] = 0.0;
    if (gaps == 0) return;
    double average = s[PRODUCTS] / gaps;
    if (!isfinite(s[LARGEST_MU])) s[LARGEST_MU] = LARGEST_GROWTH * dmax(average, s[SMALLEST_MU]);
    double margin = BARRIER_UPDATE_MARGIN * dmin(1.0, s[ERROR]);
    int64_t progress = 0;
    if (s[STUCK] == 0.0 && s[ADAPTIVE] != 0.0)
        progress = line_search_accepts(accepted, s[THETA] + margin, s[OBJECTIVE] + margin);
    if (s[FREE] != 0.0) {
        if (progress != 0) {
            line_search_add(accepted, s[THETA], s[OBJECTIVE]);
        } else {
            s[FREE] = 0.0;
            set_mu(dmin(dmax(HELD_FRACTION * average, s[SMALLEST_MU]), s[LARGEST_MU]), s);
        }
        return;
    }
    if (progress != 0) {
        s[FREE] = 1.0;
        line_search_add(accepted, s[THETA], s[OBJECTIVE]);
        return;
    }
    bool stuck = s[STUCK] != 0.0;
    for (;;) {
        double mu = s[MU];
        target[0] = mu;
        invoke(calls, MEASURE);
        if (!(s[ERROR] <= SOLVED * mu || stuck)) break;
        double lower = dmax(s[SMALLEST_MU], dmin(LINEAR_DECREASE * mu, mu * sqrt(mu)));
        if (lower >= mu) break;
        set_mu(lower, s);
        stuck = false;
    }
    target[0] = 0.0;
}

int64_t barrier_update_find_step(const int64_t *calls, int64_t gaps, double *mu, double *tau, double *factor,
                                 const double *report, double *s) {
    if (s[FREE] == 0.0) {
        if (calls[2 * NEWTON] == 0) return BARRIER_UPDATE_CALL_MISSING;
        mu[0] = s[MU];
        tau[0] = s[TAU];
        invoke(calls, CENTRE);
        invoke(calls, NEWTON);
        if (report[0] > s[DOUBT]) return DOUBTFUL_SOLUTION;
        invoke(calls, LENGTHS);
        return 0;
    }
    if (calls[2 * PREDICT] == 0) return BARRIER_UPDATE_CALL_MISSING;
    invoke(calls, PREDICT);
    if (report[0] > s[DOUBT]) return DOUBTFUL_SOLUTION;
    double average = s[PRODUCTS] / gaps;
    double mu_now = dmax(s[SIGMA] * average, s[SMALLEST_MU]);
    set_mu(dmin(mu_now, dmax(s[SMALLEST_MU], s[LARGEST_MU])), s);
    s[CHANGED] = 1.0;
    factor[0] = s[MU] / average;
    tau[0] = s[TAU];
    invoke(calls, COMBINE);
    return 0;
}
