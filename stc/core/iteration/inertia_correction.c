/* Inertia correction, compiled: which shift of the Hessian to try next.
 *
 * A. Waechter and L. T. Biegler, Math. Program. 106, 2006, algorithm IC. See stc.solver.newton_system for the
 * system, and state.h for the numbers s and the calls. */
#include "../native.h"
#include "inertia_correction.h"
#include "state.h"
#include "../staged/contract.h"

/* In units of the Hessian's usual curvature, which is taken to be within these. */
#define FIRST_SHIFT 0.0001
#define LARGEST_CURVATURE 100.0
#define SMALLEST_CURVATURE 1e-06
#define SMALLEST_SHIFT 1e-20
#define LARGEST_SHIFT 1e+40
#define GROWTH_AT_FIRST 100.0
#define GROWTH 8.0
#define DECAY 0.3333333333333333
/* Iterations in a row at most in which a matrix without a shift is not tried, after it has failed again and again. */
enum {
    MOST_UNTRIED = 3,
};
enum {
    INERTIA_CORRECTION_WATCHED = 6,
};
#define SLOW 0.6
/* So many damped steps in a row that are whole, but leave more than such a share of the dual error, are the last. */
/* Share of the variables that an objective has to bend at least. */
#define BENT 0.05
/* What a factorisation has to do next: try the shifts, look at what that has found, shift more, damp, or either, ... */
#define TRY 0.0
#define DAMP 3.0
#define INERTIA_CORRECTION_LOOK 1.0
#define DAMP_OR_GROW 4.0
#define GROW 2.0
/* ... and how it may end: done, or somebody else has to factorise, provide a call, or give up. */
enum {
    INERTIA_CORRECTION_DONE = 0,
    REFACTOR = 1,
    INERTIA_CORRECTION_CALL_MISSING = 2,
    NO_SHIFT = 3,
};
#define UNKNOWN (-1.0)

double inertia_correction_median_magnitude(int64_t count, double *restrict values) {
    int64_t last = -1;
    for (int64_t k = 0; k < count; k++) {
        double value = fabs(values[k]);
        if (value > 0.0) {
            last++;
            values[last] = value;
        }
    }
    if (last < 0) return 0.0;
    int64_t wanted = (last + 1) >> 1;
    int64_t first = 0;
    while (first < last) {
        double pivot = values[(first + last) >> 1];
        int64_t low = first;
        int64_t high = last;
        while (low <= high) {
            while (values[low] < pivot) low++;
            while (values[high] > pivot) high--;
            if (low <= high) {
                double held = values[low];
                values[low] = values[high];
                values[high] = held;
                low++;
                high--;
            }
        }
        if (wanted <= high)
            last = high;
        else if (wanted >= low)
            first = low;
        else
            return values[wanted];
    }
    return values[wanted];
}

/* The median magnitude on the Hessian's diagonal, which the first shift of all is measured in.
 *
 * Entries of a motion's Hessian shrink with its steps of time, and a shift that is large beside all of them shortens
 * steps in every direction: what is added to a diagonal has to be relative to the matrix (P. E. Gill, W. Murray and
 * M. H. Wright, Practical Optimization, 1981, 4.4.2).
 *
 * diagonal: which of hess are on its diagonal, (count,); scratch is work space, (count,). */
static double usual_curvature(int64_t count, const int64_t *restrict diagonal, const double *restrict hess,
                              double *restrict scratch) {
    for (int64_t k = 0; k < count; k++) scratch[k] = hess[diagonal[k]];
    double found = inertia_correction_median_magnitude(count, scratch);
    return found > 0.0 ? dmin(dmax(found, SMALLEST_CURVATURE), LARGEST_CURVATURE) : 1.0;
}

/* The first shift to try after the last iterate's. */
static double smaller_shift(const double *restrict s) {
    return dmax(SMALLEST_SHIFT, DECAY * s[LAST_SHIFT]);
}

void inertia_correction_begin(const int64_t *calls, double *s) {
    invoke(calls, DIAGONALS);
    s[WHOLE] = 1.0;
    s[SHIFT] = s[STIFFNESS];
    s[SOFT] = NOTHING * sqrt(sqrt(dmax(s[MU], 1e-12)));
    s[DUAL_SHIFT] = 0.0;
    s[TASK] = TRY;
    if (s[UNTRIED] > 0.0) { /* without a shift: it has failed again and again */
        s[UNTRIED] -= 1.0;
        s[SHIFT] = dmax(s[STIFFNESS], smaller_shift(s));
        if (s[EXACT] == 0.0) s[TASK] = DAMP;
    }
}

double inertia_correction_larger_shift(const double *restrict s) {
    double last = s[LAST_SHIFT];
    double grown = s[SHIFT] * (last == 0.0 ? GROWTH_AT_FIRST : GROWTH);
    if (s[WHOLE] != 0.0 && s[SHIFT] < last) grown = dmin(grown, last);
    return dmax(grown, smaller_shift(s));
}

/* Use a share of the rows' part of the Hessian only; 0 when that is so already, or of no use. */
static int64_t damp(const int64_t *calls, int64_t n, int64_t count, const int64_t *diagonal, const double *bend,
                    double *s) {
    if (s[WHOLE] == 0.0 || s[BENDS] == 0.0) return 0;
    if (s[BENDS] == UNKNOWN || s[BENDS_ALIKE] == 0.0) invoke(calls, BEND);
    if (s[BENDS] == UNKNOWN) {
        int64_t bent = 0;
        int64_t downwards = 0;
        for (int64_t k = 0; k < count; k++) {
            bent += bend[diagonal[k]] > 0.0;
            downwards += bend[diagonal[k]] < 0.0;
        }
        s[BENDS] = downwards == 0 && bent >= BENT * n && bent > 0 ? 1.0 : 0.0;
        if (s[BENDS] == 0.0) return 0;
    }
    invoke(calls, DAMPED);
    s[WHOLE] = 0.0;
    return 1;
}

