/* Solving with the factors of a chain, refined: what its runs of stages do, and how that is put together.
 *
 * A chain has one run of stages, or two from both ends and the tail between them, which two threads can be at. */
#include "../native.h"
#include "chain_rows.h"
#include "chain_solve.h"
#include "chain_substitution.h"
#include "substitution.h"
#include "values.h"

/* What a run of stages is to do: whether it is a first solution, which is checked, and for which of two vectors. */
enum {
    CHECKED = 0,
    WHICH = 1,
    BOTH = 0,
    CHAIN_SOLVE_FIRST = 1,
    CHAIN_SOLVE_SECOND = 2,
};
/* Where the runs' calls are among the prepared ones. */
enum {
    CHAIN_SOLVE_FORWARD = 0,
    FORWARD_TAIL = 1,
    BACKWARD_TAIL = 2,
    CHAIN_SOLVE_BACKWARD = 3,
};

ALWAYS_INLINE void copy(int64_t begin, int64_t end, const double *restrict x, double *restrict y) {
    for (int64_t k = begin; k < end; k++) y[k] = x[k];
}

ALWAYS_INLINE void zero(int64_t begin, int64_t end, double *restrict x) {
    for (int64_t k = begin; k < end; k++) x[k] = 0.0;
}

void chain_solve_forward_run(int64_t apart, int64_t begin, int64_t end, int64_t tail, int64_t size,
                             const int64_t *restrict progress, int64_t distance, int64_t stages,
                             const int64_t *restrict table, const int32_t *restrict code, int64_t stride,
                             const double *restrict factors, double *restrict work, double *restrict solution,
                             double *restrict change, double *restrict aside, double *restrict other_solution,
                             double *restrict other_change, double *restrict other_aside) {
    int64_t which = progress[WHICH];
    double *x = change + 0;
    double *other_x = other_change + 0;
    if (progress[CHECKED] != 0) {
        x = solution + 0;
        other_x = other_solution + 0;
    }
    if (apart != 0) {
        if (which != CHAIN_SOLVE_SECOND) {
            copy(begin, end, x, aside);
            zero(tail, size, aside);
        }
        if (which != CHAIN_SOLVE_FIRST) {
            copy(begin, end, other_x, other_aside);
            zero(tail, size, other_aside);
        }
        x = aside + 0;
        other_x = other_aside + 0;
    }
    if (which == BOTH)
        chain_substitution_forward_both(distance, stages, table, code, stride, factors, work, x, other_x);
    else if (which == CHAIN_SOLVE_FIRST)
        chain_substitution_forward_one_vector(distance, stages, table, code, stride, factors, work, x);
    else
        chain_substitution_forward_one_vector(distance, stages, table, code, stride, factors, work, other_x);
}

void chain_solve_backward_run(int64_t apart, int64_t begin, int64_t end, int64_t tail, int64_t size,
                              const int64_t *restrict progress, int64_t distance, int64_t stages,
                              const int64_t *restrict table, const int32_t *restrict code, int64_t stride,
                              const double *restrict units, const double *restrict factors,
                              const double *restrict matrix, double *restrict work, double *restrict solution,
                              double *restrict change, double *restrict aside, double *restrict left,
                              double *restrict other_solution, double *restrict other_change,
                              double *restrict other_aside, double *restrict other_left) {
    int64_t which = progress[WHICH];
    int64_t checked = progress[CHECKED];
    double *x = change + 0;
    double *other_x = other_change + 0;
    if (checked != 0) {
        x = solution + 0;
        other_x = other_solution + 0;
    }
    double *own = x + 0;
    double *other_own = other_x + 0;
    double *z = change + 0;
    double *other_z = other_change + 0;
    if (apart != 0) {
        own = aside + 0;
        other_own = other_aside + 0;
        z = left + 0;
        other_z = other_left + 0;
        if (which != CHAIN_SOLVE_SECOND) {
            copy(tail, size, x, aside);
            if (checked != 0) {
                copy(begin, end, change, left);
                zero(tail, size, left);
            }
        }
        if (which != CHAIN_SOLVE_FIRST) {
            copy(tail, size, other_x, other_aside);
            if (checked != 0) {
                copy(begin, end, other_change, other_left);
                zero(tail, size, other_left);
            }
        }
    }
    if (which == BOTH) {
        chain_substitution_backward_both(checked, distance, stages, table, code, stride, units, factors, matrix,
                                         work, own, other_own, z, other_z);
    } else if (which == CHAIN_SOLVE_FIRST) {
        chain_substitution_backward_one_vector(checked, distance, stages, table, code, stride, units, factors,
                                               matrix, work, own, z);
    } else {
        chain_substitution_backward_one_vector(checked, distance, stages, table, code, stride, units, factors,
                                               matrix, work, other_own, other_z);
    }
    if (apart != 0) {
        if (which != CHAIN_SOLVE_SECOND) {
            copy(begin, end, aside, x);
            if (checked != 0) copy(begin, end, left, change);
        }
        if (which != CHAIN_SOLVE_FIRST) {
            copy(begin, end, other_aside, other_x);
            if (checked != 0) copy(begin, end, other_left, other_change);
        }
    }
}

/* Solve with the factors for solution, where checked with change -= K solution, or for change.
 *
 * which: BOTH, FIRST or SECOND of two vectors. */
