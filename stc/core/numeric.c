/* Everything that works on numbers, compiled once for each instruction set: NUMERIC is the name of its table. */
#include "front.h"
#include "load.h"
#include "multifrontal.h"
#include "substitute.h"

const numeric NUMERIC = {NUMERIC_NAME, factorize_all, load_values, solve_system};
