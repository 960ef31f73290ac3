"""What an elimination in lanes is told and what it tells of itself, and when it tests the scale.

The method and its code are in ``stc/core/staged/lane_state.c``.
"""

from __future__ import annotations

__all__ = [
    "CHECK",
    "COUNTED",
    "DISTANCE",
    "FETCHED",
    "LARGEST",
    "NEGATIVE",
    "RARELY",
    "STATE",
    "STREAMED",
    "TRUSTED",
    "UNWATCHED",
    "WATCHED",
    "WORST",
]

#: Places in ``state``: what tests a pivot, the largest so far in each lane, should be below 1; pivots that are
#: negative; the largest test of all groups; negative pivots of all together; the largest test up to which factors are
#: trusted; how far ahead memory is asked for, 0 where it is near; matrices until the scale is tested again; whether
#: factors are written past the caches; whether the scale is tested with the matrix at hand; whether the entries of the
#: matrix are asked for ahead; 0 in each lane as long as all these are finite, else nan.
WORST = 0
NEGATIVE = 8
LARGEST = 16
COUNTED = 17
TRUSTED = 18
DISTANCE = 24
UNWATCHED = 25
STREAMED = 26
WATCHED = 27
FETCHED = 28
CHECK = 32
STATE = 40
#: The scale is tested with one matrix in so many and one more, or, where it was far from not serving, with fewer.
RARELY = 11.0
