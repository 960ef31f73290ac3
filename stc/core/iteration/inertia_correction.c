/* Inertia correction: which shift of the Hessian to try next.
 *
 * A. Waechter and L. T. Biegler, Math. Program. 106, 2006, algorithm IC. See stc.solver.newton_system for the system. */
#include "../kkt.h"
#include "iteration.h"

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
enum { MOST_UNTRIED = 3 };
/* So many damped steps in a row that are whole, but leave more than such a share of the dual error, are the last. */
enum { WATCHED = 6 };
#define SLOW 0.6
/* Share of the variables that an objective has to bend at least. */
#define BENT 0.05
/* What a factorisation has to do next. */
enum {
    TRY = 0,           /* factorise with the shifts */
    LOOK_AT = 1,       /* look at the inertia */
    GROW = 2,          /* shift more */
    DAMP = 3,          /* damp the rows' part of the Hessian */
    DAMP_OR_GROW = 4,  /* that, or shift more where it makes no difference */
};
/* Whether the objective bends enough for that: `bends` before it has been found out. */
enum { UNKNOWN = -1 };

/* Found by parting them again and again (C. A. R. Hoare, Algorithm 65: find, Commun. ACM 4, 1961). */
double inertia_correction_median_magnitude(int64_t count, double *values) {
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
 * M. H. Wright, Practical Optimization, 1981, 4.4.2). */
static double usual_curvature(iteration *it) {
    int64_t count = it->form->diagonal_entries;
    for (int64_t k = 0; k < count; k++) it->scratch[k] = it->at->hess[it->form->diagonal_entry[k]];
    double found = inertia_correction_median_magnitude(count, it->scratch);
    return found > 0.0 ? dmin(dmax(found, SMALLEST_CURVATURE), LARGEST_CURVATURE) : 1.0;
}

/* The first shift to try after the last iterate's. */
static double smaller_shift(const iteration *it) { return dmax(SMALLEST_SHIFT, DECAY * it->last_shift); }

void inertia_correction_begin(iteration *it) {
    step_diagonals(it);
    it->whole = 1;
    it->shift = it->stiffness;
    it->soft = NOTHING * sqrt(sqrt(dmax(it->mu, 1e-12)));
    it->dual_shift = 0.0;
    it->task = TRY;
    if (it->untried > 0) { /* without a shift: it has failed again and again */
        it->untried--;
        it->shift = dmax(it->stiffness, smaller_shift(it));
        if (!it->exact) it->task = DAMP;
    }
}

/* Steps are the longer the nearer a shift is to the smallest that serves (J. J. More and D. C. Sorensen, SIAM J. Sci.
 * Stat. Comput. 4, 1983): where a smaller one than the last iterate's has failed, that is tried next, before larger
 * ones. Of a damped Hessian, whose shifts are small, a larger one costs less than a factorisation. */
double inertia_correction_larger_shift(iteration *it) {
    double last = it->last_shift;
    double grown = it->shift * (last == 0.0 ? GROWTH_AT_FIRST : GROWTH);
    if (it->whole && it->shift < last) grown = dmin(grown, last);
    return dmax(grown, smaller_shift(it));
}

/* Use a share of the rows' part of the Hessian only; false when that is so already, or of no use. */
static bool damp(iteration *it) {
    if (!it->whole || it->bends == 0) return false;
    if (it->bends == UNKNOWN || !it->bends_alike) step_bend(it);
    if (it->bends == UNKNOWN) {
        int64_t bent = 0;
        int64_t downwards = 0;
        for (int64_t k = 0; k < it->form->diagonal_entries; k++) {
            bent += it->bend[it->form->diagonal_entry[k]] > 0.0;
            downwards += it->bend[it->form->diagonal_entry[k]] < 0.0;
        }
        it->bends = downwards == 0 && bent >= BENT * it->form->n && bent > 0;
        if (!it->bends) return false;
    }
    step_damp(it);
    it->whole = 0;
    return true;
}

/* What the inertia of the matrix asks for; the dual shift, where the matrix is singular. */
static int64_t next_task(iteration *it, bool singular) {
    if (singular && it->dual_shift == 0.0 && it->form->any_equality) {
        it->dual_shift = it->soft;
        if (it->shift == 0.0) return TRY;
    }
    if (it->shift == 0.0) {
        it->failures++;
        it->untried = imin(it->failures - 1, MOST_UNTRIED);
    }
    return singular || it->exact ? GROW : DAMP_OR_GROW;
}

static int64_t factorize(iteration *it) {
    const int64_t *inertia = it->kkt->inertia;
    for (;;) {
        switch (it->task) {
        case TRY:
            step_shifted(it);
            it->task = LOOK_AT;
            it->ended = it->calls[2 * ATTEMPT] != 0 ? invoke(it->calls, ATTEMPT) : 0;
            if (it->calls[2 * ATTEMPT] == 0 || it->ended != 0) return REFACTOR;
            break;
        case DAMP:
            damp(it);
            it->task = TRY;
            break;
        case LOOK_AT: {
            int64_t excess = inertia[1] - it->form->m;
            bool singular = inertia[2] > 0 || excess < 0;
            if (!singular && excess == 0) return DONE;
            it->task = next_task(it, singular);
            break;
        }
        case DAMP_OR_GROW: it->task = damp(it) && it->shift > 0.0 ? TRY : GROW; break;
        default:
            if (it->shift == 0.0 && it->last_shift == 0.0)
                it->shift = FIRST_SHIFT * usual_curvature(it);
            else
                it->shift = inertia_correction_larger_shift(it);
            it->task = TRY;
            if (it->shift > LARGEST_SHIFT) return NO_SHIFT;
        }
    }
}

int64_t inertia_correction_factorize(iteration *it) {
    it->ended_by = factorize(it);
    if (it->ended_by != DONE) return it->ended_by;
    /* Near a solution, what a solve leaves is an error of the multipliers that takes further iterations to be rid of. */
    if (it->error > SMALL_VIOLATION) it->kkt->accuracy[0] = COARSE;
    if (it->shift == 0.0) it->failures = 0;
    if (it->shift > 0.0) it->last_shift = it->shift;
    return DONE;
}

/* Damp no more where that is all that makes the iteration slow: whole steps hardly change the dual error.
 *
 * Newton's own would all but remove it.  What is left out of the Hessian is then nearly as large as what is not, and
 * the error falls by the same few per cent again and again, or goes up and down meanwhile. */
static void notice_slowness(iteration *it) {
    if (it->whole || it->length_taken < SMALLEST_TAU) {
        it->slow_steps = 0;
        it->slow_before = 0.0;
        return;
    }
    it->slow_best = it->slow_steps == 0 ? it->dual_error : dmin(it->slow_best, it->dual_error);
    it->slow_steps++;
    if (it->slow_steps >= WATCHED) {
        if (it->slow_before > 0.0 && it->slow_best > SLOW * it->slow_before) it->bends = 0;
        it->slow_before = it->slow_best;
        it->slow_steps = 0;
    }
}

void inertia_correction_relax(iteration *it) {
    notice_slowness(it);
    if (it->length_taken == 0.0)
        it->stiffness = 0.0;
    else if (it->shift > 0.0)
        it->last_shift = it->shift;
    if (it->length_taken >= HALF) it->stiffness = 0.0;
}
