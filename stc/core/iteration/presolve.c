/* Presolve; stc.solver.presolve tells what it is for. */
#include "presolve.h"

/* An equation with a smaller coefficient, relative to its largest, does not tell its last unknown accurately. */
#define SMALL_PIVOT 1e-06

void presolve_find(determined *d, int64_t waiting, int32_t *queue, const int32_t *usable, int32_t *left,
                   int64_t *last, const double *largest, int32_t *found) {
    d->count = 0;
    for (int64_t place = 0; place < waiting; place++) {
        int64_t row = queue[place];
        int64_t e = last[row];
        if (left[row] != 1 || !(fabs(d->jac[e]) > SMALL_PIVOT * largest[row])) continue;
        int64_t col = d->cols[e];
        found[col] = 1;
        d->row[d->count] = (int32_t)row;
        d->entry[d->count++] = (int32_t)e;
        for (int64_t k = d->column_start[col]; k < d->column_start[col + 1]; k++) {
            int64_t other = d->rows[d->column_entry[k]];
            left[other]--;
            last[other] -= d->column_entry[k];
            if (left[other] == 1 && usable[other] == 1) queue[waiting++] = (int32_t)other;
        }
    }
}

void presolve_substitute(const determined *d, double *missing, double *x) {
    for (int64_t k = 0; k < d->count; k++) {
        int64_t col = d->cols[d->entry[k]];
        double step = missing[d->row[k]] / d->jac[d->entry[k]];
        x[col] += step;
        for (int64_t place = d->column_start[col]; place < d->column_start[col + 1]; place++) {
            int64_t e = d->column_entry[place];
            missing[d->rows[e]] -= d->jac[e] * step;
        }
    }
}

void presolve_balance(const determined *d, double weight, const double *gradient, double *y) {
    for (int64_t k = d->count - 1; k >= 0; k--) {
        int64_t col = d->cols[d->entry[k]];
        double total = weight * gradient[col];
        for (int64_t place = d->column_start[col]; place < d->column_start[col + 1]; place++) {
            int64_t e = d->column_entry[place];
            total += d->jac[e] * y[d->rows[e]];
        }
        y[d->row[k]] = -total / d->jac[d->entry[k]];
    }
}
