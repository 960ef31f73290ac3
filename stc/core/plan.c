/* The order of elimination, the tree of fronts, and where everything goes in them. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "order.h"

/* Unknowns with more neighbours than this many, and than so many times the root of their number, are eliminated last. */
#define MANY 40
#define DENSE 4.0
/* Stages tell a good order where they couple with near ones, so many stages away at most, but for this share of entries. */
#define NEAR 4
#define FEW 0.01
/* What a front takes besides its operations, in operations: for itself, for each of its rows, and for each entry. */
#define FRONT_COST 600.0
#define ROW_COST 15.0
#define ENTRY_COST 1.0

static void *array(size_t count, size_t size) { return calloc(count + 1, size); }

/* The graph of entries of which each couples two unknowns; its arrays are to be freed.  0, or -1 where there is no memory. */
static int graph_new(graph *g, int32_t size, int64_t entries, const int32_t *one, const int32_t *other) {
    g->size = size;
    g->start = array((size_t)size + 1, sizeof(int64_t));
    g->index = array(2 * (size_t)entries, sizeof(int32_t));
    g->entry = array(2 * (size_t)entries, sizeof(int32_t));
    if (!g->start || !g->index || !g->entry) return -1;
    for (int64_t e = 0; e < entries; e++) {
        g->start[one[e] + 1]++;
        g->start[other[e] + 1]++;
    }
    for (int32_t i = 0; i < size; i++) g->start[i + 1] += g->start[i];
    for (int64_t e = 0; e < entries; e++)
        for (int side = 0; side < 2; side++) {
            int32_t i = side ? other[e] : one[e], j = side ? one[e] : other[e];
            int64_t put = g->start[i]++;
            g->index[put] = j;
            g->entry[put] = (int32_t)e;
        }
    for (int32_t i = size; i > 0; i--) g->start[i] = g->start[i - 1];
    g->start[0] = 0;
    return 0;
}

/* What the elimination of so many of a front's unknowns takes, besides assembling it; of so many matrices at once, each. */
static double front_cost(double own, double rows, double matrices) {
    double all = own + rows, operations = 0.5 * (own * all * all - own * own * all + own * own * own / 3.0);
    return (FRONT_COST + ROW_COST * all) / matrices + ENTRY_COST * all * all + operations;
}

/* Unite nodes with what they are matched with, leave out those with too many neighbours, and order the rest. */
static int order_pairs(const graph *g, const int32_t *mate, const uint8_t *dense, const int32_t *stage, degree_order *found,
                       int32_t *node_of, int32_t *nodes) {
    int32_t size = g->size, count = 0;
    int64_t *start = NULL, put = 0;
    int32_t *index = NULL, *weight = NULL, *last = NULL, *members = NULL, *stage_of = NULL, stages = 0;
    int failed = -1;
    for (int32_t i = 0; i < size; i++) node_of[i] = -1;
    for (int32_t i = 0; i < size; i++) {
        if (dense[i] || node_of[i] >= 0) continue;
        node_of[i] = count;
        if (mate[i] >= 0) node_of[mate[i]] = count;
        count++;
    }
    *nodes = count;
    start = array((size_t)count + 1, sizeof *start);
    index = array((size_t)g->start[size], sizeof *index);
    weight = array((size_t)count, sizeof *weight);
    last = array((size_t)count, sizeof *last);
    members = array(2 * (size_t)count, sizeof *members);
    stage_of = array((size_t)count, sizeof *stage_of);
    if (!stage_of || !start || !index || !weight || !last || !members) goto done;
    for (int32_t i = 0; i < size; i++)
        if (node_of[i] >= 0) members[2 * node_of[i] + weight[node_of[i]]++] = i;
    for (int32_t a = 0; a < count; a++) {
        last[a] = a + 1;
        start[a] = put;
        for (int32_t k = 0; k < weight[a]; k++) {
            int32_t i = members[2 * a + k];
            if (stage[i] > stage_of[a]) stage_of[a] = stage[i];
            for (int64_t e = g->start[i]; e < g->start[i + 1]; e++) {
                int32_t b = node_of[g->index[e]];
                if (b < 0 || last[b] == a + 1) continue;
                last[b] = a + 1;
                index[put++] = b;
            }
        }
    }
    start[count] = put;
    for (int32_t a = 0; a < count; a++)
        if (stage_of[a] >= stages) stages = stage_of[a] + 1;
    failed = minimum_degree(count, start, index, weight, stage_of, stages, found);
done:
    free(start); free(index); free(weight); free(last); free(members); free(stage_of);
    return failed;
}

