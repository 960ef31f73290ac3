"""Sets of slots, a bit for each: which entries the rows of a symmetric pattern have, and what eliminations add.

A set is some words, WORD bits of each; a pattern is a set for every row, one after the other.  All words are the same
number for a stage, ``words_of`` its slots.
"""

from __future__ import annotations

from stc.codegen.native import count_bits, f64s, i32s, i64, i64s, native

__all__ = [
    "fill",
    "fills_own",
    "leave_out",
    "listed",
    "lowest",
    "missing",
    "note_rows",
    "patterns",
    "size_of",
    "slot_of",
    "take_out",
    "words_of",
]

#: Bits of a word that are made use of.
WORD = 32


@native(small=True)
def words_of(top: i64) -> i64:
    """How many words have a bit for each of so many slots."""
    return (top + WORD - 1) // WORD


@native
def note_rows(top: i64, words: i64, sizes: f64s, bits: i64s) -> None:
    """Note which entries all rows have of ``sizes``, where these are not zero."""
    for p in range(top):
        for w in range(words):
            row = sizes[p * top + WORD * w :]
            word = 0
            one = 1
            for k in range(min(WORD, top - WORD * w)):
                word += one if row[k] != 0.0 else 0
                one += one
            bits[p * words + w] = word


@native(inline=True)
def lowest(word: i64) -> i64:
    """The lowest bit of a word that has one."""
    return word & (0 - word)


@native(inline=True)
def slot_of(w: i64, one: i64) -> i64:
    """The slot that a bit of a word stands for."""
    return WORD * w + count_bits(one - 1)


@native(inline=True)
def _bit_of(slot: i64) -> i64:
    """The bit of a slot in its word."""
    one = 1
    for _k in range(slot % WORD):
        one += one
    return one


@native(inline=True)
def _has(slot: i64, members: i64s) -> i64:
    """Whether a slot is in a set."""
    return 1 if members[slot // WORD] & _bit_of(slot) != 0 else 0


@native(inline=True)
def leave_out(slot: i64, members: i64s) -> None:
    """Take a slot out of a set."""
    members[slot // WORD] ^= members[slot // WORD] & _bit_of(slot)


@native(inline=True)
def size_of(words: i64, members: i64s) -> i64:
    """How many slots are in a set."""
    count = 0
    for w in range(words):
        count += count_bits(members[w])
    return count


@native(inline=True)
def missing(words: i64, wanted: i64s, row: i64s) -> i64:
    """How many members of a set a row has no entry for."""
    count = 0
    for w in range(words):
        count += count_bits(wanted[w] ^ (wanted[w] & row[w]))
    return count


@native(inline=True)
def listed(words: i64, members: i64s, slots: i32s) -> i64:
    """Write the members of a set into ``slots``, the lowest first; how many there are."""
    count = 0
    for w in range(words):
        left = members[w]
        while left != 0:
            one = lowest(left)
            left = left ^ one
            slots[count] = slot_of(w, one)
            count += 1
    return count


@native(inline=True)
def patterns(p: i64, q: i64, words: i64, bits: i64s, sets: i64s) -> None:
    """The patterns P and Q of the columns of p and q, this one empty where q is below 0, without these themselves."""
    of_q = sets[words:]
    for w in range(words):
        sets[w] = bits[p * words + w]
        of_q[w] = bits[q * words + w] if q >= 0 else 0
    leave_out(p, sets)
    leave_out(p, of_q)
    if q >= 0:
        leave_out(q, sets)
        leave_out(q, of_q)


@native
def fill(p: i64, q: i64, full_p: i64, full_q: i64, words: i64, bits: i64s, sets: i64s) -> None:
    """Note the entries that the elimination of p, and of q when that is no less than 0, adds, and take these out.

    Args:
        full_p, full_q: 1 where all of P couples with itself afterwards, and all of Q.
        bits: the pattern, but for the rows of p and q themselves, which are left as they are.
        sets: work space, P and Q afterwards, (2 * words,).
    """
    patterns(p, q, words, bits, sets)
    of_q = sets[words:]
    for w in range(words):
        left = sets[w] | of_q[w]
        while left != 0:
            one = lowest(left)
            left = left ^ one
            i = slot_of(w, one)
            row = bits[i * words :]
            in_p = sets[w] & one != 0
            in_q = of_q[w] & one != 0
            for k in range(words):
                if in_q or (in_p and full_p != 0):
                    row[k] = row[k] | sets[k]
                if in_p or (in_q and full_q != 0):
                    row[k] = row[k] | of_q[k]
            leave_out(p, row)
            if q >= 0:
                leave_out(q, row)


@native(inline=True)
def fills_own(partner: i64, words: i64, bits: i64s) -> i64:
    """Whether all that a slot couples with does so with each other once the slot is taken out, with a partner if that
    is no less than 0: unless this one has no diagonal."""
    full = 1
    if partner >= 0:
        full = _has(partner, bits[partner * words :])
    return full


@native(inline=True)
def take_out(p: i64, q: i64, words: i64, bits: i64s, sets: i64s) -> None:
    """Eliminate p, and q when that is no less than 0, from a pattern with its diagonal; leaves P and Q in ``sets``."""
    fill(p, q, fills_own(q, words, bits), fills_own(p, words, bits), words, bits, sets)
    for w in range(words):
        bits[p * words + w] = 0
        if q >= 0:
            bits[q * words + w] = 0
