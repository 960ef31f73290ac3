"""The number of instants in a file, and its upper limit.

A file that is too large is refused at once, before minutes of work or a lack of memory.
"""

from __future__ import annotations

import math

from stc.errors import UsageError
from stc.validate import limits

#: Instants per second of an animation where no other number is asked for.
USUAL_RATE = 60.0


def intervals(duration: float, rate: float) -> int:
    """The number of intervals at a rate, the last one possibly shorter; rounding adds none."""
    return math.ceil(duration * rate - 1e-9)


def require_proportion(instants: float, numbers: int, asked: str) -> None:
    """Refuse a file with too many numbers before any work is done.

    Args:
        instants: number of instants, possibly infinite.
        numbers: numbers per instant.
        asked: the request in words, such as ``a rate of 1e+09 Hz``.

    Raises:
        UsageError: they are more than :data:`stc.validate.limits.MOST_NUMBERS`.
    """
    if not instants * numbers <= limits.MOST_NUMBERS:
        raise UsageError(
            f"{asked} means {instants:.3g} instants of {numbers} numbers each: a file holds "
            f"{limits.MOST_NUMBERS:.0e} numbers at most",
            f"that is {limits.MOST_NUMBERS // numbers} instants of this motion",
        )
