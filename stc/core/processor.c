/* What the library was compiled for and from, and what this processor can do. */
#include "processor.h"

#include <string.h>

#if defined(CORE_X86)
#include <cpuid.h>
#endif

#if !defined(CORE_SOURCES)
#define CORE_SOURCES ""
#endif

const char *core_sources(void) { return CORE_SOURCES; }

const char *core_best_instructions(void) {
#if defined(CORE_X86)
    unsigned a, b, c, d, low, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_OSXSAVE) || !(c & bit_FMA) || !(c & bit_POPCNT)) return "baseline";
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    if ((low & 6) != 6 || !__get_cpuid_count(7, 0, &a, &b, &c, &d) || !(b & bit_AVX2)) return "baseline";
    if (!(b & bit_BMI) || !(b & bit_BMI2)) return "baseline";
    if ((low & 0xe6) == 0xe6 && (b & bit_AVX512F) && (b & bit_AVX512DQ) && (b & bit_AVX512VL)) return "avx512";
    return "avx2";
#else
    return "baseline";
#endif
}
