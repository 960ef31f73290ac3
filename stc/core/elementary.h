/* Elementary functions of vectors, without branches.
 *
 * Each one reduces its argument, evaluates one polynomial and undoes the reduction by integer arithmetic on the
 * representation or by selection.  Reductions follow Cody & Waite (Software Manual for the Elementary Functions, 1980);
 * the polynomials are Chebyshev interpolants computed in exact rational arithmetic and rounded to double.
 *
 * Largest errors measured, in units in the last place: sin, cos 1.4 up to |x| = 1e8 (1.8 without fused multiply-add);
 * tan 2.8; exp 1; log 0.7; sinh, cosh, tanh 2; asin, acos, atan, atan2 1.9; pow 1.2.
 *
 * Invalid arguments give nan, poles infinities, as in C.  One limit: beyond LARGEST_ANGLE (3.5e13, where neighbouring
 * doubles are 0.004 apart; less without fused multiply-add) sin, cos and tan give nan, for hardly an angle is left in the
 * argument.  Products and sums are rounded as they are written, so what includes this file has to be compiled without
 * contraction.
 */
#ifndef STC_ELEMENTARY_H
#define STC_ELEMENTARY_H

#include "vectors.h"

#if defined(__x86_64__)
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

#if defined(__FMA__) || defined(__aarch64__)
#define FUSED 1
#else
#define FUSED 0
#endif

/* Representations: without a sign, so that sums may go round. */
typedef uint64_t words __attribute__((vector_size(8 * LANES), aligned(8), may_alias));

/* a b + c with one rounding. */
static inline lanes fused_of(lanes a, lanes b, lanes c) {
#if defined(__AVX512F__)
    return (lanes)_mm512_fmadd_pd((__m512d)a, (__m512d)b, (__m512d)c);
#elif defined(__FMA__)
    return (lanes)_mm256_fmadd_pd((__m256d)a, (__m256d)b, (__m256d)c);
#elif defined(__aarch64__)
    return (lanes)vfmaq_f64((float64x2_t)c, (float64x2_t)a, (float64x2_t)b);
#else
    for (int k = 0; k < LANES; k++) c[k] = fma(a[k], b[k], c[k]);
    return c;
#endif
}

/* The same with one rounding or two, whichever is fast. */
static inline lanes fma_of(lanes a, lanes b, lanes c) {
    if (FUSED) return fused_of(a, b, c);
    return a * b + c;
}

static inline lanes root_of(lanes x) {
#if defined(__AVX512F__)
    return (lanes)_mm512_sqrt_pd((__m512d)x);
#elif defined(__AVX__)
    return (lanes)_mm256_sqrt_pd((__m256d)x);
#elif defined(__x86_64__)
    return (lanes)_mm_sqrt_pd((__m128d)x);
#else
    for (int k = 0; k < LANES; k++) x[k] = sqrt(x[k]);
    return x;
#endif
}

static inline lanes select_of(masks where, lanes yes, lanes no) {
#if defined(__AVX__) && !defined(__AVX512F__)
    return (lanes)_mm256_blendv_pd((__m256d)no, (__m256d)yes, (__m256d)where);
#else
    return (lanes)((where & (masks)yes) | (~where & (masks)no));
#endif
}

#define TOP ((uint64_t)1 << 63)

static inline words sign_of(lanes x) { return (words)x & TOP; }

static inline lanes flip_of(lanes x, words sign) { return (lanes)((words)x ^ sign); }

static inline lanes with_sign_of(lanes size, lanes y) { return flip_of(magnitude_of(size), sign_of(y)); }

