/* The factorisation's part that works on numbers, compiled once for each instruction set. */
#include "front.h"
#include "load.h"
#include "multifrontal.h"
#include "substitute.h"

int64_t NAMED(tape)(tape_call *);
const numeric NAMED(numeric) = {NAME_OF(KIND), factorize_all, load_values, solve_system, NAMED(tape)};
