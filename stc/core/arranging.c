/* Which stages of a horizon are alike. */
#include "native.h"
#include "arranging.h"

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
