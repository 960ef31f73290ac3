/* There is one library for each instruction set: "baseline", and on x86-64 "avx2" and "avx512". */
#ifndef STC_PROCESSOR_H
#define STC_PROCESSOR_H

#include "native.h"

/* A digest of the sources that the library was compiled from. */
API const char *core_sources(void);
/* The name of the best instruction set that this processor has. */
API const char *core_best_instructions(void);

#endif
