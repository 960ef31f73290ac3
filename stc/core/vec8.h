/* Vectors of eight doubles, as many registers as that takes: eight numbers are what inner loops go by on every machine.
 *
 * Compilers have such vectors themselves, but GCC keeps those in memory that are longer than registers are.  So there
 * are functions in place of operators.  Where registers are scarce, loops go by lanes (vectors.h) instead, one register
 * at a time, with the functions whose names end in w.
 */
#ifndef STC_VEC8_H
#define STC_VEC8_H

#include <math.h>
#include <stdint.h>

#include "vectors.h"

#if defined(__AVX__)
#include <immintrin.h>
#elif defined(__SSE2__)
#include <emmintrin.h>
#endif

typedef struct {
    lanes part[8 / LANES];
} vec8;

/* E(k) for each part. */
#if LANES == 8
#define EACH(E) ((vec8){{E(0)}})
#elif LANES == 4
#define EACH(E) ((vec8){{E(0), E(1)}})
#else
#define EACH(E) ((vec8){{E(0), E(1), E(2), E(3)}})
#endif

#define INLINE static inline __attribute__((always_inline))

/* --- One register. */

INLINE lanes loadw(const double *x, int64_t k) { return *(const lanes *)(x + k); }
INLINE void storew(double *x, int64_t k, lanes v) { *(lanes *)(x + k) = v; }
INLINE lanes splatw(double value) { return value - (lanes){0}; }
/* 1 where a number is negative, 0 elsewhere. */
INLINE lanes negativew(lanes v) { return (lanes)((v < splatw(0.0)) & (masks)splatw(1.0)); }

/* --- Eight numbers. */

INLINE vec8 load8(const double *x, int64_t k) {
#define E(p) loadw(x, k + LANES * (p))
    return EACH(E);
#undef E
}

INLINE vec8 splat8(double value) {
#define E(p) splatw(value)
    return EACH(E);
#undef E
}

INLINE vec8 add8(vec8 a, vec8 b) {
#define E(p) a.part[p] + b.part[p]
    return EACH(E);
#undef E
}

INLINE vec8 sub8(vec8 a, vec8 b) {
#define E(p) a.part[p] - b.part[p]
    return EACH(E);
#undef E
}

INLINE vec8 mul8(vec8 a, vec8 b) {
#define E(p) a.part[p] * b.part[p]
    return EACH(E);
#undef E
}

INLINE vec8 div8(vec8 a, vec8 b) {
#define E(p) a.part[p] / b.part[p]
    return EACH(E);
#undef E
}

INLINE vec8 neg8(vec8 v) {
#define E(p) -v.part[p]
    return EACH(E);
#undef E
}

/* factor v */
INLINE vec8 scaled8(double factor, vec8 v) {
#define E(p) factor * v.part[p]
    return EACH(E);
#undef E
}

/* a + b c, a - b c */
INLINE vec8 add_product8(vec8 a, vec8 b, vec8 c) {
#define E(p) a.part[p] + b.part[p] * c.part[p]
    return EACH(E);
#undef E
}

INLINE vec8 sub_product8(vec8 a, vec8 b, vec8 c) {
#define E(p) a.part[p] - b.part[p] * c.part[p]
    return EACH(E);
#undef E
}

INLINE vec8 abs8(vec8 v) {
#define E(p) magnitude_of(v.part[p])
    return EACH(E);
#undef E
}

INLINE vec8 max8(vec8 a, vec8 b) {
#define E(p) larger_of(a.part[p], b.part[p])
    return EACH(E);
#undef E
}

INLINE vec8 negative8(vec8 v) {
#define E(p) negativew(v.part[p])
    return EACH(E);
#undef E
}

INLINE void store8(double *x, int64_t k, vec8 v) {
    for (int p = 0; p < 8 / LANES; p++) storew(x, k + LANES * p, v.part[p]);
}

/* store8 that goes past the caches, for what is read much later; x + k must begin a line of 64 bytes. */
INLINE void stream8(double *x, int64_t k, vec8 v) {
#if defined(__AVX512F__)
    _mm512_stream_pd(x + k, (__m512d)v.part[0]);
#elif defined(__AVX__)
    _mm256_stream_pd(x + k, (__m256d)v.part[0]);
    _mm256_stream_pd(x + k + 4, (__m256d)v.part[1]);
#elif defined(__SSE2__)
    for (int p = 0; p < 4; p++) _mm_stream_pd(x + k + 2 * p, (__m128d)v.part[p]);
#else
    store8(x, k, v);
#endif
}

/* Asks for memory to be near soon; it need not exist. */
INLINE void prefetch8(const double *x, int64_t k) {
    __builtin_prefetch((const char *)((uintptr_t)x + 8 * (uintptr_t)k), 0, 3);
}

/* The elements of x at places[k] to places[k + 7]: one by one, which is as fast as the instructions for it. */
INLINE vec8 gather8(const double *x, const int32_t *places, int64_t k) {
#define AT(lane) x[places[k + (lane)]]
#if LANES == 8
    return (vec8){{{AT(0), AT(1), AT(2), AT(3), AT(4), AT(5), AT(6), AT(7)}}};
#elif LANES == 4
    return (vec8){{{AT(0), AT(1), AT(2), AT(3)}, {AT(4), AT(5), AT(6), AT(7)}}};
#else
    return (vec8){{{AT(0), AT(1)}, {AT(2), AT(3)}, {AT(4), AT(5)}, {AT(6), AT(7)}}};
#endif
#undef AT
}

INLINE void scatter8(double *x, const int32_t *places, int64_t k, vec8 v) {
    for (int lane = 0; lane < 8; lane++) x[places[k + lane]] = v.part[lane / LANES][lane % LANES];
}

/* Lanes of two vectors of four, the second one's counted on from the first one's. */
typedef double vec4 __attribute__((vector_size(32), aligned(8), may_alias));
#define CHOSEN(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)

/* The largest of the eight; what is no number may be passed over. */
INLINE double largest8(vec8 v) {
    lanes most = v.part[0];
    for (int p = 1; p < 8 / LANES; p++) most = larger_of(v.part[p], most);
#if LANES == 8
    most = larger_of(most, CHOSEN(most, most, 4, 5, 6, 7, 0, 1, 2, 3));
    most = larger_of(most, CHOSEN(most, most, 2, 3, 0, 1, 6, 7, 4, 5));
#elif LANES == 4
    most = larger_of(most, CHOSEN(most, most, 2, 3, 0, 1));
#endif
    return most[1] > most[0] ? most[1] : most[0];
}

/* The sum of the eight, in any order. */
INLINE double sum8(vec8 v) {
    lanes sum = v.part[0];
    for (int p = 1; p < 8 / LANES; p++) sum += v.part[p];
#if LANES == 8
    vec4 four = CHOSEN(sum, sum, 0, 1, 2, 3) + CHOSEN(sum, sum, 4, 5, 6, 7);
    return (four[0] + four[2]) + (four[1] + four[3]);
#elif LANES == 4
    return (sum[0] + sum[2]) + (sum[1] + sum[3]);
#else
    return sum[0] + sum[1];
#endif
}

#undef INLINE

#endif
