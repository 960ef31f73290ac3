/* The matrix in the order of elimination, scaled. */
#ifndef STC_LOAD_H
#define STC_LOAD_H

#include "system.h"
#include "vectors.h"

/* Largest entry of each row of S K S. */
static void largest_of_rows(const kkt *s, double *restrict most) {
    const plan *p = s->plan;
    const double *scale = s->scale;
    for (int32_t k = 0; k < s->size; k++) most[k] = fabs(s->diagonal[k]) * scale[k] * scale[k];
    for (int32_t k = 0; k < s->size; k++) {
        double own = scale[k], highest = most[k];
        for (int64_t e = p->entry_start[k]; e < p->entry_start[k + 1]; e++) {
            int32_t r = p->entry_row[e];
            double value = fabs(s->value[e]) * own * scale[r];
            highest = value > highest ? value : highest;
            most[r] = value > most[r] ? value : most[r];
        }
        most[k] = highest;
    }
}

/* Scale rows and columns alike until the largest entries of all rows are near 1 (Ruiz 2001).  The last scale is kept
 * where it serves, otherwise another one is found from ones: rows and columns would drift apart. */
static void equilibrate(kkt *s) {
    double spread = 1.0, *most = s->most;
    largest_of_rows(s, most);
    for (int32_t k = 0; k < s->size; k++) {
        double value = most[k] > 0.0 ? most[k] : 1.0;
        double far = value > 1.0 ? value : 1.0 / value;
        spread = far > spread ? far : spread;
    }
    if (spread > s->options.stale) {
        for (int32_t k = 0; k < s->size; k++) s->scale[k] = 1.0;
        for (int sweep = 0; sweep < SWEEPS; sweep++) {
            double low = LARGEST_SCALE, high = 0.0;
            largest_of_rows(s, most);
            for (int32_t k = 0; k < s->size; k++) {
                double value = most[k];
                high = value > high ? value : high;
                value = value > 0.0 ? value : 1.0;
                low = value < low ? value : low;
            }
            if (high < GOOD && low * GOOD > 1.0) break;
            for (int32_t k = 0; k < s->size; k++) s->scale[k] = rescaled(s->scale[k], most[k]);
            if (high < GOOD * GOOD * low) break;
        }
    }
    for (int32_t k = 0; k < s->size; k++) {
        double own = s->scale[k];
        s->diagonal[k] *= own * own;
        for (int64_t e = s->plan->entry_start[k]; e < s->plan->entry_start[k + 1]; e++)
            s->value[e] *= own * s->scale[s->plan->entry_row[e]];
    }
}

/* 0, or not a number where one of `count` numbers is not finite. */
static double check_of(const double *x, int64_t count) {
    lanes sum = {0};
    int64_t i = 0;
    double found = 0.0;
    for (; i + LANES <= count; i += LANES) sum += *(const lanes *)(x + i) * all_of(0.0);
    for (; i < count; i++) found += x[i] * 0.0;
    for (int lane = 0; lane < LANES; lane++) found += sum[lane];
    return found;
}

/* Values of H, J, p and d to their places, not scaled yet. */
void load_values(kkt *s, int *finite) {
    const double *hess = s->arrays.hess, *jac = s->arrays.jac - s->hess_count;
    double check = 0.0;
    for (int32_t k = 0; k < s->size; k++) {
        int32_t i = s->plan->order[k], from = s->ordered_diagonal[k];
        double value = i < s->n ? s->arrays.primal[i] : -s->arrays.dual[i - s->n];
        if (from >= 0) value += hess[from];
        check += value * 0.0;
        s->diagonal[k] = value;
    }
    const double *const given[2] = {hess, jac}; /* chosen without a branch, which nobody could foretell */
    for (int64_t e = 0; e < s->entries; e++) {
        int32_t from = s->ordered_source[e];
        s->value[e] = given[from >= s->hess_count][from];
    }
    check += check_of(s->value, s->entries);
    *finite = check == 0.0;
    if (*finite) equilibrate(s);
}

#endif
