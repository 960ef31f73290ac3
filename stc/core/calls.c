/* Lists of prepared calls, and what the instructions of tapes are called. */
#include "calls.h"

#include "tapes.h"

int64_t chain_run(const chain *c) {
    for (int64_t k = 0; k < c->count; k++) {
        const chained *each = c->part + k;
        if (each->entry(each->arguments) & each->checked) return k + 1;
    }
    return 0;
}

#define SPELLED(name) #name " "

const char *tape_instructions(void) { return INSTRUCTIONS(SPELLED); }
