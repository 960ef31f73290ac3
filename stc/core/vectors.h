/* Vectors as long as the instruction set has them, by the extension that GCC and Clang share. */
#ifndef STC_VECTORS_H
#define STC_VECTORS_H

#include <math.h>
#include <stdint.h>
#include <string.h>
#if defined(__AVX__)
#include <immintrin.h>
#elif defined(__SSE2__)
#include <emmintrin.h>
#endif

#if defined(__AVX512F__)
#define LANES 8
#define TILE_VECTORS 3 /* of rows, and columns of a tile of products held in registers */
#define TILE_COLUMNS 8
#elif defined(__AVX__)
#define LANES 4
#define TILE_VECTORS 3
#define TILE_COLUMNS 4
#elif defined(__aarch64__)
#define LANES 2
#define TILE_VECTORS 4
#define TILE_COLUMNS 4
#else
#define LANES 2
#define TILE_VECTORS 2
#define TILE_COLUMNS 4
#endif

typedef double lanes __attribute__((vector_size(8 * LANES), aligned(8), may_alias));
typedef int64_t masks __attribute__((vector_size(8 * LANES), aligned(8), may_alias));

static inline lanes all_of(double x) { return x - (lanes){0}; }

static inline lanes magnitude_of(lanes x) {
    const masks sign = (masks)all_of(0.0) + INT64_MAX;
    return (lanes)((masks)x & sign);
}

/* The larger of each two; b where one is not a number. */
static inline lanes larger_of(lanes a, lanes b) {
#if defined(__AVX512F__)
    return (lanes)_mm512_max_pd((__m512d)a, (__m512d)b);
#elif defined(__AVX__)
    return (lanes)_mm256_max_pd((__m256d)a, (__m256d)b);
#elif defined(__SSE2__)
    return (lanes)_mm_max_pd((__m128d)a, (__m128d)b);
#else
    masks more = a > b;
    return (lanes)((more & (masks)a) | (~more & (masks)b));
#endif
}

/* Round up to whole lines of a cache. */
static inline int32_t padded(int32_t count) { return (count + 7) & ~7; }

/* The largest magnitude of count numbers from x on. */
static inline double largest_of(const double *x, int32_t count) {
    lanes most = {0};
    int32_t i = 0;
    for (; i + LANES <= count; i += LANES) most = larger_of(magnitude_of(*(const lanes *)(x + i)), most);
    double found = 0.0;
    for (int k = 0; k < LANES; k++) found = most[k] > found ? most[k] : found;
    for (; i < count; i++) found = fabs(x[i]) > found ? fabs(x[i]) : found;
    return found;
}

#endif