static void substitute(int64_t which, int64_t checked, const int64_t *calls, int64_t place, int64_t runs,
                       int64_t tail, int64_t size, int64_t *progress, double *solution, double *change,
                       const double *aside, const double *left, double *other_solution, double *other_change,
                       const double *other_aside, const double *other_left) {
    progress[WHICH] = which;
    progress[CHECKED] = checked;
    invoke(calls, place + CHAIN_SOLVE_FORWARD);
    if (runs > 1) {
        double *x = change + tail;
        double *other_x = other_change + tail;
        if (checked != 0) {
            x = solution + tail;
            other_x = other_solution + tail;
        }
        if (which != CHAIN_SOLVE_SECOND) values_add_to(size - tail, aside + tail, x);
        if (which != CHAIN_SOLVE_FIRST) values_add_to(size - tail, other_aside + tail, other_x);
        invoke(calls, place + FORWARD_TAIL);
        invoke(calls, place + BACKWARD_TAIL);
    }
    invoke(calls, place + CHAIN_SOLVE_BACKWARD);
    if (runs > 1 && checked != 0) {
        if (which != CHAIN_SOLVE_SECOND) values_add_to(size - tail, left + tail, change + tail);
        if (which != CHAIN_SOLVE_FIRST) values_add_to(size - tail, other_left + tail, other_change + tail);
    }
}

/* The largest magnitudes of x and z, nan when not all is finite. */
static void norms(int64_t size, const double *restrict x, const double *restrict z, double *restrict norms) {
    double check = 0.0;
    double length = 0.0;
    double remaining = 0.0;
#pragma omp simd reduction(+ : check) reduction(highest : length, remaining)
    for (int64_t k = 0; k < size; k++) {
        check += (x[k] + z[k]) * 0.0;
        length = nanmax(length, fabs(x[k]));
        remaining = nanmax(remaining, fabs(z[k]));
    }
    norms[0] = length + check;
    norms[1] = remaining + check;
}

static void begin(int64_t size, const double *restrict scaled_rhs, double *restrict solution,
                  double *restrict change) {
    for (int64_t k = 0; k < size; k++) {
        solution[k] = scaled_rhs[k];
        change[k] = scaled_rhs[k];
    }
}

static void refine(int64_t size, const double *restrict change, double *restrict kept, double *restrict solution) {
    for (int64_t k = 0; k < size; k++) {
        kept[k] = change[k];
        solution[k] += change[k];
    }
}

void chain_solve_solve(int64_t both, int64_t refinements, const double *accuracy, const int64_t *calls,
                       int64_t place, int64_t runs, int64_t tail, int64_t *progress, int64_t stages,
                       const int64_t *table, const int32_t *code, const int32_t *index, int64_t size,
                       int64_t stride, const double *matrix, const double *scale, double *work, double *norms_,
                       const double *aside, const double *left, const double *other_aside, const double *other_left,
                       const double *rhs, double *scaled_rhs, double *solution, double *change, double *kept,
                       double *result, const double *other_rhs, double *other_scaled_rhs, double *other_solution,
                       double *other_change, double *other_kept, double *other_result, double *report,
                       double *other_report) {
    double length = values_bring_scaled(size, index, scale, rhs, scaled_rhs);
    double other_length = 0.0;
    if (both != 0) other_length = values_bring_scaled(size, index, scale, other_rhs, other_scaled_rhs);
    int64_t active = length > 0.0 ? 1 : 0;
    int64_t other_active = other_length > 0.0 ? 1 : 0;
    report[0] = 1.0 * active;
    report[1] = 0.0;
    report[2] = 0.0;
    other_report[0] = 1.0 * other_active;
    begin(size, scaled_rhs, solution, change);
    if (both != 0) begin(size, other_scaled_rhs, other_solution, other_change);
    substitute(both != 0 ? BOTH : CHAIN_SOLVE_FIRST, 1, calls, place, runs, tail, size, progress, solution, change,
               aside, left, other_solution, other_change, other_aside, other_left);
    int64_t steps = 0;
    while (active + other_active > 0) {
        report[1] = 1.0 * steps;
        if (active != 0) {
            if (steps > 0)
                chain_rows_subtract(stages, table, code, stride, matrix, work, size, solution, scaled_rhs, change);
            norms(size, solution, change, norms_);
            if (steps == 0) report[2] = norms_[0] / length;
            active = substitution_improves(size, steps, refinements, accuracy[0], norms_[1], length, norms_[0],
                                           report, kept, solution);
        }
        if (other_active != 0) {
            if (steps > 0) {
                chain_rows_subtract(stages, table, code, stride, matrix, work, size, other_solution,
                                    other_scaled_rhs, other_change);
            }
            norms(size, other_solution, other_change, norms_);
            other_active = substitution_improves(size, steps, refinements, accuracy[0], norms_[1], other_length,
                                                 norms_[0], other_report, other_kept, other_solution);
        }
        steps++;
        if (active + other_active > 0) {
            int64_t which = BOTH;
            if (other_active == 0)
                which = CHAIN_SOLVE_FIRST;
            else if (active == 0)
                which = CHAIN_SOLVE_SECOND;
            substitute(which, 0, calls, place, runs, tail, size, progress, solution, change, aside, left,
                       other_solution, other_change, other_aside, other_left);
        }
        if (active != 0) refine(size, change, kept, solution);
        if (other_active != 0) refine(size, other_change, other_kept, other_solution);
    }
    values_return_scaled(size, index, scale, solution, result);
    if (both != 0) {
        values_return_scaled(size, index, scale, other_solution, other_result);
        report[0] = dmax(report[0], other_report[0]);
    }
}
