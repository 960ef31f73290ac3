/* How far the barrier parameter mu is reduced at each iteration, and the step that goes with it.
 *
 * While the iterates make progress, mu is chosen anew at each one from a model of the optimality error after the step
 * (J. Nocedal, A. Waechter and R. A. Waltz, Adaptive barrier update strategies for nonlinear interior methods, SIAM J.
 * Optim. 19, 2009: the quality function).  When they don't, it is held until the barrier problem is solved and then
 * reduced superlinearly (Fiacco and McCormick), which is what the convergence theory covers. */
#include "iteration.h"

#define SOLVED 10.0 /* a barrier problem counts as solved when its error is below this multiple of mu */
#define LINEAR_DECREASE 0.2
#define MARGIN 1e-05
#define HELD_FRACTION 0.8
#define LARGEST_GROWTH 1000.0

/* Change the parameter, and the fraction of the way to the boundary with it. */
static void set_mu(iteration *it, double mu) {
    if (mu != it->mu) it->changed = 1;
    it->mu = mu;
    it->tau = dmax(SMALLEST_TAU, 1.0 - mu);
}

void barrier_update_update(iteration *it) {
    it->changed = 0;
    if (it->form->gaps == 0) return;
    double theta = it->now->theta, f = it->now->f;
    double average = it->products / it->form->gaps;
    if (!isfinite(it->largest_mu)) it->largest_mu = LARGEST_GROWTH * dmax(average, it->smallest_mu);
    double margin = MARGIN * dmin(1.0, it->error);
    bool progress = !it->stuck && it->adaptive && line_search_accepts(it->accepted, theta + margin, f + margin);
    if (progress) {
        it->free = 1;
        line_search_add(it->accepted, theta, f);
        return;
    }
    if (it->free) {
        it->free = 0;
        set_mu(it, dmin(dmax(HELD_FRACTION * average, it->smallest_mu), it->largest_mu));
        return;
    }
    bool stuck = it->stuck;
    for (;;) {
        double mu = it->mu;
        point_measure(it, mu);
        if (!(it->error <= SOLVED * mu || stuck)) break;
        double lower = dmax(it->smallest_mu, dmin(LINEAR_DECREASE * mu, mu * sqrt(mu)));
        if (lower >= mu) break;
        set_mu(it, lower);
        stuck = false;
    }
}

int64_t barrier_update_find_step(iteration *it) {
    if (!it->free) {
        step_newton(it);
        if (it->kkt->report[0] > it->doubt) return 1;
    } else {
        step_predict(it);
        if (it->kkt->report[0] > it->doubt) return 1;
        double average = it->products / it->form->gaps;
        double mu = dmax(it->centring_parameter * average, it->smallest_mu);
        set_mu(it, dmin(mu, dmax(it->smallest_mu, it->largest_mu)));
        it->changed = 1;
        step_combine(it, it->mu / average);
    }
    step_lengths(it);
    return 0;
}
