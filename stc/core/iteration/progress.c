/* What is noted of every iterate and step, compiled; stc.solver.progress tells what it is for.
 *
 * The stages of an iteration as prepared calls, and the iteration as a chain of them.
 *
 * Each stage is a compiled function that makes the calls of the workspace's table and leaves its numbers (see
 * stc.solver.state).  It returns 0, or tells what it cannot do itself: stc.solver.newton_system,
 * stc.solver.newton_system and stc.solver.interior do that, and go on from there.  So iterations
 * where all is as usual are one call together, however small the problem.
 *
 * Watches a sequence of iterates: which was best, whether it stalls, whether it drifts away. */
#include "../native.h"
#include "inertia_correction.h"
#include "progress.h"
#include "state.h"

/* Where the calls of an iterate and of an iteration may end. */
enum {
    PROGRESS_LOOK = 1,
};
#define PROGRESS 0.9 /* an error below this share of the smallest so far is progress */
enum {
    ITS_PATIENCE = 15,
    MOST_TINY_STEPS = 2,
};
#define SHORT 0.01
enum {
    MOST_SHORT_STEPS = 5,
};
#define LARGEST_ERROR 1e+50

void progress_note_objective(double *restrict s) {
    s[OBJECTIVE_BEFORE] = s[OBJECTIVE_NOW];
    s[OBJECTIVE_NOW] = s[OBJECTIVE];
    s[DUAL_BEFORE] = s[DUAL_NOW];
    s[DUAL_NOW] = s[DUAL_ERROR];
}

int64_t progress_note_iterate(int64_t size, int64_t m, int64_t gaps, const double *restrict w,
                              const double *restrict y, const double *restrict z, double *restrict kept_w,
                              double *restrict kept_y, double *restrict kept_z, double *restrict s) {
    double error = s[ERROR];
    double nearest = s[NEAREST_ERROR];
    if (error < PROGRESS * nearest)
        s[WAITING] = 0.0;
    else if (nearest <= ACCEPTABLE)
        s[WAITING] += 1.0;
    if (error < nearest) {
        s[NEAREST_ERROR] = error;
        for (int64_t i = 0; i < size; i++) kept_w[i] = w[i];
        for (int64_t r = 0; r < m; r++) kept_y[r] = y[r];
        for (int64_t k = 0; k < gaps; k++) kept_z[k] = z[k];
    }
    bool ordinary =
        error > s[ATTENTION] && error < LARGEST_ERROR && s[FARTHEST] <= STATE_FAR && s[OBJECTIVE] >= LOW;
    bool still = s[WAITING] >= ITS_PATIENCE || s[TINY_STEPS] >= MOST_TINY_STEPS || s[SMALL_STEPS] >= ITS_PATIENCE;
    return ordinary && !still ? 0 : 1;
}

/* For Stall: the relative size of a step.
 *
 * tiny: it was below rounding error, and no change of the barrier explains it. */
static void note_step(double size, int64_t tiny, double *restrict s) {
    s[TINY_STEPS] = tiny != 0 ? s[TINY_STEPS] + 1.0 : 0.0;
    s[SMALL_STEPS] = size <= NOTHING ? s[SMALL_STEPS] + 1.0 : 0.0;
}

/* 1 after several very short steps in a row that did not even halve the violation theta. */
static int64_t block(double length, double theta, double *restrict s) {
    if (length >= SHORT || theta < HALF * s[THETA_BEFORE]) {
        s[SHORT_STEPS] = 0.0;
        s[THETA_BEFORE] = theta;
    }
    s[SHORT_STEPS] += 1.0;
    return s[SHORT_STEPS] > MOST_SHORT_STEPS && theta > SMALL_VIOLATION ? 1 : 0;
}

int64_t progress_is_better(double objective, double violation, double best_objective, double best_violation,
                           double tolerance) {
    if (dmax(violation, best_violation) <= tolerance) return objective < best_objective ? 1 : 0;
    return violation < best_violation ? 1 : 0;
}

void progress_record(int64_t n, int64_t m, const double *restrict w, const double *restrict y,
                     double *restrict best_x, double *restrict best_y, double *restrict rows, double *restrict s) {
    double *row = rows + ROW * (int64_t)s[MADE];
    row[ROW_OBJECTIVE] = s[STATED];
    row[ROW_VIOLATION] = s[VIOLATION];
    row[ROW_ERROR] = s[ERROR];
    row[ROW_STEP] = s[STEP_TAKEN];
    row[ROW_LENGTH] = s[LENGTH_TAKEN];
    row[ROW_MU] = s[MU];
    row[ROW_SHIFT] = s[SHIFT];
    s[MADE] += 1.0;
    int64_t better =
        progress_is_better(s[STATED], s[VIOLATION], s[BEST_OBJECTIVE], s[BEST_VIOLATION], s[FEASIBILITY]);
    if (s[BEST_KNOWN] != 0.0 && better == 0) return;
    s[BEST_KNOWN] = 1.0;
    s[BEST_NEW] = 1.0;
    s[BEST_VIOLATION] = s[VIOLATION];
    s[BEST_OBJECTIVE] = s[STATED];
    for (int64_t i = 0; i < n; i++) best_x[i] = w[i];
    for (int64_t r = 0; r < m; r++) best_y[r] = y[r];
}

int64_t progress_settle(double *restrict s) {
    double length = s[LENGTH_TAKEN];
    inertia_correction_relax(length, s);
    s[STUCK] = s[TINY] != 0.0 || length == 0.0 ? 1.0 : 0.0;
    s[STEP_TAKEN] = 0.0;
    if (length == 0.0) return 0;
    s[STEP_TAKEN] = s[STEP];
    note_step(s[STEP], s[TINY] != 0.0 && s[CHANGED] == 0.0 ? 1 : 0, s);
    return block(length, s[THETA], s);
}

int64_t progress_repeat(const int64_t *calls, int64_t n, int64_t m, const double *w, const double *y,
                        double *best_x, double *best_y, double *rows, double *s) {
    s[MADE] = 0.0;
    for (;;) {
        int64_t look = invoke(calls, MEASURED);
        if (calls[RAISED] != 0) return PROGRESS_LOOK;
        progress_record(n, m, w, y, best_x, best_y, rows, s);
        if (look != 0 || s[MADE] > s[MOST]) return PROGRESS_LOOK;
        int64_t ended = invoke(calls, ITERATION);
        if (ended != 0 || calls[RAISED] != 0 || s[MADE] == s[MOST]) return ended;
    }
}
