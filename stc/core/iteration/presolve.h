/* What bounds and linear equations determine is found before the solve, which then goes without it. */
#ifndef STC_PRESOLVE_H
#define STC_PRESOLVE_H

#include "../native.h"

/* Which equation determines which variable, in an order in which they can.
 *
 * waiting, queue: so many equations with one unknown, first in queue (2 m,).
 * usable: 1 for linear equations, (m,).
 * left: how many unknowns each row has, (m,).
 * last: the sum of their entries' places: with one left, its place, (m,).
 * largest: magnitude of each row's largest entry, (m,).
 * starts, members: see Determined.
 * found: 1 for variables that are known, (n,).
 * order, entries, count: the result, (m,), (m,) and (1,). */
API void presolve_find(int64_t waiting, int32_t *restrict queue, const int32_t *restrict usable,
                       int32_t *restrict left, int64_t *restrict last, const double *restrict largest,
                       const int32_t *restrict starts, const int32_t *restrict members,
                       const int32_t *restrict rows, const int32_t *restrict cols, const double *restrict jac,
                       int32_t *restrict found, int32_t *restrict order, int32_t *restrict entries,
                       int64_t *restrict count);

/* Change x (n,) so that equations, used in this order, lose what is missing (m,). */
API void presolve_substitute(int64_t count, const int32_t *restrict order, const int32_t *restrict cols,
                             const int32_t *restrict entries, const int32_t *restrict starts,
                             const int32_t *restrict members, const int32_t *restrict rows,
                             const double *restrict jac, double *restrict missing, double *restrict x);

/* Multipliers y (m,) of equations, used in this order, that leave their variables no slope. */
API void presolve_balance(int64_t count, double weight, const int32_t *restrict order, const int32_t *restrict cols,
                          const int32_t *restrict entries, const int32_t *restrict starts,
                          const int32_t *restrict members, const int32_t *restrict rows, const double *restrict jac,
                          const double *restrict gradient, double *restrict y);

#endif