/* Part pairs of which the variable is of an earlier stage than the row's last one: its elimination fills the diagonal of
 * the row, which is a pivot by itself then, of that last stage.  Fronts of such unknowns are smaller than those of pairs.
 * A variable that has been no pivot by itself, being weak, stays with its row. */
static void part_pairs(const graph *g, int32_t variables, const uint8_t *dense, const uint8_t *weak, int32_t *mate,
                       int32_t *stage) {
    for (int32_t r = variables; r < g->size; r++) {
        int32_t last = -1, own = mate[r];
        if (own < 0 || weak[r] || weak[own]) continue;
        for (int64_t k = g->start[r]; k < g->start[r + 1]; k++) {
            int32_t j = g->index[k];
            if (!dense[j] && stage[j] > last) last = stage[j];
        }
        if (stage[own] >= last) continue;
        mate[own] = mate[r] = -1;
        stage[r] = last;
    }
}

typedef struct {
    int32_t count;                 /* of fronts */
    int32_t *parent, *own, *first_child, *next_child;
    int32_t *rows;                 /* how many */
} tree;

/* How many rows the fronts have: exact, from the pattern, for the order given by `front_of` (children before parents). */
static int count_rows(const graph *g, const int32_t *front_of, int32_t *const sequence_members, const int32_t *member_start,
                      tree *t) {
    /* Row counts by the unions of children, as lists. */
    int32_t size = g->size, *mark = array((size_t)size, sizeof *mark), failed = !mark;
    int32_t **list = array((size_t)t->count, sizeof *list);
    failed |= !list;
    for (int32_t f = 0; f < t->count && !failed; f++) {
        int64_t most = 0;
        for (int32_t k = member_start[f]; k < member_start[f + 1]; k++) {
            int32_t i = sequence_members[k];
            most += g->start[i + 1] - g->start[i];
        }
        for (int32_t c = t->first_child[f]; c >= 0; c = t->next_child[c]) most += t->rows[c];
        int32_t *own = malloc(sizeof(int32_t) * (size_t)(most + 1)), count = 0;
        if (!own) { failed = 1; break; }
        for (int32_t k = member_start[f]; k < member_start[f + 1]; k++) {
            int32_t i = sequence_members[k];
            for (int64_t e = g->start[i]; e < g->start[i + 1]; e++) {
                int32_t j = g->index[e];
                if (front_of[j] <= f || mark[j] == f + 1) continue;
                mark[j] = f + 1;
                own[count++] = j;
            }
        }
        for (int32_t c = t->first_child[f]; c >= 0; c = t->next_child[c]) {
            for (int32_t k = 0; k < t->rows[c]; k++) {
                int32_t j = list[c][k];
                if (front_of[j] <= f || mark[j] == f + 1) continue;
                mark[j] = f + 1;
                own[count++] = j;
            }
            free(list[c]);
            list[c] = NULL;
        }
        t->rows[f] = count;
        list[f] = own;
    }
    if (list)
        for (int32_t f = 0; f < t->count; f++) free(list[f]);
    free(list); free(mark);
    return failed ? -1 : 0;
}

static void unite_children(tree *t, int32_t fronts, double matrices, int32_t *into) {
    /* Children with their parents, where that takes less time: bottom up, the largest children first come last in lists. */
    for (int32_t f = 0; f < t->count; f++) {
        into[f] = f;
        for (int again = f < fronts; again;) {
            again = 0;
            int32_t before = -1;
            for (int32_t c = t->first_child[f]; c >= 0; before = c, c = t->next_child[c]) {
                double apart = front_cost(t->own[c], t->rows[c], matrices) + front_cost(t->own[f], t->rows[f], matrices);
                /* The child's own contribution is assembled as well. */
                apart += ENTRY_COST * 0.5 * t->rows[c] * (double)t->rows[c];
                double together = front_cost(t->own[c] + t->own[f], t->rows[f], matrices);
                if (together > apart) continue;
                t->own[f] += t->own[c];
                into[c] = f;
                int32_t next = t->next_child[c], grand = t->first_child[c];
                if (grand >= 0) {
                    int32_t end = grand;
                    while (t->next_child[end] >= 0) end = t->next_child[end];
                    t->next_child[end] = next;
                    next = grand;
                }
                if (before < 0) t->first_child[f] = next; else t->next_child[before] = next;
                for (int32_t g = grand; g >= 0; g = t->next_child[g]) t->parent[g] = f;
                again = 1;
                break;
            }
        }
    }
}

