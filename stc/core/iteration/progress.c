/* Iterations, and what is noted of every iterate and step: which was best, whether it stalls, whether it drifts away.
 *
 * Where all is as usual, several iterations are one call, however small the problem; stc.solver.interior does the rest. */
#include "iteration.h"

#define PROGRESS 0.9 /* an error below this share of the smallest so far is progress */
enum { ITS_PATIENCE = 15, MOST_TINY_STEPS = 2, MOST_SHORT_STEPS = 5 };
#define SHORT 0.01
#define CONTRACTION 0.1
#define LARGEST_ERROR 1e+50
#define FAR 10000000.0
/* An objective below any sensible value. */
#define LOW (-1e+20)

int64_t progress_measure(iteration *it) {
    const formulation *form = it->form;
    const iterate *now = it->now;
    iterate *incumbent = it->incumbent;
    point_measure(it, 0.0);
    it->stated = now->f / form->objective_unit;
    invoke(it->calls, WATCH);
    /* Where the gradient fades as variables grow, along a valley that goes on for ever, the error falls below any
     * tolerance while every step still lowers the objective as much as the one before: that is no convergence. */
    double fall = it->objective_now - now->f;
    it->falling = it->dual_error > CONTRACTION * it->dual_now && fall > ACCEPTABLE * dmax(1.0, fabs(now->f));
    it->objective_now = now->f;
    it->dual_now = it->dual_error;
    if (it->error < PROGRESS * it->least_error)
        it->waiting = 0;
    else if (it->least_error <= ACCEPTABLE)
        it->waiting++;
    if (it->error < it->least_error) {
        it->least_error = it->error;
        point_copy(form->size, now->w, incumbent->w);
        point_copy(form->m, now->y, incumbent->y);
        point_copy(form->gaps, now->z, incumbent->z);
    }
    it->waited = it->waiting >= ITS_PATIENCE;
    it->stalled = it->tiny_steps >= MOST_TINY_STEPS || it->small_steps >= ITS_PATIENCE;
    bool ordinary = it->error > it->attention && it->error < LARGEST_ERROR && it->farthest <= FAR && now->f >= LOW;
    return !ordinary || it->waited || it->stalled;
}

/* 1 after several very short steps in a row that did not even halve the violation theta. */
static int64_t block(iteration *it) {
    double theta = it->now->theta;
    if (it->length_taken >= SHORT || theta < HALF * it->theta_before) {
        it->short_steps = 0;
        it->theta_before = theta;
    }
    it->short_steps++;
    return it->short_steps > MOST_SHORT_STEPS && theta > SMALL_VIOLATION;
}

int64_t progress_is_better(double objective, double violation, double best_objective, double best_violation,
                           double tolerance) {
    if (dmax(violation, best_violation) <= tolerance) return objective < best_objective ? 1 : 0;
    return violation < best_violation ? 1 : 0;
}

/* Record the iterate, and keep its variables and row multipliers where it is the best so far. */
static void note_record(iteration *it) {
    record *records = (record *)it->records;
    records[it->made++] = (record){it->stated,       it->violation, it->error, it->step_taken,
                                   it->length_taken, it->mu,        it->shift};
    if (it->best_known && !progress_is_better(it->stated, it->violation, it->best_objective, it->best_violation,
                                              it->feasibility))
        return;
    it->best_known = 1;
    it->best_new = 1;
    it->best_violation = it->violation;
    it->best_objective = it->stated;
    point_copy(it->form->n, it->now->w, it->best_x);
    point_copy(it->form->m, it->now->y, it->best_y);
}

int64_t progress_settle(iteration *it) {
    inertia_correction_relax(it);
    it->stuck = it->tiny || it->length_taken == 0.0;
    if (it->length_taken == 0.0) {
        it->step_taken = 0.0;
        return 0;
    }
    it->tiny_steps = it->tiny && !it->changed ? it->tiny_steps + 1 : 0; /* no change of the barrier explains it */
    it->small_steps = it->step_taken <= NOTHING ? it->small_steps + 1 : 0;
    return block(it);
}

int64_t progress_advance(iteration *it) {
    if (barrier_update_find_step(it) != 0) return STEP_FOUND;
    if (line_search_search(it) != TAKEN) return SEARCH;
    return progress_settle(it) != 0 ? BLOCKED : 0;
}

int64_t progress_iterate(iteration *it) {
    barrier_update_update(it);
    inertia_correction_begin(it);
    return inertia_correction_factorize(it) != DONE ? FACTORIZATION : progress_advance(it);
}

int64_t progress_repeat(iteration *it) {
    it->made = 0;
    for (;;) {
        int64_t look = progress_measure(it);
        if (it->calls[RAISED] != 0) return LOOK;
        note_record(it);
        if (look || it->made > it->most) return LOOK;
        int64_t ended = progress_iterate(it);
        if (ended != 0 || it->calls[RAISED] != 0 || it->made == it->most) return ended;
    }
}
