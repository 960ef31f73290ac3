/* Goes through the instructions of a tape, for some blocks of instances at once, so that to look at an instruction takes
 * less than to follow it; and what machine code of tapes calls.  Values are in rows, a number for each of these instances:
 *
 *     head    once per call: uniform inputs and literals spread over a row, uniform operations
 *     body    for each chunk: runs of varying inputs fetched, operations, outputs stored
 *
 * stc/codegen/interpreter.py writes the instructions.
 */
#include "calls.h"

/* The instructions of tapes, by number: those that move values, those of tapes (stc/codegen/tape.py), and sine and cosine
 * together. */
#define INSTRUCTIONS(each) \
    each(uniform) each(literal) each(fetch) each(kept) each(store) \
    each(add) each(sub) each(mul) each(div) each(pow) each(neg) each(sqrt) \
    each(sin) each(cos) each(tan) each(asin) each(acos) each(atan) each(atan2) \
    each(sinh) each(cosh) each(tanh) each(exp) each(log) \
    each(clip) each(reaches) each(read) \
    each(sincos)

#define NUMBERED(name) name##_,
enum { INSTRUCTIONS(NUMBERED) };

enum {
    BLOCK = 4,            /* instances that lie beside each other in memory */
    CHUNK = 16,           /* blocks that an instruction is followed for at once */
    ROW = CHUNK * BLOCK,  /* numbers of a row */
    RUN = 4,              /* inputs that are fetched together */
};

/* Four numbers, of one instance or of one block. */
typedef double four __attribute__((vector_size(32), aligned(8), may_alias));
typedef int64_t places __attribute__((vector_size(32)));

#if defined(__clang__)
#define SHUFFLED(a, b, i, j, k, l) __builtin_shufflevector(a, b, i, j, k, l)
#else
#define SHUFFLED(a, b, i, j, k, l) __builtin_shuffle(a, b, (places){i, j, k, l})
#endif

/* A run of inputs of four instances: RUN numbers of each, which lie `apart` from those of the next one in the target. */
static inline void fetch(const double *workspace, const int32_t *index, double *to, int64_t apart) {
    four a = *(const four *)(workspace + index[0]), b = *(const four *)(workspace + index[1]);
    four d = *(const four *)(workspace + index[2]), e = *(const four *)(workspace + index[3]);
    four ab = SHUFFLED(a, b, 0, 4, 2, 6), de = SHUFFLED(d, e, 0, 4, 2, 6);
    *(four *)to = SHUFFLED(ab, de, 0, 1, 4, 5);
    *(four *)(to + 2 * apart) = SHUFFLED(ab, de, 2, 3, 6, 7);
    ab = SHUFFLED(a, b, 1, 5, 3, 7);
    de = SHUFFLED(d, e, 1, 5, 3, 7);
    *(four *)(to + apart) = SHUFFLED(ab, de, 0, 1, 4, 5);
    *(four *)(to + 3 * apart) = SHUFFLED(ab, de, 2, 3, 6, 7);
}

#define FOLLOW(name, value) \
    case name##_: for (int64_t k = 0; k < count; k += BLOCK) *(four *)(d + k) = value; break;
#define A (*(const four *)(a + k))
#define B (*(const four *)(b + k))
/* Functions are those of C, called for one number after the other. */
#define CALLED for (int64_t k = 0; k < count; k++)
#define FOLLOW_CALL(name, value) case name##_: CALLED d[k] = value; break;

/* What machine code leaves to functions. */
#define FUNCTIONS(each) \
    each(asin, asin(a[k])) each(acos, acos(a[k])) each(atan, atan(a[k])) each(atan2, atan2(a[k], b[k])) \
    each(sinh, sinh(a[k])) each(cosh, cosh(a[k])) each(tanh, tanh(a[k])) \
    each(exp, exp(a[k])) each(log, log(a[k])) each(pow, pow(a[k], b[k]))

static void spread(double *row, double x) {
    for (int k = 0; k < ROW; k++) row[k] = x;
}

/* --- Called by machine code. */

#define APPLIED(name, value) \
    static void name##_applied(const double *a, double *d, int64_t count) { \
        const double *b = a + count; \
        (void)b; \
        CALLED d[k] = value; \
    }
FUNCTIONS(APPLIED)

static void sincos_of(const double *a, double *sine, double *cosine, int64_t count) {
    CALLED {
        const double angle = a[k];
        sine[k] = sin(angle);
        cosine[k] = cos(angle);
    }
}

static void sincos_applied(const double *a, double *d, int64_t count) { sincos_of(a, d, d + count, count); }

/* All runs of inputs of some vectors, each of one block or of two beside each other; the last block stands in for one
 * that is missing. */
