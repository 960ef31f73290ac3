/* Sets of slots, a bit for each: which entries the rows of a symmetric pattern have, and what eliminations add.
 *
 * A set is some words, WORD bits of each; a pattern is a set for every row, one after the other.  All words are the same
 * number for a stage, words_of its slots. */
#include "../native.h"
#include "slot_sets.h"

int64_t slot_sets_words_of(int64_t top) {
    return floor_div(top + WORD - 1, WORD);
}

void slot_sets_note_rows(int64_t top, int64_t words, const double *restrict sizes, int64_t *restrict bits) {
    for (int64_t p = 0; p < top; p++) {
        for (int64_t w = 0; w < words; w++) {
            const double *row = sizes + p * top + WORD * w;
            int64_t word = 0;
            int64_t one = 1;
            for (int64_t k = 0; k < imin(WORD, top - WORD * w); k++) {
                word += row[k] != 0.0 ? one : 0;
                one += one;
            }
            bits[p * words + w] = word;
        }
    }
}

void slot_sets_fill(int64_t p, int64_t q, int64_t full_p, int64_t full_q, int64_t words, int64_t *restrict bits,
                    int64_t *restrict sets) {
    slot_sets_patterns(p, q, words, bits, sets);
    const int64_t *of_q = sets + words;
    for (int64_t w = 0; w < words; w++) {
        int64_t left = sets[w] | of_q[w];
        while (left != 0) {
            int64_t one = slot_sets_lowest(left);
            left = left ^ one;
            int64_t i = slot_sets_slot_of(w, one);
            int64_t *row = bits + i * words;
            bool in_p = (sets[w] & one) != 0;
            bool in_q = (of_q[w] & one) != 0;
            for (int64_t k = 0; k < words; k++) {
                if (in_q || (in_p && full_p != 0)) row[k] = row[k] | sets[k];
                if (in_p || (in_q && full_q != 0)) row[k] = row[k] | of_q[k];
            }
            slot_sets_leave_out(p, row);
            if (q >= 0) slot_sets_leave_out(q, row);
        }
    }
}
