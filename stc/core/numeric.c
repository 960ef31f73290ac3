/* Everything that works on numbers, in one unit, since its inner loops are to be copied into their callers. */
#include "front.h"
#include "load.h"
#include "multifrontal.h"
#include "substitute.h"
