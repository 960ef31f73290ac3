/* Newton's method on the active set: the conditions at a point, and what a step from there leads to.
 *
 * stc.solver.active_set has the method. */
#include "active_set.h"

#define CONTRACTION 0.1
/* Share of the tolerance that a point is to reach where another step would. */
#define ACCURATE 0.1
/* Share of the tolerance above which a correction with the factorisation at hand is worth its while. */
#define EXACT 0.001
/* So many of them at most. */
enum { CORRECTIONS = 3 };

int64_t active_set_evaluate(primal_dual *p) {
    invoke(p->calls, VALUES);
    if (p->values_status[0] != 0.0) return 1;
    invoke(p->calls, DERIVATIVES);
    return conditions_project(p);
}

static bool differ(int64_t count, const double *restrict one, const double *restrict other) {
    bool differing = false;
    for (int64_t k = 0; k < count; k++)
        if (one[k] != other[k]) differing = true;
    return differing;
}

static bool same_active_set(const primal_dual *a, const primal_dual *b) {
    return !differ(a->nlp->n, a->active_x, b->active_x) && !differ(a->nlp->m, a->active_rows, b->active_rows);
}

/* A correction makes a factorisation gain as much as one and a half Newton steps (J. F. Traub, Iterative methods for
 * the solution of equations, 1964, section 8.4).  One is made, and more where that saves another step. */
int64_t active_set_improve(primal_dual *first, primal_dual *second, double tolerance) {
    primal_dual *from = first, *to = second;
    if (!conditions_advance(from, to) || active_set_evaluate(to) != 0) return 0;
    double change = from->change;
    double before = from->error;
    double error = to->error;
    double enough = ACCURATE * tolerance;
    for (int64_t left = CORRECTIONS; left > 0 && EXACT * tolerance < error && error <= CONTRACTION * before; left--) {
        if (left < CORRECTIONS) {
            double reached = error;
            for (int64_t k = 0; k < left; k++) reached *= error / before;
            if (reached > (error > enough ? enough : EXACT * tolerance)) break;
        }
        if (!same_active_set(from, to)) break;
        conditions_remain(to);
        invoke(to->calls, SOLVE);
        if (!conditions_advance(to, from) || active_set_evaluate(from) != 0 || !(from->error < error)) break;
        change += to->change;
        before = error;
        error = from->error;
        primal_dual *other = from;
        from = to;
        to = other;
    }
    first->change = second->change = change;
    return to == first ? 1 : 2;
}
