/* The optimality conditions as a projection equation, evaluated at fixed places in one call.
 *
 * See stc.solver.active_set for the equation and what is done with it.
 *
 * Compiled parts of Newton's method on the active set: how far a point is from a solution, and what a step leads to.
 *
 * See projection.h for the points and stc.solver.active_set for the method. */
#include "../native.h"
#include "kernels.h"
#include "projection.h"

#define CONTRACTION 0.1
/* Share of the tolerance that a point is to reach where another step would. */
#define ACCURATE 0.1
/* Share of the tolerance above which a correction with the factorisation at hand is worth its while. */
#define PROJECTION_EXACT 0.001
/* So many of them at most. */
enum {
    CORRECTIONS = 3,
};
/* Calls of a pair of points, those of the first one and then of the second: evaluate it; the right-hand side for a
 * correction from there; move from there to the other one. The last one solves. */
enum {
    EVALUATE = 0,
    REMAINING = 2,
    ADVANCE = 4,
    SOLVE = 6,
};

int64_t projection_undefined(const double *restrict status) {
    return status[0] != 0.0 ? 1 : 0;
}

int64_t projection_judge(int64_t count, const double *restrict of_x, const double *restrict of_rows,
                         const double *restrict status, double *restrict error) {
    double dual = dmax(of_x[1], of_rows[1]);
    error[0] = dmax(dmax(of_x[0], of_rows[0]), dual / kernels_multiplier_scale(of_x[2] + of_rows[2], count));
    double check = error[0] + of_x[1] + of_rows[1] + status[0];
    return check - check == 0.0 ? 0 : 1;
}

/* 1 where some of the numbers do. */
static int64_t differ(int64_t count, const double *restrict one, const double *restrict other) {
    int64_t differing = 0;
    for (int64_t k = 0; k < count; k++)
        if (one[k] != other[k]) differing = 1;
    return differing;
}

int64_t projection_improve(const int64_t *calls, int64_t here, int64_t n, int64_t m, double tolerance,
                           const double *active_x, const double *active_rows, const double *other_active_x,
                           const double *other_active_rows, const double *errors, const double *other_errors,
                           double *largest) {
    int64_t now = 1 - here;
    invoke(calls, ADVANCE + here);
    if (largest[1] != 0.0 || invoke(calls, EVALUATE + now) != 0) return 0;
    double before = here == 0 ? errors[0] : other_errors[0];
    double error = now == 0 ? errors[0] : other_errors[0];
    double enough = ACCURATE * tolerance;
    int64_t left = CORRECTIONS;
    while (left > 0 && PROJECTION_EXACT * tolerance < error && error <= CONTRACTION * before) {
        if (left < CORRECTIONS) {
            double reached = error;
            for (int64_t k = 0; k < left; k++) reached *= error / before;
            if (reached > (error > enough ? enough : PROJECTION_EXACT * tolerance)) break;
        }
        if (differ(n, active_x, other_active_x) + differ(m, active_rows, other_active_rows) != 0) break;
        invoke(calls, REMAINING + now);
        invoke(calls, SOLVE);
        double change = largest[0];
        invoke(calls, ADVANCE + now);
        double closer = error;
        if (largest[1] == 0.0 && invoke(calls, EVALUATE + 1 - now) == 0)
            closer = now == 1 ? errors[0] : other_errors[0];
        if (!(closer < error)) {
            largest[0] = change;
            break;
        }
        largest[0] += change;
        before = error;
        error = closer;
        now = 1 - now;
        left--;
    }
    return now + 1;
}
