/* Which stages a horizon has.
 *
 * Other stages than frames, for many bodies of which each couples with few others, or with none.
 *
 *     frames     | x1 x2 x3 ... |  then the next frame: as wide as there are bodies
 *     levels     | x1 of all frames |  then x2: as wide as there are frames
 *     parts      | x1 | of frame 0, of frame 1, ...  then x2, where nothing couples it with x1
 *
 * Elimination takes any row of stages in which unknowns couple within a stage and with the next one, and about the third
 * power of what a stage has.  Frames are one such row.  Where a frame has many unknowns with few entries, the levels of a
 * breadth-first search are another one (Cuthill and McKee 1969).  It starts from one unknown of all frames, at an end of
 * the graph that frames have in common, so that a level is a body's whole motion rather than a wave across bodies and
 * frames.  Whatever nothing couples is a part of its own, with frames or levels of its own.
 *
 * Where a horizon repeats itself: runs of stages with the same pattern, cut into segments of equal length.
 *
 *     stage    0 1 | 2 3 4 | 5 6 7 | 8 9 10 | 11 ...
 *                  |  lane |  lane |  lane  |
 *             rest seam 0 seam 1  seam  2   rest
 *
 * Segments are sewn together by unknowns of their own (see stc.solver.kkt.seams), so that each of them couples with the
 * seams alone, or with a stage left out, and with unknowns of the last stage group (parameters) and others that couple
 * with many stages, the border. */
#include "native.h"
#include "arranging.h"

/* How an equation couples with other stages: not at all, with the next one alone, or with others: only the second kind
 * can wait. */
enum {
    ALONE = 0,
    AHEAD = 1,
    ELSEWHERE = 2,
};
/* What a variable is to those: known to other stages, by an equation that couples with these, or a control. */
enum {
    ORDINARY = 1,
    CONTROL = 2,
};
/* Kinds of codes of entries: inside a stage, with the next stage, with the border, on the diagonal of H; variables
 * that are held. Without these, a segment that begins right before a waypoint has a matrix without inverse. */
enum {
    ACROSS = 1,
    BORDERING = 2,
};

void arranging_counting_sort(int64_t size, const int32_t *restrict keys, int64_t count, int32_t *restrict pointers,
                             int32_t *restrict order) {
    for (int64_t k = 0; k < size; k++) pointers[keys[k]]++;
    int64_t total = 0;
    for (int64_t k = 0; k < count; k++) {
        int64_t run = pointers[k];
        pointers[k] = (int32_t)total;
        total += run;
    }
    for (int64_t k = 0; k < size; k++) {
        int64_t key = keys[k];
        order[pointers[key]] = (int32_t)k;
        pointers[key]++;
    }
    for (int64_t back = 0; back < count; back++) {
        int64_t k = count - back;
        pointers[k] = pointers[k - 1];
    }
    pointers[0] = 0;
}

void arranging_flag_border(int64_t count, const int32_t *restrict first, const int32_t *restrict second,
                           const int32_t *restrict stage, int32_t *restrict far, int32_t *restrict flagged,
                           int32_t *restrict ahead, int32_t *restrict behind) {
    for (int64_t e = 0; e < count; e++) {
        int64_t a = first[e];
        int64_t b = second[e];
        if (llabs(stage[a] - stage[b]) > 1) {
            far[a]++;
            far[b]++;
        }
    }
    for (int64_t e = 0; e < count; e++) {
        int64_t a = first[e];
        int64_t b = second[e];
        if (llabs(stage[a] - stage[b]) > 1 && flagged[a] == 0 && flagged[b] == 0)
            flagged[far[a] > far[b] ? a : b] = 1;
    }
    for (int64_t e = 0; e < count; e++) {
        int64_t a = first[e];
        int64_t b = second[e];
        if (stage[a] != stage[b] && flagged[a] == 0 && flagged[b] == 0) {
            if (stage[a] > stage[b]) {
                const int64_t old_a = a;
                a = b;
                b = old_a;
            }
            ahead[a] = 1;
            behind[b] = 1;
        }
    }
}

