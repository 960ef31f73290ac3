"""Sets of slots, a bit for each: which entries the rows of a symmetric pattern have, and what eliminations add.

A set is some words, WORD bits of each; a pattern is a set for every row, one after the other.  All words are the same
number for a stage, ``words_of`` its slots.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = ["words_of"]

#: Bits of a word that are made use of.
WORD = 32

#: How many words have a bit for each of so many slots.
words_of = function("slot_sets_words_of")
