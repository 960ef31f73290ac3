/* Sets of slots, a bit for each: which entries the rows of a symmetric pattern have, and what eliminations add. */
#ifndef STC_SLOT_SETS_H
#define STC_SLOT_SETS_H

#include "../native.h"

/* Bits of a word that are made use of. */
enum {
    WORD = 32,
};

/* How many words have a bit for each of so many slots. */
API int64_t slot_sets_words_of(int64_t top);

/* Note which entries all rows have of sizes, where these are not zero. */
void slot_sets_note_rows(int64_t top, int64_t words, const double *restrict sizes, int64_t *restrict bits);

/* Note the entries that the elimination of p, and of q when that is no less than 0, adds, and take these out.
 *
 * full_p, full_q: 1 where all of P couples with itself afterwards, and all of Q.
 * bits: the pattern, but for the rows of p and q themselves, which are left as they are.
 * sets: work space, P and Q afterwards, (2 * words,). */
void slot_sets_fill(int64_t p, int64_t q, int64_t full_p, int64_t full_q, int64_t words, int64_t *restrict bits,
                    int64_t *restrict sets);

/* The lowest bit of a word that has one. */
ALWAYS_INLINE int64_t slot_sets_lowest(int64_t word) {
    return word & (0 - word);
}

/* The slot that a bit of a word stands for. */
ALWAYS_INLINE int64_t slot_sets_slot_of(int64_t w, int64_t one) {
    return WORD * w + count_bits(one - 1);
}

/* The bit of a slot in its word. */
ALWAYS_INLINE int64_t slot_sets_bit_of(int64_t slot) {
    int64_t one = 1;
    for (int64_t k = 0; k < floor_mod(slot, WORD); k++) one += one;
    return one;
}

/* Whether a slot is in a set. */
ALWAYS_INLINE int64_t slot_sets_has(int64_t slot, const int64_t *restrict members) {
    return (members[floor_div(slot, WORD)] & slot_sets_bit_of(slot)) != 0 ? 1 : 0;
}

/* Take a slot out of a set. */
ALWAYS_INLINE void slot_sets_leave_out(int64_t slot, int64_t *restrict members) {
    members[floor_div(slot, WORD)] ^= members[floor_div(slot, WORD)] & slot_sets_bit_of(slot);
}

/* How many slots are in a set. */
ALWAYS_INLINE int64_t slot_sets_size_of(int64_t words, const int64_t *restrict members) {
    int64_t count = 0;
    for (int64_t w = 0; w < words; w++) count += count_bits(members[w]);
    return count;
}

/* How many members of a set a row has no entry for. */
ALWAYS_INLINE int64_t slot_sets_missing(int64_t words, const int64_t *restrict wanted,
                                        const int64_t *restrict row) {
    int64_t count = 0;
    for (int64_t w = 0; w < words; w++) count += count_bits(wanted[w] ^ (wanted[w] & row[w]));
    return count;
}

/* Write the members of a set into slots, the lowest first; how many there are. */
ALWAYS_INLINE int64_t slot_sets_listed(int64_t words, const int64_t *restrict members, int32_t *restrict slots) {
    int64_t count = 0;
    for (int64_t w = 0; w < words; w++) {
        int64_t left = members[w];
        while (left != 0) {
            int64_t one = slot_sets_lowest(left);
            left = left ^ one;
            slots[count] = (int32_t)slot_sets_slot_of(w, one);
            count++;
        }
    }
    return count;
}

/* The patterns P and Q of the columns of p and q, this one empty where q is below 0, without these themselves. */
ALWAYS_INLINE void slot_sets_patterns(int64_t p, int64_t q, int64_t words, const int64_t *restrict bits,
                                      int64_t *restrict sets) {
    int64_t *of_q = sets + words;
    for (int64_t w = 0; w < words; w++) {
        sets[w] = bits[p * words + w];
        of_q[w] = q >= 0 ? bits[q * words + w] : 0;
    }
    slot_sets_leave_out(p, sets);
    slot_sets_leave_out(p, of_q);
    if (q >= 0) {
        slot_sets_leave_out(q, sets);
        slot_sets_leave_out(q, of_q);
    }
}

/* Whether all that a slot couples with does so with each other once the slot is taken out, with a partner if that
 * is no less than 0: unless this one has no diagonal. */
ALWAYS_INLINE int64_t slot_sets_fills_own(int64_t partner, int64_t words, const int64_t *restrict bits) {
    int64_t full = 1;
    if (partner >= 0) full = slot_sets_has(partner, bits + partner * words);
    return full;
}

/* Eliminate p, and q when that is no less than 0, from a pattern with its diagonal; leaves P and Q in sets. */
ALWAYS_INLINE void slot_sets_take_out(int64_t p, int64_t q, int64_t words, int64_t *restrict bits,
                                      int64_t *restrict sets) {
    slot_sets_fill(p, q, slot_sets_fills_own(q, words, bits), slot_sets_fills_own(p, words, bits), words, bits,
                   sets);
    for (int64_t w = 0; w < words; w++) {
        bits[p * words + w] = 0;
        if (q >= 0) bits[q * words + w] = 0;
    }
}

#endif
