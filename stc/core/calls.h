/* Prepared calls: lists of them, shared by two threads, and tapes as one.
 *
 * A prepared call is a function and the address of its arguments, which stay where they are.  So every call has the
 * same form, a list of calls is a prepared call itself, and functions that know nothing of each other make each
 * other's.  What returns nothing may stand where a result is not looked at.
 */
#ifndef STC_CALLS_H
#define STC_CALLS_H

#include <stddef.h>
#include <stdint.h>

#include "native.h"

typedef int64_t (*prepared)(void *arguments);

/* --- A list, one call after the other (tapes.c). */

typedef struct {
    prepared entry;
    void *arguments;
    int64_t checked; /* -1: the list ends here when the result is not 0; or 0 */
} chained;

typedef struct {
    int64_t count;
    chained part[];
} chain;

/* The place of the call that ended the list, counted from 1, or 0. */
API int64_t chain_run(const chain *c);

/* --- A list that two threads share (pool.c). */

typedef struct job job;

/* The second thread, as Python sees it; what follows in memory is pool.c's own. */
typedef struct {
    job *offered;
    int64_t active, alive, offers, allowed;
} pool;

/* How long a list took lately, which several lists of the same work may have in common. */
typedef struct {
    int64_t runs;          /* so many were timed */
    int64_t alone, helped; /* nanoseconds on one thread and on two, 0 where that is not known */
} timing;

typedef struct {
    prepared entry;
    void *arguments;
    int64_t after; /* so many calls must have ended before */
} task;

struct job {
    pool *helper;
    int64_t next, ended; /* of the tasks */
    int64_t count;
    timing *known;
    int64_t warm; /* it has run before */
    int64_t unused[2];
    task part[];
};

/* NULL where there are no POSIX threads. */
API pool *pool_new(void);
/* What the second thread does until pool_stop. */
API void pool_serve(pool *p);
API void pool_stop(pool *p);
/* Make all calls of a list, on two threads where that is allowed and has been the faster way. */
API int64_t job_run(job *j);

/* --- A tape, evaluated for many instances: by its instructions (tapes.c), or by machine code made from it. */

typedef struct {
    int32_t op, d, a, b, c; /* what to do, the row of the result, those of operands; numbers of inputs and outputs */
} instruction;

/* Instances come in blocks of four; indices and outputs lie in memory block by block. */
typedef struct {
    const double *workspace, *uniform;
    const int32_t *index; /* (blocks, runs, 4): where in the workspace runs of inputs begin */
    double *out;          /* (blocks, outputs, 4) */
    const double *kept;   /* (blocks, width, 4) outputs of another tape */
    const double *literals;
    const void *const *functions; /* tape_functions() */
    int64_t blocks;
    int64_t index_stride, out_stride, kept_stride; /* from one block to the next */
    /* What machine code does without. */
    void (**compiled)(void *); /* machine code for the same, called instead from the moment on that there is some */
    const instruction *code;
    double *rows;        /* 64 numbers for each value, aligned to lines of caches */
    int64_t *work;       /* counts instructions times blocks */
    int64_t head, count; /* so many instructions are followed once for all blocks, and so many in all */
} tape_call;

API int64_t tape_run(tape_call *c);
/* The names of all instructions, in order, with spaces between. */
API const char *tape_instructions(void);
/* By the number of an instruction, what machine code calls for it; NULL for most.  For functions, powers and "sincos"
 * that is a function (from, to, count): count operands, then as many second ones; count results, then as many second
 * ones.  For "fetch" it is (tape_call *, block, to, each, vectors): all inputs of some vectors of one or two blocks each. */
API const void *const *tape_functions(void);

#endif
