/* What bounds and linear equations determine is found before the solve, which then goes without it.
 *
 * A foot that stands still has coordinates, velocities and accelerations at every frame, and as many equations that join
 * them: with the first frame and all accelerations given, each equation in turn has one unknown left and says what it is.
 * Such variables, those that bounds fix, and the rows that have none but these keep a solver busy for nothing
 * (E. D. Andersen and K. D. Andersen, Presolving in linear programming, Math. Program. 71, 1995: singleton rows).
 * The multipliers of the equations that were used follow from the solution in the opposite order. */
#include "../native.h"
#include "presolve.h"

/* An equation with a smaller coefficient, relative to its largest, does not tell its last unknown accurately. */
#define SMALL_PIVOT 1e-06

void presolve_find(int64_t waiting, int32_t *restrict queue, const int32_t *restrict usable, int32_t *restrict left,
                   int64_t *restrict last, const double *restrict largest, const int32_t *restrict starts,
                   const int32_t *restrict members, const int32_t *restrict rows, const int32_t *restrict cols,
                   const double *restrict jac, int32_t *restrict found, int32_t *restrict order,
                   int32_t *restrict entries, int64_t *restrict count) {
    int64_t end = waiting;
    int64_t place = 0;
    int64_t done = 0;
    while (place < end) {
        int64_t row = queue[place];
        place++;
        if (left[row] == 1) {
            int64_t e = last[row];
            int64_t col = cols[e];
            if (fabs(jac[e]) > SMALL_PIVOT * largest[row]) {
                found[col] = 1;
                order[done] = (int32_t)row;
                entries[done] = (int32_t)e;
                done++;
                for (int64_t k = starts[col], end_k = starts[col + 1]; k < end_k; k++) {
                    int64_t other = rows[members[k]];
                    left[other]--;
                    last[other] -= members[k];
                    if (left[other] == 1 && usable[other] == 1) {
                        queue[end] = (int32_t)other;
                        end++;
                    }
                }
            }
        }
    }
    count[0] = done;
}

void presolve_substitute(int64_t count, const int32_t *restrict order, const int32_t *restrict cols,
                         const int32_t *restrict entries, const int32_t *restrict starts,
                         const int32_t *restrict members, const int32_t *restrict rows, const double *restrict jac,
                         double *restrict missing, double *restrict x) {
    for (int64_t k = 0; k < count; k++) {
        double step = missing[order[k]] / jac[entries[k]];
        x[cols[k]] += step;
        for (int64_t place = starts[cols[k]]; place < starts[cols[k] + 1]; place++) {
            int64_t e = members[place];
            missing[rows[e]] -= jac[e] * step;
        }
    }
}

void presolve_balance(int64_t count, double weight, const int32_t *restrict order, const int32_t *restrict cols,
                      const int32_t *restrict entries, const int32_t *restrict starts,
                      const int32_t *restrict members, const int32_t *restrict rows, const double *restrict jac,
                      const double *restrict gradient, double *restrict y) {
    for (int64_t back = 0; back < count; back++) {
        int64_t k = count - 1 - back;
        double total = weight * gradient[cols[k]];
        for (int64_t place = starts[cols[k]]; place < starts[cols[k] + 1]; place++) {
            int64_t e = members[place];
            total += jac[e] * y[rows[e]];
        }
        y[order[k]] = -total / jac[entries[k]];
    }
}
