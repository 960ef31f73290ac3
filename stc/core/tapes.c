/* Goes through the instructions of a tape, for some blocks of instances at once, so that to look at an instruction takes
 * less than to follow it.  Values are in rows, a number for each of these instances:
 *
 *     head    once per call: uniform inputs and literals spread over a row, uniform operations
 *     body    for each chunk: runs of varying inputs fetched, operations, outputs stored
 *
 * stc/codegen/interpreter.py writes the instructions.
 */
#include "calls.h"
#include "elementary.h"
#include "tapes.h"

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

/* The runs of inputs of some blocks, into RUN rows from `row` on. */
static void fetch(const tape_call *c, const int32_t *index, double *row, int64_t blocks) {
    for (int64_t k = 0; k < blocks; k++, index += c->index_stride, row += BLOCK) {
        four a = *(const four *)(c->workspace + index[0]), b = *(const four *)(c->workspace + index[1]);
        four d = *(const four *)(c->workspace + index[2]), e = *(const four *)(c->workspace + index[3]);
        four ab = SHUFFLED(a, b, 0, 4, 2, 6), de = SHUFFLED(d, e, 0, 4, 2, 6);
        *(four *)row = SHUFFLED(ab, de, 0, 1, 4, 5);
        *(four *)(row + 2 * ROW) = SHUFFLED(ab, de, 2, 3, 6, 7);
        ab = SHUFFLED(a, b, 1, 5, 3, 7);
        de = SHUFFLED(d, e, 1, 5, 3, 7);
        *(four *)(row + ROW) = SHUFFLED(ab, de, 0, 1, 4, 5);
        *(four *)(row + 3 * ROW) = SHUFFLED(ab, de, 2, 3, 6, 7);
    }
}

/* Vectors may reach beyond the last block, where rows have numbers that mean nothing; places in memory may not. */
#define EACH for (int64_t k = 0; k < count; k += LANES)
#define A (*(const lanes *)(a + k))
#define B (*(const lanes *)(b + k))
#define C (*(const lanes *)(c + k))
#define D (*(lanes *)(d + k))
#define FOLLOW(name, value) case name##_: EACH D = value; break

static void spread(double *row, double x) {
    for (int k = 0; k < ROW; k++) row[k] = x;
}

/* Some instructions for some blocks, the first of which is `block`. */
static void follow(const tape_call *t, const instruction *i, const instruction *end, int64_t block, int64_t blocks) {
    double *const rows = t->rows;
    const int64_t count = BLOCK * blocks;
    for (; i < end; i++) {
        double *d = rows + ROW * (int64_t)i->d;
        const double *a = rows + ROW * (int64_t)i->a, *b = rows + ROW * (int64_t)i->b;
        double *c = rows + ROW * (int64_t)i->c;
        lanes other;
        switch (i->op) {
        case uniform_: spread(d, t->uniform[i->a]); break;
        case literal_: spread(d, t->literals[i->a]); break;
        case fetch_: fetch(t, t->index + block * t->index_stride + BLOCK * i->a, d, blocks); break;
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
        FOLLOW(add, A + B);
        FOLLOW(sub, A - B);
        FOLLOW(mul, A * B);
        FOLLOW(div, A / B);
        FOLLOW(neg, -A);
        FOLLOW(sqrt, root_of(A));
        FOLLOW(fma, fused_of(A, B, C));
        FOLLOW(fms, fused_of(A, B, -C));
        FOLLOW(fnma, fused_of(-A, B, C));
        case sin_: EACH sine_cosine(A, &D, &other); break;
        case cos_: EACH sine_cosine(A, &other, &D); break;
        case sincos_: EACH sine_cosine(A, &D, (lanes *)(c + k)); break;
        case tan_: EACH { lanes s; sine_cosine(A, &s, &other); D = s / other; } break;
        FOLLOW(asin, angle_of(A, leg_of(A)));
        FOLLOW(acos, angle_of(leg_of(A), A));
        FOLLOW(atan, angle_of(A, all_of(1.0)));
        FOLLOW(atan2, angle_of(A, B));
        FOLLOW(sinh, sinh_of(A));
        FOLLOW(cosh, cosh_of(A));
        FOLLOW(tanh, tanh_of(A));
        FOLLOW(exp, exp_of(A, NULL));
        FOLLOW(log, log_of(A));
        FOLLOW(pow, pow_of(A, B));
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
