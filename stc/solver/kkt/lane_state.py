"""What an elimination in lanes is told and what it tells of itself, and when it tests the scale.

All are numbers in one array, ``state``, which compiled functions hand on to each other: whether pivots are to be
watched, the largest test of a pivot, how many pivots were negative, how far ahead memory is asked for.  Where several
parts of a matrix are eliminated side by side, each has a ``state`` of its own; ``put_together`` makes them one.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, i64, native
from stc.codegen.native_vector import largest8, load8

__all__ = [
    "CHECK",
    "COUNTED",
    "DISTANCE",
    "FETCHED",
    "LARGEST",
    "NEGATIVE",
    "RARELY",
    "STALE",
    "STATE",
    "STREAMED",
    "TRUSTED",
    "UNWATCHED",
    "WATCHED",
    "WORST",
    "is_doubtful",
    "is_watched",
    "note_watched",
    "put_together",
    "spread_in",
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
SELDOM = 3.0
RARELY = 11.0
#: A scale serves as long as the largest entries of all rows are within this factor of 1; that far they are not far
#: from where it does not.
STALE = 1024.0
UNEASY = 32.0


@native(inline=True)
def is_watched(state: f64s) -> i64:
    """Whether the scale is to be tested with the matrix at hand."""
    state[UNWATCHED] -= 1.0
    return 1 if state[UNWATCHED] < 0.0 else 0


@native(inline=True)
def spread_in(noted: f64s) -> f64:
    """How far from 1 the largest entries of rows in segments are, from what ``eliminate`` has noted of them."""
    return max(largest8(load8(noted, 0)), -1.0 / largest8(load8(noted, 8)))


@native(inline=True)
def note_watched(spread: f64, state: f64s) -> None:
    """Note how far from 1 the largest entries of rows were when the scale was tested."""
    state[UNWATCHED] = RARELY if spread < UNEASY else SELDOM


@native(inline=True)
def is_doubtful(state: f64s) -> i64:
    """Whether factors that were not watched are not to be trusted, so that the scale has to be tested after all."""
    if state[LARGEST] <= state[TRUSTED]:
        return 0
    state[UNWATCHED] = 0.0
    return 1


@native(small=True)
def put_together(parts: i64, states: f64s, state: f64s) -> i64:
    """The pivots and tests of all parts of an elimination, of which each has its own state; 1 where one was refused."""
    state[COUNTED] = 0.0
    state[LARGEST] = 0.0
    for part in range(parts):
        own = states[part * STATE :]
        if own[COUNTED] < 0.0:
            return 1
        state[COUNTED] += own[COUNTED]
        state[LARGEST] = max(state[LARGEST], own[LARGEST])
    return 0
