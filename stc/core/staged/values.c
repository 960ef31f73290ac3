/* Scales that bring the largest entry of each row near 1 (Ruiz 2001). */
#include "../native.h"
#include "values.h"

/* A scale is good when the largest entries of all rows are within this factor of 1. */
#define GOOD 2.0
/* Scales stay between these. */
#define SMALLEST_SCALE 1e-100
#define VALUES_LARGEST_SCALE 1e+100

/* Divide each scale by the root of its row's largest entry. */
static void refine(int64_t size, const double *restrict most, double *restrict scale) {
    for (int64_t k = 0; k < size; k++) {
        double value = most[k];
        value = value > 0.0 ? value : 1.0;
        scale[k] = nanmin(nanmax(scale[k] / sqrt(value), SMALLEST_SCALE), VALUES_LARGEST_SCALE);
    }
}

int64_t values_find_scale(int64_t size, const double *restrict most, double *restrict scale) {
    double low = VALUES_LARGEST_SCALE;
    double high = 0.0;
#pragma omp simd reduction(highest : high) reduction(lowest : low)
    for (int64_t k = 0; k < size; k++) {
        double value = most[k];
        high = nanmax(high, value);
        low = nanmin(low, value > 0.0 ? value : 1.0);
    }
    if (high < GOOD && low * GOOD > 1.0) return 0;
    refine(size, most, scale);
    return high < GOOD * GOOD * low ? 0 : 1;
}