static inline uint64_t bits_of(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* Coefficients from the constant term up. */
#define POLYNOMIAL(x, c) polynomial_of(x, c, (int)(sizeof(c) / sizeof(c)[0]))
static inline lanes polynomial_of(lanes x, const double *c, int count) {
    lanes sum = all_of(c[count - 1]);
    for (int k = count - 2; k >= 0; k--) sum = fma_of(sum, x, all_of(c[k]));
    return sum;
}

#define TO_WHOLE (1.5 * 0x1p52) /* adding it rounds to a whole number, which then fills the low bits */
#define PI 3.141592653589793
#define PI_LOW 1.2246467991473532e-16
#define LOG2_E 0x1.71547652b82fep+0
#define LN2_HIGH 0x1.62e42fee00000p-1 /* 32 bits: products with exponents are exact */
#define LN2_LOW 0x1.a39ef35793c76p-33
#define TAN_EIGHTH_PI 0.41421356237309503
#define ROOT_HALF 0.7071067811865476

#if FUSED
#define LARGEST_ANGLE 0x1p45
static const double half_pi[] = {0x1.921fb54442d18p+0, 0x1.1a62633145c07p-54, -0x1.f1976b7ed8fbcp-110};
#else
#define LARGEST_ANGLE 1.05e8
/* Parts of 26 bits: products with whole numbers below 2^27 are exact. */
static const double half_pi[] = {0x1.921fb50000000p+0, 0x1.110b460000000p-26, 0x1.1a62630000000p-54,
                                 0x1.8a2e030000000p-81, 0x1.c1cd128000000p-107};
#endif
/* (sin r - r) / r^3 and cos r in r^2, |r| <= pi/4. */
static const double sine_terms[] = {-0.16666666666666666, 0.008333333333330946, -0.0001984126983675497,
                                    2.755731610068303e-06, -2.5051131455427946e-08, 1.591810123027412e-10};
static const double cosine_terms[] = {1.0, -0.5, 0.041666666666666664, -0.0013888888888887395,
                                      2.4801587298763433e-05, -2.7557317270560326e-07, 2.0876146024689747e-09,
                                      -1.1382614868556325e-11};
/* (e^r - 1 - r) / r^2, |r| <= ln(2)/2. */
static const double exp_terms[] = {0.5, 0.1666666666666667, 0.04166666666666667, 0.008333333333326136,
                                   0.0013888888888883748, 0.00019841269874820627, 2.4801587325547743e-05,
                                   2.7557255400206422e-06, 2.75572736431103e-07, 2.5105217004720745e-08,
                                   2.0914686968086876e-09};
/* (log((1+s)/(1-s)) - 2s) / s^3 in s^2, |s| <= (sqrt(2)-1)/(sqrt(2)+1). */
static const double log_terms[] = {0.6666666666666666, 0.4000000000000088, 0.2857142857080285, 0.22222222391887064,
                                   0.18181795621632782, 0.15386240708969665, 0.13268746195596595,
                                   0.1308690788796503};
/* (atan t - t) / t^3 in t^2, |t| <= tan(pi/8). */
static const double atan_terms[] = {-0.3333333333333333, 0.19999999999999804, -0.14285714285659729,
                                    0.11111111105145725, -0.09090908753017178, 0.07692296361048218,
                                    -0.06666424634599337, 0.05878926110528101, -0.052304330074828924,
                                    0.04551496237494931, -0.03456806801496888, 0.016282993238924487};

/* --- Circular functions. */

static inline void sine_cosine(lanes x, lanes *sine, lanes *cosine) {
    x = select_of(magnitude_of(x) <= all_of(LARGEST_ANGLE), x, all_of(NAN));
    lanes shifted = fma_of(x, all_of(2.0 / PI), all_of(TO_WHOLE)), quarters = shifted - all_of(TO_WHOLE), r = x;
    words turns = (words)shifted; /* the whole number in its low bits */
    for (int k = 0; k < (int)(sizeof half_pi / sizeof half_pi[0]); k++) r = fma_of(quarters, all_of(-half_pi[k]), r);
    lanes z = r * r, s = fma_of(z * r, POLYNOMIAL(z, sine_terms), r), c = POLYNOMIAL(z, cosine_terms);
    masks odd = (masks)(0 - (turns & 1));
    *sine = flip_of(select_of(odd, c, s), (turns << 62) & TOP);
    *cosine = flip_of(select_of(odd, s, c), ((turns + 1) << 62) & TOP);
}

/* The angle of the point (x, y), in [-pi, pi], for any signs, zeros and infinities. */
static inline lanes angle_of(lanes y, lanes x) {
    const lanes zero = {0};
    lanes width = magnitude_of(x), height = magnitude_of(y);
    masks steep = height > width;
    lanes small = select_of(steep, width, height), large = select_of(steep, height, width);
    /* First octant; its upper half is turned by pi/4: atan(s/l) = pi/4 + atan((s-l)/(s+l)).  On the diagonal, 0/0 and
     * inf/inf included, the angle is pi/4, but 0 at the origin. */
    masks upper = small > large * all_of(TAN_EIGHTH_PI), diagonal = small == large;
    masks turned = (diagonal & (large > zero)) | upper;
    lanes quotient = select_of(upper, small - large, small) / select_of(upper, small + large, large);
    lanes t = select_of(diagonal, zero, quotient), z = t * t;
    lanes high = select_of(turned, all_of(PI / 4), zero), low = select_of(turned, all_of(PI_LOW / 4), zero);
    lanes angle = high + (t + fma_of(z * t, POLYNOMIAL(z, atan_terms), low));
    angle = select_of(steep, all_of(PI / 2) - (angle - all_of(PI_LOW / 2)), angle);
    angle = select_of((masks)x < 0, all_of(PI) - (angle - all_of(PI_LOW)), angle);
    return select_of((x != x) | (y != y), all_of(NAN), with_sign_of(angle, y));
}

/* sqrt(1 - x^2), without cancellation near 1. */
static inline lanes leg_of(lanes x) { return root_of((all_of(1.0) - x) * (all_of(1.0) + x)); }

/* --- Exponentials. */

/* x = n ln 2 + r: r and n. */
static inline lanes reduced_of(lanes x, words *n) {
    lanes shifted = fma_of(x, all_of(LOG2_E), all_of(TO_WHOLE)), whole = shifted - all_of(TO_WHOLE);
    *n = (words)shifted - bits_of(TO_WHOLE);
    return fma_of(whole, all_of(-LN2_LOW), fma_of(whole, all_of(-LN2_HIGH), x));
}

/* 2^n for -1022 <= n <= 1023. */
static inline lanes power_of_two(words n) { return (lanes)((n + 1023) << 52); }

/* e^(x + low), where low is tiny beside x. */
static inline lanes exp_of(lanes x, const lanes *low) {
    words n;
    x = select_of(x < all_of(-746.0), all_of(-746.0), x);
    lanes r = reduced_of(select_of(x > all_of(710.0), all_of(710.0), x), &n);
    lanes tail = fma_of(r * r, POLYNOMIAL(r, exp_terms), r);
    if (low) tail = fma_of(all_of(1.0) + tail, *low, tail);
    words half = (words)((masks)n >> 1); /* 2^n itself may leave the range */
    return (all_of(1.0) + tail) * power_of_two(half) * power_of_two(n - half);
}

/* (e^size - 1) / 4 for size >= 0, accurate near zero; finite as long as four times it nearly is. */
static inline lanes quarter_expm1_of(lanes size) {
    words n;
    lanes r = reduced_of(select_of(size > all_of(710.6), all_of(710.6), size), &n);
    lanes rest = fma_of(r * r, POLYNOMIAL(r, exp_terms), r), scale = power_of_two(n - 2);
    return fma_of(scale, rest, scale - all_of(0.25));
}

static inline lanes sinh_of(lanes x) {
    lanes q = quarter_expm1_of(magnitude_of(x));
    lanes half = q + q / fma_of(q, all_of(4.0), all_of(1.0));
    return with_sign_of(half + half, x);
}

static inline lanes cosh_of(lanes x) {
    lanes q = quarter_expm1_of(magnitude_of(x)) + all_of(0.25);
    return (q + q) + all_of(0.125) / q;
}

static inline lanes tanh_of(lanes x) {
    lanes size = magnitude_of(x);
    size = select_of(size > all_of(22.0), all_of(22.0), size); /* beyond, the result rounds to one */
    lanes q = quarter_expm1_of(size + size);
    return with_sign_of(q / (q + all_of(0.5)), x);
}

/* --- Logarithm and power. */

/* x = 2^k (1 + f) with 1 + f in [sqrt(1/2), sqrt(2)). */
static inline void log_parts(lanes x, lanes *k, lanes *f) {
    masks tiny = x < all_of(0x1p-1022);
    x = select_of(tiny, x * all_of(0x1p54), x);
    /* Move the point where the exponent steps from 1 to sqrt(2). */
    words bits = (words)x + (bits_of(1.0) - bits_of(ROOT_HALF)), biased = (bits >> 52) | bits_of(0x1p52);
    *k = (lanes)biased + select_of(tiny, all_of(-0x1p52 - 1023.0 - 54.0), all_of(-0x1p52 - 1023.0));
    *f = (lanes)((bits & (((uint64_t)1 << 52) - 1)) + bits_of(ROOT_HALF)) - all_of(1.0);
}

/* Zero, negative, infinite and nan arguments. */
static inline lanes log_poles(lanes x, lanes result) {
    result = select_of(x < all_of(INFINITY), result, x);
    result = select_of(x < all_of(0.0), all_of(NAN), result);
    return select_of(x == all_of(0.0), all_of(-INFINITY), result);
}

static inline lanes log_of(lanes x) {
    lanes k, f;
    log_parts(x, &k, &f);
    lanes s = f / (f + all_of(2.0)), z = s * s, half_square = (f * all_of(0.5)) * f;
    /* log(1+f) = f - f^2/2 + s (f^2/2 + s^2 P(s^2)): the rounding of s hardly matters in this form. */
    lanes tail = fma_of(k, all_of(LN2_LOW), s * fma_of(z, POLYNOMIAL(z, log_terms), half_square));
    return log_poles(x, fma_of(k, all_of(LN2_HIGH), f - (half_square - tail)));
}

/* log x, 0 < x < inf, as an unevaluated sum with an error near 2^-60. */
static inline lanes log_pair(lanes x, lanes *low_part) {
    lanes k, f;
    log_parts(x, &k, &f);
    lanes divisor = f + all_of(2.0), divisor_low = f - (divisor - all_of(2.0)), s = f / divisor;
    lanes rest = fused_of(-s, divisor, f) - s * divisor_low, s_low = rest / divisor, z = s * s;
    lanes cubic = (z * s) * POLYNOMIAL(z, log_terms), main = s + s;
    lanes high_part = k * all_of(LN2_HIGH); /* exact */
    lanes low = fma_of(k, all_of(LN2_LOW), (s_low + s_low) + cubic);
    /* Two sums without error: the larger operand first (zero when k = 0, and then the sum is exact anyway). */
    lanes total = high_part + main, virtual = total - high_part;
    low = low + ((high_part - (total - virtual)) + (main - virtual));
    lanes high = total + low;
    *low_part = low - (high - total);
    return high;
}

/* Whether these are whole numbers: to add and subtract 2^52 rounds the smaller ones. */
static inline masks is_whole(lanes x) {
    lanes size = magnitude_of(x);
    return (size >= all_of(0x1p52)) | ((size + all_of(0x1p52)) - all_of(0x1p52) == size);
}

/* C's pow: whole exponents of negative bases included, other exponents of them are nan. */
static inline lanes pow_of(lanes x, lanes y) {
    const lanes zero = {0}, one = all_of(1.0);
    lanes size = magnitude_of(x), low, high = log_poles(size, log_pair(size, &low));
    lanes product = y * high, error = fma_of(y, low, fused_of(y, high, -product));
    error = select_of(magnitude_of(product) < all_of(1e4), error, zero);
    lanes result = exp_of(product, &error);
    masks whole = is_whole(y), odd = whole & ~is_whole(y * all_of(0.5));
    result = select_of(odd, flip_of(result, sign_of(x)), result);
    result = select_of((x < zero) & (x > all_of(-INFINITY)) & ~whole, all_of(NAN), result);
    result = select_of((x != x) | (y != y), all_of(NAN), result);
    /* 1^y and x^0 are one for everything, nan included; so is (-1)^inf. */
    masks unit = (y == zero) | (x == one), endless = (x == all_of(-1.0)) & (magnitude_of(y) == all_of(INFINITY));
    return select_of(unit | endless, one, result);
}

#endif
