"""Sets of slots, a bit for each: which entries the rows of a symmetric pattern have, and what eliminations add.

The method and its code are in ``stc/core/staged/slot_sets.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = ["words_of"]

#: How many words have a bit for each of so many slots.
words_of = function("slot_sets_words_of")