int64_t inertia_correction_factorize(const int64_t *calls, int64_t n, int64_t m, int64_t count,
                                     const int64_t *diagonal, const double *bend, const double *hess,
                                     double *scratch, const int64_t *inertia, double *accuracy, double *s) {
    int64_t ended = INERTIA_CORRECTION_DONE;
    for (;;) {
        if (s[TASK] == TRY) {
            invoke(calls, SHIFTED);
            s[TASK] = INERTIA_CORRECTION_LOOK;
            s[ENDED] = 0.0;
            if (calls[2 * ATTEMPT] == 0) {
                ended = REFACTOR;
                break;
            }
            s[ENDED] = (double)invoke(calls, ATTEMPT);
            if (s[ENDED] != 0.0) {
                ended = REFACTOR;
                break;
            }
        }
        if (s[TASK] == DAMP) {
            if (calls[2 * BEND] == 0 && s[BENDS] != 0.0) {
                ended = INERTIA_CORRECTION_CALL_MISSING;
                break;
            }
            s[TASK] = TRY;
            damp(calls, n, count, diagonal, bend, s);
            continue;
        }
        if (s[TASK] == INERTIA_CORRECTION_LOOK) {
            s[EXCESS] = (double)(inertia[1] - m);
            bool singular = inertia[2] > 0 || s[EXCESS] < 0.0;
            if (!singular && s[EXCESS] == 0.0) break;
            s[TASK] = TRY;
            if (singular && s[DUAL_SHIFT] == 0.0 && s[EQUATIONS] != 0.0) {
                s[DUAL_SHIFT] = s[SOFT];
                /* What is subtracted from the diagonal of the rows makes eigenvalues negative, and no more. */
                if (s[SHIFT] == 0.0 && s[EXCESS] < 0.0) continue;
            }
            if (s[SHIFT] == 0.0) {
                s[FAILURES] += 1.0;
                s[UNTRIED] = dmin(s[FAILURES] - 1.0, MOST_UNTRIED);
            }
            s[TASK] = singular || s[EXACT] != 0.0 ? GROW : DAMP_OR_GROW;
        }
        if (s[TASK] == DAMP_OR_GROW) {
            if (calls[2 * BEND] == 0 && s[BENDS] != 0.0) {
                ended = INERTIA_CORRECTION_CALL_MISSING;
                break;
            }
            s[TASK] = GROW;
            if (damp(calls, n, count, diagonal, bend, s) != 0 && s[SHIFT] > 0.0) {
                s[TASK] = TRY;
                continue;
            }
        }
        if (s[SHIFT] == 0.0 && s[LAST_SHIFT] == 0.0)
            s[SHIFT] = FIRST_SHIFT * usual_curvature(count, diagonal, hess, scratch);
        else
            s[SHIFT] = inertia_correction_larger_shift(s);
        s[TASK] = TRY;
        if (s[SHIFT] > LARGEST_SHIFT) {
            ended = NO_SHIFT;
            break;
        }
    }
    s[ENDED_BY] = (double)ended;
    if (ended != INERTIA_CORRECTION_DONE) return ended;
    /* Near a solution, what a solve leaves is an error of the multipliers that takes further iterations to be rid of. */
    if (s[ERROR] > SMALL_VIOLATION) accuracy[0] = COARSE;
    if (s[SHIFT] == 0.0) s[FAILURES] = 0.0;
    if (s[SHIFT] > 0.0) s[LAST_SHIFT] = s[SHIFT];
    return INERTIA_CORRECTION_DONE;
}

/* Damp no more where that is all that makes the iteration slow: whole steps hardly change the dual error.
 *
 * Newton's own would all but remove it.  What is left out of the Hessian is then nearly as large as what is not, and
 * the error falls by the same few per cent again and again, or goes up and down meanwhile. */
static void notice_slowness(double length, double *restrict s) {
    if (s[WHOLE] != 0.0 || length < SMALLEST_TAU) {
        s[SLOW_STEPS] = 0.0;
        s[SLOW_BEFORE] = 0.0;
        return;
    }
    s[SLOW_BEST] = s[SLOW_STEPS] == 0.0 ? s[DUAL_ERROR] : dmin(s[SLOW_BEST], s[DUAL_ERROR]);
    s[SLOW_STEPS] += 1.0;
    if (s[SLOW_STEPS] >= INERTIA_CORRECTION_WATCHED) {
        if (s[SLOW_BEFORE] > 0.0 && s[SLOW_BEST] > SLOW * s[SLOW_BEFORE]) s[BENDS] = 0.0;
        s[SLOW_BEFORE] = s[SLOW_BEST];
        s[SLOW_STEPS] = 0.0;
    }
}

void inertia_correction_relax(double length, double *restrict s) {
    notice_slowness(length, s);
    if (length == 0.0)
        s[STIFFNESS] = 0.0;
    else if (s[SHIFT] > 0.0)
        s[LAST_SHIFT] = s[SHIFT];
    if (length >= HALF) s[STIFFNESS] = 0.0;
}
