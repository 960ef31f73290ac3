/* Minimum degree on a quotient graph, with approximate degrees, indistinguishable nodes and absorption of elements
 * (Amestoy, Davis & Duff 1996). */
#include <stdlib.h>
#include <string.h>

#include "order.h"

enum { ALIVE, ELEMENT, ABSORBED, MERGED };

typedef struct {
    int32_t nodes;
    int32_t *list;              /* elements, then variables of each node; variables of each element */
    int64_t used, room;
    int64_t *begin, *mark;
    int32_t *length, *elements; /* of each list; how many of it are elements */
    int32_t *weight;            /* of live nodes; negated while in the new element */
    int32_t *degree, *up;       /* up: whom a node is merged with, or an element absorbed by */
    int32_t *head, *next, *previous;
    int32_t listed;             /* nodes in the lists by degree */
    int32_t *hash_head, *hash_next;
    uint8_t *state;
    const int32_t *stage;       /* which nodes go first */
    int32_t now;                /* nodes of later stages are not in the lists by degree */
} quotient;

static void quotient_free(quotient *q) {
    free(q->list); free(q->begin); free(q->mark); free(q->length); free(q->elements); free(q->weight);
    free(q->degree); free(q->up); free(q->head); free(q->next); free(q->previous); free(q->hash_head);
    free(q->hash_next); free(q->state);
}

static int quotient_new(quotient *q, int32_t nodes, const int64_t *start, const int32_t *index, const int32_t *weight) {
    size_t n = (size_t)nodes;
    memset(q, 0, sizeof *q);
    q->nodes = nodes;
    q->used = start[nodes];
    q->room = 2 * q->used + nodes + 16;
    q->list = malloc(sizeof(int32_t) * (size_t)q->room);
    q->begin = malloc(sizeof(int64_t) * (n + 1));
    q->mark = calloc(n + 1, sizeof(int64_t));
    q->length = malloc(sizeof(int32_t) * (n + 1));
    q->elements = calloc(n + 1, sizeof(int32_t));
    q->weight = malloc(sizeof(int32_t) * (n + 1));
    q->degree = calloc(n + 1, sizeof(int32_t));
    q->up = malloc(sizeof(int32_t) * (n + 1));
    q->next = malloc(sizeof(int32_t) * (n + 1));
    q->previous = malloc(sizeof(int32_t) * (n + 1));
    q->hash_head = malloc(sizeof(int32_t) * (n + 1));
    q->hash_next = malloc(sizeof(int32_t) * (n + 1));
    q->state = calloc(n + 1, 1);
    if (!q->list || !q->begin || !q->mark || !q->length || !q->elements || !q->weight || !q->degree || !q->up || !q->next
        || !q->previous || !q->hash_head || !q->hash_next || !q->state)
        return -1;
    memcpy(q->list, index, sizeof(int32_t) * (size_t)q->used);
    for (int32_t i = 0; i < nodes; i++) {
        q->begin[i] = start[i];
        q->length[i] = (int32_t)(start[i + 1] - start[i]);
        q->weight[i] = weight[i];
        q->up[i] = -1;
        q->hash_head[i] = -1;
    }
    return 0;
}

static void enter(quotient *q, int32_t i) {
    int32_t d = q->degree[i], first = q->head[d];
    q->next[i] = first;
    q->previous[i] = -1 - d;
    if (first >= 0) q->previous[first] = i;
    q->head[d] = i;
    q->listed++;
}

static void leave(quotient *q, int32_t i) {
    int32_t before = q->previous[i], after = q->next[i];
    if (before < 0) q->head[-1 - before] = after; else q->next[before] = after;
    if (after >= 0) q->previous[after] = before;
    q->listed--;
}

/* Adds the live nodes of a list to the new element at the end of all lists. */
static void gather(quotient *q, int64_t from, int32_t count) {
    for (int64_t k = from; k < from + count; k++) {
        int32_t i = q->list[k];
        if (q->state[i] != ALIVE || q->weight[i] <= 0) continue;
        if (q->stage[i] <= q->now) leave(q, i);
        q->weight[i] = -q->weight[i];
        q->list[q->used++] = i;
    }
}

