"""How many instants a file holds, and what is too much for one.

That is better refused at once than after minutes, or by a lack of memory.
"""

from __future__ import annotations

import math

from stc.errors import UsageError
from stc.validate import limits

#: Instants per second of an animation where no other number is asked for.
USUAL_RATE = 60.0


def intervals(duration: float, rate: float) -> int:
    """How many there are between instants at a rate, the last one perhaps shorter; rounding adds none."""
    return math.ceil(duration * rate - 1e-9)


def require_proportion(instants: float, numbers: int, asked: str) -> None:
    """Refuse a file with too many numbers before any work is done.

    Args:
        instants: how many there are to be, infinite perhaps.
        numbers: for each of them.
        asked: what was asked for, such as ``a rate of 1e+09 Hz``.

    Raises:
        UsageError: they are more than :data:`stc.validate.limits.MOST_NUMBERS`.
    """
    if not instants * numbers <= limits.MOST_NUMBERS:
        raise UsageError(
            f"{asked} means {instants:.3g} instants of {numbers} numbers each: a file holds "
            f"{limits.MOST_NUMBERS:.0e} numbers at most",
            f"that is {limits.MOST_NUMBERS // numbers} instants of this motion",
        )
