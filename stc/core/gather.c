/* From the outputs of kernels to matrix entries, in compiled calls.
 *
 * Nearly every entry is one output of one kernel.  Outputs that add up to an entry are added into the first of them
 * within the kernels' buffer; after that every entry has one place to come from:
 *
 *     fold       buffer[into] += buffer[source]        few
 *     collect    out = scale * buffer[first]           all
 *
 * An output belongs to no more than one entry, which makes this possible. */
#include "native.h"
#include "gather.h"

void gather_begin(double *restrict status, int64_t *restrict counter) {
    status[0] = 0.0;
    counter[0]++;
}

void gather_add_up(double *restrict part, double *restrict into) {
    into[0] += part[0];
    part[0] = 0.0;
}

void gather_copy(int64_t count, const double *restrict values, double *restrict into) {
    for (int64_t k = 0; k < count; k++) into[k] = values[k];
}

void gather_place(int64_t count, const double *restrict values, const double *restrict scale,
                  double *restrict into) {
    for (int64_t k = 0; k < count; k++) into[k] = values[k] * scale[k];
}

int64_t gather_note(int64_t count, const double *restrict values, double *restrict noted, int64_t *restrict same) {
    double difference = 0.0;
#pragma omp simd reduction(+ : difference)
    for (int64_t k = 0; k < count; k++) {
        difference += fabs(values[k] - noted[k]);
        noted[k] = values[k];
    }
    same[0] = difference == 0.0 ? 1 : 0; /* nan is not */
    return same[0];
}

int64_t gather_all_same(int64_t count, const int64_t *restrict same) {
    for (int64_t k = 0; k < count; k++)
        if (same[k] == 0) return 0;
    return 1;
}

void gather_fold(int64_t count, const int32_t *restrict source, const int32_t *restrict into,
                 double *restrict buffer) {
    for (int64_t k = 0; k < count; k++) buffer[into[k]] += buffer[source[k]];
}

/* In parts: the rounding error of a long sum grows with the length of the parts only.
 *
 * Four numbers of a part are added at a time, for none has to wait for the one before. */
ALWAYS_INLINE double sum(int64_t count, const int32_t *restrict source, const double *restrict buffer) {
    double result = 0.0;
    for (int64_t first = 0; first < count; first += 128) {
        int64_t end = imin(first + 128, count);
        int64_t fours = first + 4 * ((end - first) >> 2);
        double a = 0.0;
        double b = 0.0;
        double c = 0.0;
        double d = 0.0;
        for (int64_t k = first; k < fours; k += 4) {
            a += buffer[source[k]];
            b += buffer[source[k + 1]];
            c += buffer[source[k + 2]];
            d += buffer[source[k + 3]];
        }
#pragma omp simd reduction(+ : a)
        for (int64_t k = fours; k < end; k++) a += buffer[source[k]];
        result += a + b + (c + d);
    }
    return result;
}

void gather_fold_long(int64_t sums, const int32_t *restrict into, const int32_t *restrict start,
                      const int32_t *restrict source, double *restrict buffer) {
    for (int64_t k = 0; k < sums; k++) {
        int64_t first = start[k];
        buffer[into[k]] += sum(start[k + 1] - first, source + first, buffer);
    }
}

void gather_copy_runs(int64_t runs, const int32_t *restrict source, const int32_t *restrict into,
                      const int32_t *restrict length, const double *restrict buffer, double *restrict out,
                      double *restrict status) {
    double bad = 0.0;
    for (int64_t run = 0; run < runs; run++) {
        const double *values = buffer + source[run];
        double *target = out + into[run];
#pragma omp simd reduction(+ : bad)
        for (int64_t k = 0; k < length[run]; k++) {
            double value = values[k];
            target[k] = value;
            bad += 0.0 * value;
        }
    }
    status[0] += bad;
}

void gather_scale_runs(int64_t runs, const int32_t *restrict source, const int32_t *restrict into,
                       const int32_t *restrict length, const int32_t *restrict first, const double *restrict scale,
                       const double *restrict buffer, double *restrict out, double *restrict status) {
    double bad = 0.0;
    for (int64_t run = 0; run < runs; run++) {
        const double *values = buffer + source[run];
        double *target = out + into[run];
        const double *factors = scale + first[run];
#pragma omp simd reduction(+ : bad)
        for (int64_t k = 0; k < length[run]; k++) {
            double value = factors[k] * values[k];
            target[k] = value;
            bad += 0.0 * value;
        }
    }
    status[0] += bad;
}

void gather_scatter(int64_t count, const int32_t *restrict source, const int32_t *restrict at,
                    const double *restrict scale, const double *restrict buffer, double *restrict out,
                    double *restrict status) {
    double bad = 0.0;
    for (int64_t k = 0; k < count; k++) {
        double value = scale[k] * buffer[source[k]];
        out[at[k]] = value;
        bad += 0.0 * value;
    }
    status[0] += bad;
}

void gather_total(int64_t count, const int32_t *restrict source, const double *restrict scale,
                  const double *restrict buffer, double *restrict out, double *restrict status) {
    double value = scale[0] * sum(count, source, buffer);
    out[0] = value;
    status[0] += 0.0 * value;
}
