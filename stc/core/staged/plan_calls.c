/* Choosing between plans for segments in compiled code, as long as old ones will do.
 *
 * A table has the calls of each plan: the elimination of the segments, the search for another scale, a probe of the
 * factors, the end of a factorisation, and the solves.  Which plan is in use, which is due, and what has come of it is in
 * the tally of a system; stc.solver.kkt.plan_choice decides what to put there, and takes account of it.
 *
 * Factorisations where all goes to plan, in one call of machine code each.
 *
 * Most matrices of a solve are such: nothing is left to decide.  A chain of calls factorises them, ends where something is
 * not as planned, and tells where; then AttachedKKT.resume does what is left to do.  Between several plans,
 * plan_calls.h chooses. */
#include "../native.h"
#include "lane_state.h"
#include "plan_calls.h"
#include "segmented_passes.h"

/* In the tally of a system: attempts that succeeded since it was last looked at. */
enum {
    PLAN_CALLS_MADE = 0,
};
/* In the tally of a system, behind the attempts that succeeded: how many more there may be, -1 where another plan is
 * due; the plan of the factors, and that for the next matrix; another one to try when no more are allowed, or -1; how
 * many are allowed when that suits, and when not; what came of it (0 so far), and how many had succeeded by then; 1 as
 * long as there is no scale yet. */
enum {
    ALLOWED = 1,
    NOW = 2,
    PLAN_CALLS_NEXT = 3,
    OTHER = 4,
    IF_SUITED = 5,
    IF_REFUSED = 6,
    OUTCOME = 7,
    MADE_BEFORE = 8,
    FRESH = 9,
    SUITED = 1,
    PLAN_CALLS_REFUSED = 2,
};
/* Calls of a plan for segments, in a table that has so many for each. */
enum {
    PLAN_CALLS_ELIMINATE = 0,
    EQUILIBRATE = 1,
    PROBE = 2,
    END = 3,
    PLAN_CALLS_CALLS = 6,
};
/* Where growth or inverses are larger than is trusted, factors are tried on a right-hand side: the residual, before
 * refinement, should be no larger than INACCURATE, and the solution no longer than SINGULAR times as much. */
#define INACCURATE 1e-05
#define SINGULAR 3000000000.0
/* Where both are below this share of that, factors are not tried again until they are so many times as suspect, but
 * above this share in any case, ... */
#define EASILY 0.01
#define MORE 3.0
#define MOST_TRUSTED 0.01
/* ... unless both are below this one: factors of many bodies are always suspect and hardly ever inaccurate. */
#define BY_FAR 0.0001

int64_t plan_calls_begin(int64_t curved, const int64_t *curvatures, const int64_t *calls, int64_t *tally) {
    if ((curvatures[0] != 0) != (curved != 0)) return 1;
    if (tally[ALLOWED] <= 0 && tally[OTHER] < 0) return 1;
    tally[ALLOWED]--;
    if (tally[FRESH] != 0) {
        tally[FRESH] = 0;
        invoke(calls, PLAN_CALLS_CALLS * tally[PLAN_CALLS_NEXT] + EQUILIBRATE);
    }
    return 0;
}

/* Eliminate the segments by a plan, with another scale where the old one does not serve; 0 where that could be. */
static int64_t eliminate_by(const int64_t *calls, int64_t plan) {
    int64_t own = PLAN_CALLS_CALLS * plan;
    int64_t ended = invoke(calls, own + PLAN_CALLS_ELIMINATE);
    if (ended != 0 && invoke(calls, own + EQUILIBRATE) != 0) ended = invoke(calls, own + PLAN_CALLS_ELIMINATE);
    /* A scale that has been doubted serves, or there is a new one. */
    return ended == DOUBTED_SCALE ? 0 : ended;
}

int64_t plan_calls_eliminate(const int64_t *calls, int64_t *tally) {
    if (tally[OTHER] >= 0 && tally[ALLOWED] < 0) {
        int64_t other = tally[OTHER];
        tally[OTHER] = -1;
        tally[MADE_BEFORE] = tally[PLAN_CALLS_MADE];
        tally[PLAN_CALLS_MADE] = 0;
        if (eliminate_by(calls, other) == 0) {
            tally[OUTCOME] = SUITED;
            tally[NOW] = other;
            tally[PLAN_CALLS_NEXT] = other;
            tally[ALLOWED] = tally[IF_SUITED];
            return 0;
        }
        tally[OUTCOME] = PLAN_CALLS_REFUSED;
        tally[ALLOWED] = tally[IF_REFUSED];
    }
    tally[NOW] = tally[PLAN_CALLS_NEXT];
    return eliminate_by(calls, tally[NOW]);
}

int64_t plan_calls_end(const int64_t *calls, const int64_t *tally) {
    return invoke(calls, PLAN_CALLS_CALLS * tally[NOW] + END);
}

int64_t plan_calls_is_accurate(const int64_t *calls, int64_t plan, const double *report, double *state) {
    invoke(calls, PLAN_CALLS_CALLS * plan + PROBE);
    if (report[0] < EASILY * INACCURATE && report[2] < EASILY * SINGULAR) {
        bool by_far = report[0] < BY_FAR * INACCURATE && report[2] < BY_FAR * SINGULAR;
        state[TRUSTED] = dmin(by_far ? 1.0 : MOST_TRUSTED, MORE * state[LANE_STATE_LARGEST]);
    }
    return report[0] < INACCURATE && report[2] < SINGULAR ? 1 : 0;
}

int64_t plan_calls_end_of_plan(const int64_t *calls, int64_t plan, const int64_t *rest, int64_t eliminated,
                               int64_t added, double *state, const double *report, double fine, int64_t *inertia,
                               double *accuracy, int64_t *tally) {
    if (!(state[LANE_STATE_LARGEST] <= state[TRUSTED]) && plan_calls_is_accurate(calls, plan, report, state) == 0)
        return 1;
    int64_t negative = (int64_t)state[COUNTED];
    inertia[0] = eliminated - negative + rest[0] - added;
    inertia[1] = negative + rest[1] - added;
    inertia[2] = 0;
    accuracy[0] = fine;
    tally[PLAN_CALLS_MADE]++;
    return 0;
}

void plan_calls_solve(const int64_t *calls, int64_t which, const int64_t *tally) {
    invoke(calls, PLAN_CALLS_CALLS * tally[NOW] + which);
}
