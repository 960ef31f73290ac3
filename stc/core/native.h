/* What the solver's functions share: how they are declared, whole numbers rounded down, extrema, prepared calls.
 *
 * A function marked API can be called from Python, and through pointers by other machine code, as a prepared call: its
 * arguments lie in consecutive cells of 8 bytes each.  That entry, NAME_cells, is written when the library is compiled,
 * from the declaration in the header (see compiling.py), as is what Python is told of it, NAME_signature.  Whole numbers
 * are 64 bits wide, indices in arrays 32 bits.  A structure marked API_STRUCT is told to Python as well, NAME_fields:
 * Python fills it, and functions take its address.
 * Arrays that a function writes to must not overlap its other arrays, where they are marked restrict.
 */
#ifndef STC_NATIVE_H
#define STC_NATIVE_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

#if defined(_WIN32)
#define API __declspec(dllexport)
#else
#define API __attribute__((visibility("default")))
#endif
#define API_STRUCT struct
#define ALWAYS_INLINE static inline __attribute__((always_inline))

/* What a prepared call finds in each of its cells. */
typedef union {
    int64_t i;
    double d;
    void *p;
} cell;

ALWAYS_INLINE int64_t imin(int64_t a, int64_t b) { return b < a ? b : a; }
ALWAYS_INLINE int64_t imax(int64_t a, int64_t b) { return b > a ? b : a; }

/* The first one stays where they are equal or one of them is no number. */
ALWAYS_INLINE double dmin(double a, double b) { return b < a ? b : a; }
ALWAYS_INLINE double dmax(double a, double b) { return b > a ? b : a; }

/* Not a number where one of them is none. */
ALWAYS_INLINE double nanmin(double a, double b) { return a < b || a != a ? a : b; }
ALWAYS_INLINE double nanmax(double a, double b) { return a > b || a != a ? a : b; }

/* Loops add up numbers, or find the largest or smallest, in any order where they say so (omp simd): with registers side
 * by side.  Flags that would let compilers reorder all sums cost infinity and what is no number their meaning. */
#pragma omp declare reduction(highest : double : omp_out = nanmax(omp_out, omp_in)) initializer(omp_priv = omp_orig)
#pragma omp declare reduction(lowest : double : omp_out = nanmin(omp_out, omp_in)) initializer(omp_priv = omp_orig)

ALWAYS_INLINE double squared(double x) { return x * x; }

ALWAYS_INLINE int64_t count_bits(int64_t x) { return __builtin_popcountll((unsigned long long)x); }

/* Makes the call at a place of a table: its entry and the address of its cells stand side by side. */
ALWAYS_INLINE int64_t invoke(const int64_t *calls, int64_t place) {
    int64_t (*entry)(void *) = (int64_t (*)(void *))(intptr_t)calls[2 * place];
    return entry((void *)(intptr_t)calls[2 * place + 1]);
}

#endif