/* Whether two nodes have the same lists; q->mark is `stamp` for all that is in the one's. */
static int alike(const quotient *q, int32_t i, int32_t j, int64_t stamp) {
    if (q->stage[i] != q->stage[j] || q->length[i] != q->length[j] || q->elements[i] != q->elements[j]) return 0;
    for (int64_t k = q->begin[j]; k < q->begin[j] + q->length[j]; k++)
        if (q->mark[q->list[k]] != stamp) return 0;
    return 1;
}

int minimum_degree(int32_t nodes, const int64_t *start, const int32_t *index, const int32_t *weight, const int32_t *stage,
                   int32_t stages, degree_order *out) {
    quotient q;
    int64_t total = 0, done = 0, stamp = 1;
    int32_t least = 0, now = 0, *of_stage = NULL, *stage_next = NULL;
    out->count = 0;
    if (quotient_new(&q, nodes, start, index, weight)) { quotient_free(&q); return -1; }
    for (int32_t i = 0; i < nodes; i++) total += weight[i];
    q.head = malloc(sizeof(int32_t) * (size_t)(total + 1));
    of_stage = malloc(sizeof(int32_t) * (size_t)(stages + 1));
    stage_next = malloc(sizeof(int32_t) * (size_t)(nodes + 1));
    if (!q.head || !of_stage || !stage_next) goto no_memory;
    for (int64_t d = 0; d <= total; d++) q.head[d] = -1;
    for (int32_t s = 0; s < stages; s++) of_stage[s] = -1;
    for (int32_t i = nodes - 1; i >= 0; i--) {
        for (int64_t k = start[i]; k < start[i + 1]; k++) q.degree[i] += weight[index[k]];
        stage_next[i] = of_stage[stage[i]];
        of_stage[stage[i]] = i;
    }
    q.stage = stage;
    for (q.now = -1; done < total;) {
        if (!q.listed) { /* the next stage */
            q.now = now;
            for (int32_t i = of_stage[now++]; i >= 0; i = stage_next[i])
                if (q.state[i] == ALIVE) {
                    enter(&q, i);
                    if (q.degree[i] < least) least = q.degree[i];
                }
            continue;
        }
        while (q.head[least] < 0) least++;
        int32_t p = q.head[least];
        leave(&q, p);
        /* The new element: whatever p couples with. */
        int64_t needed = 0;
        for (int64_t k = q.begin[p]; k < q.begin[p] + q.length[p]; k++)
            needed += k < q.begin[p] + q.elements[p] ? q.length[q.list[k]] : 1;
        if (q.used + needed > q.room) {
            q.room = 2 * (q.used + needed);
            int32_t *larger = realloc(q.list, sizeof(int32_t) * (size_t)q.room);
            if (!larger) goto no_memory;
            q.list = larger;
        }
        int32_t own = q.weight[p], size = 0;
        q.weight[p] = 0;
        int64_t from = q.used;
        for (int64_t k = q.begin[p]; k < q.begin[p] + q.elements[p]; k++) {
            int32_t e = q.list[k];
            if (q.state[e] != ELEMENT) continue;
            gather(&q, q.begin[e], q.length[e]);
            q.state[e] = ABSORBED;
            q.up[e] = p;
        }
        gather(&q, q.begin[p] + q.elements[p], q.length[p] - q.elements[p]);
        q.state[p] = ELEMENT;
        q.begin[p] = from;
        q.length[p] = (int32_t)(q.used - from);
        q.elements[p] = 0;
        for (int64_t k = from; k < q.used; k++) size -= q.weight[q.list[k]];
        /* Of each other element, what is not in the new one. */
        stamp += total + 1;
        for (int64_t k = from; k < q.used; k++) {
            int32_t i = q.list[k];
            for (int64_t j = q.begin[i]; j < q.begin[i] + q.elements[i]; j++) {
                int32_t e = q.list[j];
                if (q.state[e] != ELEMENT) continue;
                if (q.mark[e] < stamp) q.mark[e] = stamp + q.degree[e];
                q.mark[e] += q.weight[i];
            }
        }
        /* Their lists without what is known from the new element, and their degrees. */
        for (int64_t k = from; k < q.used; k++) {
            int32_t i = q.list[k], degree = 0, kept = 0;
            int64_t begin = q.begin[i], middle = begin + q.elements[i], end = begin + q.length[i], put = begin;
            uint64_t hash = 0;
            for (int64_t j = begin; j < middle; j++) {
                int32_t e = q.list[j];
                if (q.state[e] != ELEMENT) continue;
                int64_t outside = q.mark[e] - stamp;
                if (outside > 0) {
                    degree += (int32_t)outside;
                    q.list[put++] = e;
                    hash += (uint64_t)e;
                } else {
                    q.state[e] = ABSORBED;
                    q.up[e] = p;
                }
            }
            kept = (int32_t)(put - begin);
            int64_t variables = put;
            for (int64_t j = middle; j < end; j++) {
                int32_t v = q.list[j];
                if (q.state[v] != ALIVE || q.weight[v] <= 0) continue;
                degree += q.weight[v];
                q.list[put++] = v;
                hash += (uint64_t)v;
            }
            if (put == begin) { /* nothing but the new element: it can be eliminated with it */
                int32_t w = -q.weight[i];
                size -= w;
                own += w;
                q.weight[i] = 0;
                q.state[i] = MERGED;
                q.up[i] = p;
                q.length[i] = 0;
                continue;
            }
            /* The new element first: the first variable moves to the end, the first element to its place. */
            if (put > variables) q.list[put] = q.list[variables];
            if (kept > 0) q.list[variables] = q.list[begin];
            q.list[begin] = p;
            put++;
            q.elements[i] = kept + 1;
            q.length[i] = (int32_t)(put - begin);
            if (degree < q.degree[i]) q.degree[i] = degree;
            int32_t bucket = (int32_t)(hash % (uint64_t)nodes);
            q.hash_next[i] = q.hash_head[bucket];
            q.hash_head[bucket] = i;
            q.previous[i] = bucket;
        }
        q.degree[p] = size;
        /* Nodes that have become indistinguishable. */
        stamp += total + 1;
        for (int64_t k = from; k < q.used; k++) {
            int32_t i = q.list[k];
            if (q.state[i] != ALIVE) continue;
            int32_t bucket = q.previous[i], one = q.hash_head[bucket];
            q.hash_head[bucket] = -1;
            for (; one >= 0 && q.hash_next[one] >= 0; one = q.hash_next[one]) {
                stamp++;
                for (int64_t j = q.begin[one]; j < q.begin[one] + q.length[one]; j++) q.mark[q.list[j]] = stamp;
                for (int32_t before = one, other = q.hash_next[one]; other >= 0; other = q.hash_next[other]) {
                    if (alike(&q, one, other, stamp)) {
                        q.weight[one] += q.weight[other];
                        q.weight[other] = 0;
                        q.state[other] = MERGED;
                        q.up[other] = one;
                        q.hash_next[before] = q.hash_next[other];
                    } else {
                        before = other;
                    }
                }
            }
        }
        /* Back into the lists by degree. */
        int64_t put = from;
        done += own;
        for (int64_t k = from; k < q.used; k++) {
            int32_t i = q.list[k];
            if (q.state[i] != ALIVE) continue;
            int32_t w = -q.weight[i];
            int64_t degree = (int64_t)q.degree[i] + size - w, most = total - done - w;
            q.weight[i] = w;
            q.degree[i] = (int32_t)(degree < most ? degree : most);
            if (stage[i] <= q.now) {
                enter(&q, i);
                if (q.degree[i] < least) least = q.degree[i];
            }
            q.list[put++] = i;
        }
        q.used = put;
        q.length[p] = (int32_t)(put - from);
        out->sequence[out->count++] = p;
        stamp += total + 1;
    }
    for (int32_t i = 0; i < nodes; i++) {
        int32_t e = i;
        while (q.state[e] == MERGED) e = q.up[e];
        out->element[i] = e;
        out->parent[i] = q.state[i] == ABSORBED ? q.up[i] : -1;
    }
    quotient_free(&q);
    free(of_stage); free(stage_next);
    return 0;
no_memory:
    quotient_free(&q);
    free(of_stage); free(stage_next);
    return -1;
}
