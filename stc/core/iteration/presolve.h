/* What bounds and linear equations determine is found before the solve, which then goes without it. */
#ifndef STC_PRESOLVE_H
#define STC_PRESOLVE_H

#include "../native.h"

/* Equations in the order in which they were used, each of which determines one variable; entries of the Jacobian. */
typedef API_STRUCT {
    const int32_t *rows, *cols;                  /* of each entry, */
    const double *jac;                           /* and its value */
    const int32_t *column_start, *column_entry;  /* the entries by columns */
    int64_t count;                               /* of equations used */
    int32_t *row, *entry;                        /* of each, room for (m): its number, and its variable's coefficient */
} determined;

/* Find out which equation determines which variable.
 *
 * queue: (2 m), its first `waiting` ones equations with one unknown; usable: 1 for linear equations (m).
 * left, last: how many unknowns each row has, and the sum of their entries' places: with one left, its place (m).
 * largest: magnitude of each row's largest entry (m); found: 1 for variables that are known (n). */
API void presolve_find(determined *d, int64_t waiting, int32_t *queue, const int32_t *usable, int32_t *left,
                       int64_t *last, const double *largest, int32_t *found);

/* Change x (n) so that the equations lose what is missing (m). */
API void presolve_substitute(const determined *d, double *missing, double *x);

/* Multipliers y (m) of the equations that leave their variables no slope; the gradient counts so much. */
API void presolve_balance(const determined *d, double weight, const double *gradient, double *y);

#endif