static int compare(const void *a, const void *b) {
    int32_t x = *(const int32_t *)a, y = *(const int32_t *)b;
    return (x > y) - (x < y);
}

void plan_free(plan *p) {
    if (!p) return;
    free(p->order); free(p->position); free(p->first); free(p->parent); free(p->children); free(p->row_start);
    free(p->rows); free(p->local); free(p->entry_start); free(p->entry_row); free(p->entry_local); free(p->entry);
    free(p);
}

/* Entries by column in the order of elimination. */
static int place_entries(plan *p, int64_t entries, const int32_t *one, const int32_t *other) {
    p->entry_start = array((size_t)p->size + 1, sizeof *p->entry_start);
    p->entry_row = array((size_t)entries, sizeof *p->entry_row);
    p->entry_local = array((size_t)entries, sizeof *p->entry_local);
    p->entry = array((size_t)entries, sizeof *p->entry);
    if (!p->entry_start || !p->entry_row || !p->entry_local || !p->entry) return -1;
    int32_t *start = p->entry_start;
    for (int64_t e = 0; e < entries; e++) {
        int32_t a = p->position[one[e]], b = p->position[other[e]];
        start[(a < b ? a : b) + 1]++;
    }
    for (int32_t k = 0; k < p->size; k++) start[k + 1] += start[k];
    for (int64_t e = 0; e < entries; e++) {
        int32_t a = p->position[one[e]], b = p->position[other[e]];
        int32_t put = start[a < b ? a : b]++;
        p->entry_row[put] = a < b ? b : a;
        p->entry[put] = (int32_t)e;
    }
    for (int32_t k = p->size; k > 0; k--) start[k] = start[k - 1];
    start[0] = 0;
    return 0;
}

/* The rows of each front, and where they are in its parent. */
static int find_rows(plan *p) {
    int32_t fronts = p->fronts, *mark = array((size_t)p->size, sizeof *mark), *where = array((size_t)p->size, sizeof *where);
    int32_t *first_child = array((size_t)fronts, sizeof *first_child), *next_child = array((size_t)fronts, sizeof *next_child);
    int64_t room = 4 * (int64_t)p->size + 64, used = 0;
    int failed = -1;
    p->row_start = array((size_t)fronts + 1, sizeof *p->row_start);
    p->children = array((size_t)fronts, sizeof *p->children);
    p->rows = malloc(sizeof(int32_t) * (size_t)room);
    if (!mark || !where || !first_child || !next_child || !p->row_start || !p->children || !p->rows) goto done;
    for (int32_t f = 0; f < fronts; f++) first_child[f] = -1;
    for (int32_t f = fronts - 1; f >= 0; f--)
        if (p->parent[f] >= 0) {
            next_child[f] = first_child[p->parent[f]];
            first_child[p->parent[f]] = f;
            p->children[p->parent[f]]++;
        }
    for (int32_t f = 0; f < fronts; f++) {
        int32_t end = p->first[f + 1], own = end - p->first[f];
        int64_t from = used, most = 0;
        p->row_start[f] = from;
        most += p->entry_start[end] - p->entry_start[p->first[f]];
        for (int32_t c = first_child[f]; c >= 0; c = next_child[c]) most += p->row_start[c + 1] - p->row_start[c];
        if (used + most > room) {
            room = 2 * (used + most);
            int32_t *larger = realloc(p->rows, sizeof(int32_t) * (size_t)room);
            if (!larger) goto done;
            p->rows = larger;
        }
        for (int64_t e = p->entry_start[p->first[f]]; e < p->entry_start[end]; e++) {
            int32_t r = p->entry_row[e];
            if (r < end || mark[r] == f + 1) continue;
            mark[r] = f + 1;
            p->rows[used++] = r;
        }
        for (int32_t c = first_child[f]; c >= 0; c = next_child[c])
            for (int64_t k = p->row_start[c]; k < p->row_start[c + 1]; k++) {
                int32_t r = p->rows[k];
                if (r < end || mark[r] == f + 1) continue;
                mark[r] = f + 1;
                p->rows[used++] = r;
            }
        qsort(p->rows + from, (size_t)(used - from), sizeof(int32_t), compare);
        p->row_start[f + 1] = used;
        double all = own + (double)(used - from);
        p->entries += (int64_t)(own * all - 0.5 * own * (own - 1.0));
        for (int32_t k = 0; k < own; k++) p->operations += (int64_t)((all - k - 1) * (all - k) / 2.0);
    }
    p->local = array((size_t)used, sizeof *p->local);
    if (!p->local) goto done;
    for (int32_t f = 0; f < fronts; f++) {
        int32_t own = p->first[f + 1] - p->first[f];
        for (int64_t k = p->row_start[f]; k < p->row_start[f + 1]; k++) where[p->rows[k]] = own + (int32_t)(k - p->row_start[f]);
        for (int32_t k = 0; k < own; k++) where[p->first[f] + k] = k;
        for (int64_t e = p->entry_start[p->first[f]]; e < p->entry_start[p->first[f + 1]]; e++)
            p->entry_local[e] = where[p->entry_row[e]];
        for (int32_t c = first_child[f]; c >= 0; c = next_child[c])
            for (int64_t k = p->row_start[c]; k < p->row_start[c + 1]; k++) p->local[k] = where[p->rows[k]];
    }
    failed = 0;
done:
    free(mark); free(where); free(first_child); free(next_child);
    return failed;
}

