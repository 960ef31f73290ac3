/* Prepared calls: lists of them, shared by two threads, and the instructions of tapes as one.
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

/* --- A list, one call after the other (calls.c). */

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
    int64_t left, wait;    /* runs until it is tried the other way, and from one such try to the next */
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

/* --- Copies (copy.c). */

/* As memmove. */
API void *copy_block(void *to, const void *from, size_t size);

/* --- A tape's instructions, followed for many instances (tapes.c). */

typedef struct {
    int32_t op, d, a, b, c; /* what to do, the row of the result, those of operands; numbers of inputs and outputs */
} instruction;

/* Instances come in blocks of four; indices and outputs lie in memory block by block. */
typedef struct {
    const double *workspace, *uniform;
    const int32_t *index; /* (blocks, runs, 4): where in the workspace runs of inputs begin */
    double *out;          /* (blocks, outputs, 4) */
    const double *kept;   /* (blocks, width, 4) outputs of another kernel */
    int64_t blocks;
    void (**compiled)(void *); /* machine code for the same, called instead from the moment on that there is some */
    const instruction *code;
    const double *literals;
    double *rows;  /* 64 numbers for each value, aligned to lines of caches */
    int64_t *work; /* counts instructions times blocks */
    int64_t head, count; /* so many instructions are followed once for all blocks, and so many in all */
    int64_t index_stride, out_stride, kept_stride; /* from one block to the next */
} tape_call;

API int64_t tape_run(tape_call *c);
/* The names of all instructions, in order, with spaces between. */
API const char *tape_instructions(void);

#endif