static void fetch_applied(const tape_call *t, int64_t block, double *to, int64_t each, int64_t vectors) {
    for (const int64_t end = block + each * vectors; block < end && block < t->blocks; block += each) {
        for (int64_t part = 0; part < each; part++) {
            const int64_t its = block + part < t->blocks ? block + part : block;
            const int32_t *index = t->index + its * t->index_stride, *last = index + t->index_stride;
            for (double *run = to + BLOCK * part; index < last; index += BLOCK, run += RUN * BLOCK * each)
                fetch(t->workspace, index, run, BLOCK * each);
        }
        to += RUN * each * t->index_stride;
    }
}

#define LISTED(name, value) [name##_] = (const void *)name##_applied,
static const void *const functions[] = {FUNCTIONS(LISTED) LISTED(sincos, ) LISTED(fetch, )};

const void *const *tape_functions(void) { return functions; }

#define SPELLED(name) #name " "

const char *tape_instructions(void) { return INSTRUCTIONS(SPELLED); }

/* --- Instructions. */

/* Some instructions for some blocks, the first of which is `block`. */
static void follow(const tape_call *t, const instruction *i, const instruction *end, int64_t block, int64_t blocks) {
    double *const rows = t->rows;
    const int64_t count = BLOCK * blocks;
    for (; i < end; i++) {
        double *d = rows + ROW * (int64_t)i->d;
        const double *a = rows + ROW * (int64_t)i->a, *b = rows + ROW * (int64_t)i->b;
        double *c = rows + ROW * (int64_t)i->c;
        switch (i->op) {
        case uniform_: spread(d, t->uniform[i->a]); break;
        case literal_: spread(d, t->literals[i->a]); break;
        case fetch_: {
            const int32_t *index = t->index + block * t->index_stride + BLOCK * i->a;
            for (int64_t k = 0; k < blocks; k++) fetch(t->workspace, index + k * t->index_stride, d + BLOCK * k, ROW);
            break;
        }
        case kept_: {
            const double *from = t->kept + block * t->kept_stride + BLOCK * i->a;
            for (int64_t k = 0; k < blocks; k++) *(four *)(d + BLOCK * k) = *(const four *)(from + k * t->kept_stride);
            break;
        }
        case store_: {
            double *to = t->out + block * t->out_stride + BLOCK * i->b;
            for (int64_t k = 0; k < blocks; k++) *(four *)(to + k * t->out_stride) = *(const four *)(a + BLOCK * k);
            break;
        }
        FOLLOW(add, A + B)
        FOLLOW(sub, A - B)
        FOLLOW(mul, A * B)
        FOLLOW(div, A / B)
        FOLLOW(neg, -A)
        FOLLOW_CALL(sqrt, sqrt(a[k]))
        FOLLOW_CALL(sin, sin(a[k]))
        FOLLOW_CALL(cos, cos(a[k]))
        case sincos_: sincos_of(a, d, c, count); break;
        /* As machine code does, which has both of them already. */
        FOLLOW_CALL(tan, sin(a[k]) / cos(a[k]))
        FUNCTIONS(FOLLOW_CALL)
        /* Looking up a table: stc/symbolic/tables.py. */
        case clip_:
            for (int64_t k = 0; k < count; k++) {
                double x = a[k] > 0.0 ? a[k] : 0.0;
                d[k] = trunc(x < b[k] ? x : b[k]);
            }
            break;
        case reaches_:
            for (int64_t k = 0; k < count; k++) d[k] = a[k] <= b[k] ? 1.0 : 0.0;
            break;
        case read_:
            for (int64_t k = 0; k < count; k++) d[k] = t->uniform[(int32_t)(a[k] + b[k])];
            break;
        default: break;
        }
    }
}

int64_t tape_run(tape_call *t) {
    if (*t->compiled) {
        (*t->compiled)(t);
        return 0;
    }
    *t->work += (t->count - t->head) * t->blocks;
    const int64_t first = t->blocks < CHUNK ? t->blocks : CHUNK;
    const instruction *body = t->code + t->head, *end = t->code + t->count;
    follow(t, t->code, body, 0, first);
    for (int64_t block = 0; block < t->blocks; block += CHUNK) {
        const int64_t left = t->blocks - block, blocks = left < CHUNK ? left : CHUNK;
        follow(t, body, end, block, blocks);
    }
    return 0;
}

/* --- A list of calls. */

int64_t chain_run(const chain *c) {
    for (int64_t k = 0; k < c->count; k++) {
        const chained *each = c->part + k;
        if (each->entry(each->arguments) & each->checked) return k + 1;
    }
    return 0;
}