plan *plan_new(int32_t size, int64_t entries, const int32_t *one, const int32_t *other, const double *magnitude,
               int32_t variables, const int32_t *given_stage, const uint8_t *weak, int32_t matrices) {
    int32_t nodes = 0, fronts = 0;
    size_t n = (size_t)size;
    graph made = {0}, *g = &made;
    plan *p = calloc(1, sizeof *p);
    uint8_t *dense = array(n, 1);
    int32_t *mate = array(n, 4), *node_of = array(n, 4), *number = array(n, 4), *member_start = array(n + 1, 4);
    int32_t *member = array(n, 4), *front_of = array(n, 4), *into = array(n, 4), *stack = array(n, 4);
    int32_t *stage = array(n, 4);
    degree_order found = {array(n, 4), array(n, 4), array(n, 4), 0};
    tree t = {0, array(n, 4), array(n, 4), array(n, 4), array(n, 4), array(n, 4)};
    int failed = 1;
    if (!p || !dense || !mate || !node_of || !number || !member_start || !member || !front_of || !into || !stack || !stage
        || !found.element || !found.parent || !found.sequence || !t.parent || !t.own || !t.first_child || !t.next_child || !t.rows
        || graph_new(g, size, entries, one, other))
        goto done;
    p->size = size;
    memcpy(stage, given_stage, sizeof(int32_t) * n);
    double many = DENSE * sqrt((double)size);
    if (many < MANY) many = MANY;
    int ends = 0; /* there are unknowns that stay */
    for (int32_t i = 0; i < size; i++) ends |= stage[i] < 0;
    for (int32_t i = 0; i < size; i++) dense[i] = ends ? stage[i] < 0 : (double)(g->start[i + 1] - g->start[i]) > many;
    int64_t far = 0;
    for (int64_t e = 0; e < entries; e++)
        far += !dense[one[e]] && !dense[other[e]] && abs(stage[one[e]] - stage[other[e]]) > NEAR;
    if ((double)far > FEW * (double)entries) memset(stage, 0, sizeof(int32_t) * n); /* a single one */
    if (match_rows(g, magnitude, variables, dense, stage, mate)) goto done;
    part_pairs(g, variables, dense, weak, mate, stage);
    if (order_pairs(g, mate, dense, stage, &found, node_of, &nodes)) goto done;
    /* Elements in order, and one more front for those left out. */
    int32_t left_out = 0;
    for (int32_t i = 0; i < size; i++) left_out += dense[i];
    t.count = found.count + (left_out > 0);
    for (int32_t f = 0; f < found.count; f++) number[found.sequence[f]] = f;
    for (int32_t f = 0; f < found.count; f++) {
        int32_t up = found.parent[found.sequence[f]];
        t.parent[f] = up >= 0 ? number[up] : (left_out ? found.count : -1);
        t.first_child[f] = -1;
    }
    if (left_out) t.parent[found.count] = t.first_child[found.count] = -1;
    for (int32_t f = t.count - 1; f >= 0; f--)
        if (t.parent[f] >= 0) {
            t.next_child[f] = t.first_child[t.parent[f]];
            t.first_child[t.parent[f]] = f;
        } else {
            t.next_child[f] = -1;
        }
    for (int32_t i = 0; i < size; i++) {
        front_of[i] = dense[i] ? found.count : number[found.element[node_of[i]]];
        member_start[front_of[i] + 1]++;
        t.own[front_of[i]]++;
    }
    for (int32_t f = 0; f < t.count; f++) member_start[f + 1] += member_start[f];
    for (int32_t i = 0; i < size; i++) {
        /* Pairs stay together. */
        if (mate[i] >= 0 && mate[i] < i && !dense[i]) continue;
        member[member_start[front_of[i]]++] = i;
        if (mate[i] >= 0) member[member_start[front_of[i]]++] = mate[i];
    }
    for (int32_t f = t.count; f > 0; f--) member_start[f] = member_start[f - 1];
    member_start[0] = 0;
    if (count_rows(g, front_of, member, member_start, &t)) goto done;
    unite_children(&t, t.count - ends, matrices, into);
    /* Postorder of what is left. */
    p->order = array(n, sizeof *p->order);
    p->position = array(n, sizeof *p->position);
    p->first = array(n + 1, sizeof *p->first);
    p->parent = array(n, sizeof *p->parent);
    if (!p->order || !p->position || !p->first || !p->parent) goto done;
    int32_t top = 0, put = 0;
    for (int32_t f = t.count - 1; f >= 0; f--)
        if (into[f] == f && t.parent[f] < 0) stack[top++] = f;
    /* `node_of` now says which front of the plan one of the tree is; fronts are numbered when they leave the stack. */
    for (int32_t f = 0; f < t.count; f++) node_of[f] = -1;
    /* Members of what was united: gathered by the front that they are in, those eliminated first coming first. */
    int32_t *chain_first = number, *chain_next = found.sequence, *chain_last = found.parent;
    for (int32_t f = 0; f < t.count; f++) chain_first[f] = chain_last[f] = chain_next[f] = -1;
    for (int32_t f = 0; f < t.count; f++) {
        int32_t up = f;
        while (into[up] != up) up = into[up];
        if (chain_last[up] < 0) chain_first[up] = f; else chain_next[chain_last[up]] = f;
        chain_last[up] = f;
    }
    while (top) {
        int32_t f = stack[top - 1];
        if (t.first_child[f] >= 0) {
            int32_t c = t.first_child[f];
            t.first_child[f] = t.next_child[c];
            stack[top++] = c;
            continue;
        }
        top--;
        node_of[f] = fronts;
        p->first[fronts] = put;
        for (int32_t c = chain_first[f]; c >= 0; c = chain_next[c])
            for (int32_t k = member_start[c]; k < member_start[c + 1]; k++) p->order[put++] = member[k];
        p->parent[fronts] = t.parent[f];
        fronts++;
    }
    p->first[fronts] = put;
    p->fronts = fronts;
    for (int32_t f = 0; f < fronts; f++) p->parent[f] = p->parent[f] >= 0 ? node_of[p->parent[f]] : -1;
    for (int32_t k = 0; k < size; k++) p->position[p->order[k]] = k;
    failed = place_entries(p, entries, one, other) || find_rows(p);
    for (int64_t k = 0; !failed && k < p->row_start[fronts]; k++) p->rows[k] = p->order[p->rows[k]];
    for (int64_t e = 0; !failed && e < entries; e++) p->entry_row[e] = p->order[p->entry_row[e]];
done:
    free(made.start); free(made.index); free(made.entry); free(dense); free(mate); free(node_of); free(number); free(member_start); free(member); free(front_of); free(into);
    free(stack); free(stage); free(found.element); free(found.parent); free(found.sequence); free(t.parent); free(t.own);
    free(t.first_child); free(t.next_child); free(t.rows);
    if (failed) { plan_free(p); return NULL; }
    return p;
}