/* Scramble a number, to 31 bits: sums of these tell sets of numbers apart. */
static int64_t mixed(int64_t code, int64_t salt) {
    int64_t bits = (code + salt) & 2147483647;
    bits = (bits * 1540483477) & 2147483647;
    bits = ((bits ^ (bits >> 15)) * 1367130551) & 2147483647;
    bits = ((bits ^ (bits >> 12)) * 2026873373) & 2147483647;
    return bits ^ (bits >> 16);
}

void arranging_codes(int64_t count, const int32_t *restrict first, const int32_t *restrict second,
                     const int32_t *restrict stage, const int32_t *restrict local, const int32_t *restrict border,
                     int64_t base, int32_t *restrict edge_stage, int64_t *restrict edge_code,
                     int64_t *restrict sums) {
    for (int64_t e = 0; e < count; e++) {
        int64_t a = first[e];
        int64_t b = second[e];
        if (border[a] >= 0 || (border[b] < 0 && stage[a] > stage[b])) {
            const int64_t old_a = a;
            a = b;
            b = old_a;
        }
        int64_t own = stage[a];
        int64_t code = 0;
        if (border[a] >= 0)
            own = -1;
        else if (border[b] >= 0)
            code = (BORDERING * base + local[a]) * base + border[b];
        else if (stage[b] > own)
            code = (ACROSS * base + local[a]) * base + local[b];
        else
            code = imax(local[a], local[b]) * base + imin(local[a], local[b]);
        edge_stage[e] = (int32_t)own;
        edge_code[e] = code;
        if (own >= 0) {
            sums[2 * own] += mixed(code, 1);
            sums[2 * own + 1] += mixed(code, 12345);
        }
    }
}

void arranging_own_codes(int64_t kind, int64_t count, const int32_t *restrict variable,
                         const int32_t *restrict stage, const int32_t *restrict local, int64_t base,
                         int64_t *restrict sums) {
    for (int64_t e = 0; e < count; e++) {
        int64_t a = variable[e];
        int64_t code = (kind * base + local[a]) * base;
        sums[2 * (int64_t)stage[a]] += mixed(code, 1);
        sums[2 * (int64_t)stage[a] + 1] += mixed(code, 12345);
    }
}

int64_t arranging_ends(int64_t count, const int32_t *restrict pointers, const int32_t *restrict target,
                       int32_t *restrict seen, int32_t *restrict queue, int32_t *restrict begins) {
    int64_t found = 0;
    for (int64_t start = 0; start < count; start++) {
        if (seen[start] >= 0) continue;
        int64_t root = start;
        for (int64_t attempt = 0; attempt < 2; attempt++) {
            int64_t tail = 1;
            int64_t head = 0;
            queue[0] = (int32_t)root;
            seen[root] = (int32_t)attempt;
            while (head < tail) {
                int64_t k = queue[head];
                head++;
                for (int64_t e = pointers[k], end_e = pointers[k + 1]; e < end_e; e++) {
                    int64_t other = target[e];
                    if (seen[other] < attempt) {
                        seen[other] = (int32_t)attempt;
                        queue[tail] = (int32_t)other;
                        tail++;
                    }
                }
            }
            root = queue[tail - 1];
        }
        begins[found] = (int32_t)root;
        found++;
    }
    return found;
}

int64_t arranging_levels_from(int64_t count, const int32_t *restrict sources, int64_t one_by_one, int64_t parts,
                              const int32_t *restrict pointers, const int32_t *restrict target,
                              int32_t *restrict level, int32_t *restrict part, int32_t *restrict queue) {
    int64_t head = 0;
    int64_t tail = 0;
    for (int64_t k = 0; k < count; k++) {
        int64_t one = sources[k];
        if (part[one] >= 0) continue;
        part[one] = (int32_t)parts;
        level[one] = 0;
        queue[tail] = (int32_t)one;
        tail++;
        if (one_by_one == 0 && k < count - 1) continue;
        while (head < tail) {
            int64_t at = queue[head];
            head++;
            for (int64_t e = pointers[at], end_e = pointers[at + 1]; e < end_e; e++) {
                int64_t other = target[e];
                if (part[other] < 0) {
                    part[other] = (int32_t)parts;
                    level[other] = level[at] + 1;
                    queue[tail] = (int32_t)other;
                    tail++;
                }
            }
        }
        parts++;
    }
    return parts;
}
