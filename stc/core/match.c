/* Which variable each row of J is eliminated together with: the assignment of the largest product of entries, by shortest
 * augmenting paths (Duff & Koster 2001), where entries of variables with many neighbours count for less.  Each pair is a
 * pivot of two that exists whatever stands on the diagonal (Duff & Pralet 2005). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "order.h"

/* Entries smaller than that are as bad as that, so that few paths are long; and what a neighbour costs. */
#define SMALLEST 1e-8
#define NEIGHBOUR 2.0
/* What it costs where the variable is of a later stage, which then has to take up the row. */
#define LATER 10.0
/* Variables that a search for a path looks at, at most: what is left over then waits for others to fill its diagonal. */
#define FARTHEST 100

typedef struct { double distance; int32_t column; } candidate;

typedef struct {
    candidate *heap;
    int64_t count, room;
} queue;

static int push(queue *q, double distance, int32_t column) {
    if (q->count == q->room) {
        q->room = 2 * q->room + 64;
        candidate *larger = realloc(q->heap, sizeof(candidate) * (size_t)q->room);
        if (!larger) return -1;
        q->heap = larger;
    }
    int64_t k = q->count++;
    while (k > 0 && q->heap[(k - 1) / 2].distance > distance) {
        q->heap[k] = q->heap[(k - 1) / 2];
        k = (k - 1) / 2;
    }
    q->heap[k] = (candidate){distance, column};
    return 0;
}

static candidate pop(queue *q) {
    candidate top = q->heap[0], last = q->heap[--q->count];
    int64_t k = 0;
    for (;;) {
        int64_t child = 2 * k + 1;
        if (child >= q->count) break;
        if (child + 1 < q->count && q->heap[child + 1].distance < q->heap[child].distance) child++;
        if (q->heap[child].distance >= last.distance) break;
        q->heap[k] = q->heap[child];
        k = child;
    }
    q->heap[k] = last;
    return top;
}

/* What it costs to match the row of an entry with the variable at its other end. */
static double cost_of(const graph *g, const double *magnitude, const uint8_t *left_out, const int32_t *stage, int32_t row,
                      int64_t place) {
    int32_t j = g->index[place];
    double size = magnitude[g->entry[place]];
    if (left_out[j]) return INFINITY;
    return (stage[j] > stage[row] ? LATER : 0.0) + NEIGHBOUR * log2((double)(g->start[j + 1] - g->start[j])) - log(size > SMALLEST ? size : SMALLEST);
}

int match_rows(const graph *g, const double *magnitude, int32_t variables, const uint8_t *left_out, const int32_t *stage,
               int32_t *mate) {
    int32_t size = g->size, *before = malloc(sizeof(int32_t) * (size_t)(size + 1));
    int32_t *seen = malloc(sizeof(int32_t) * (size_t)(size + 1));
    double *dual = calloc((size_t)size + 1, sizeof(double)), *distance = malloc(sizeof(double) * (size_t)(size + 1));
    double *cost = malloc(sizeof(double) * (size_t)(g->start[size] + 1));
    uint8_t *closed = calloc((size_t)size + 1, 1);
    queue q = {0};
    int failed = !before || !seen || !dual || !distance || !cost || !closed;
    for (int32_t i = 0; i < size; i++) mate[i] = -1;
    if (!failed)
        for (int32_t j = 0; j < size; j++) distance[j] = INFINITY;
    for (int32_t r = variables; r < size && !failed; r++) {
        dual[r] = INFINITY;
        if (left_out[r]) continue;
        for (int64_t k = g->start[r]; k < g->start[r + 1]; k++) {
            cost[k] = g->index[k] < variables ? cost_of(g, magnitude, left_out, stage, r, k) : INFINITY;
            if (cost[k] < dual[r]) dual[r] = cost[k];
        }
        for (int64_t k = g->start[r]; k < g->start[r + 1]; k++)
            if (cost[k] < INFINITY && cost[k] == dual[r] && mate[g->index[k]] < 0) {
                mate[r] = g->index[k];
                mate[g->index[k]] = r;
                break;
            }
    }
    for (int32_t root = variables; root < size && !failed; root++) {
        if (mate[root] >= 0 || left_out[root] || !(dual[root] < INFINITY)) continue;
        int32_t r = root, count = 0, end = -1, closed_count = 0;
        double base = 0.0;
        q.count = 0;
        for (;;) {
            for (int64_t k = g->start[r]; k < g->start[r + 1] && !failed; k++) {
                int32_t j = g->index[k];
                if (!(cost[k] < INFINITY) || closed[j]) continue;
                double next = base + cost[k] - dual[r] - dual[j];
                if (next < distance[j]) {
                    if (distance[j] == INFINITY) seen[count++] = j;
                    distance[j] = next;
                    before[j] = r;
                    failed = push(&q, next, j);
                }
            }
            int32_t j = -1;
            while (q.count && j < 0) {
                candidate c = pop(&q);
                if (!closed[c.column] && c.distance <= distance[c.column]) j = c.column;
            }
            if (j < 0 || failed || closed_count++ == FARTHEST) break;
            base = distance[j];
            if (mate[j] < 0) { end = j; break; }
            closed[j] = 1;
            r = mate[j];
        }
        for (int32_t k = 0; k < count; k++) {
            int32_t j = seen[k];
            if (end >= 0 && closed[j]) {
                dual[j] -= base - distance[j];
                dual[mate[j]] += base - distance[j];
            }
            closed[j] = 0;
            distance[j] = INFINITY;
        }
        if (end >= 0) dual[root] += base;
        while (end >= 0) {
            int32_t row = before[end], next = mate[row];
            mate[end] = row;
            mate[row] = end;
            end = row == root ? -1 : next;
        }
    }
    free(before); free(seen); free(dual); free(distance); free(cost); free(closed); free(q.heap);
    return failed ? -1 : 0;
}
