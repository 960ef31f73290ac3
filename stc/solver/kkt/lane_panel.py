"""One panel of pivots taken out of eight segments at once (see stc.solver.kkt.lanes).

    C   members x (members + rows), what is left of their columns
    L   D^-1 C, the factors, which are kept             work[rows, rows] -= L^T C

The triangle's entry (i, j), i >= j, of all eight lanes is at ``work[8 (i (i + 1) / 2 + j)]``.  All that is kept of a
panel are the corner, members x members of L, and then the rest of L, row by row.  Of the corner there is the upper
triangle, row by row: D^-1 on the diagonal, and beside it the other entry of D^-1 where a pivot has two unknowns, which
have no factor there.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, i32s, i64, native
from stc.codegen.native_vector import (
    abs8,
    largest8,
    load8,
    max8,
    negative8,
    prefetch8,
    splat8,
    store8,
    stream8,
)

__all__ = [
    "CHECK",
    "COUNTED",
    "DISTANCE",
    "LARGEST",
    "NEGATIVE",
    "PANEL",
    "RARELY",
    "STALE",
    "STATE",
    "STREAMED",
    "TRUSTED",
    "UNWATCHED",
    "WATCHED",
    "WORST",
    "ask_ahead",
    "ask_behind",
    "is_doubtful",
    "is_watched",
    "note_watched",
    "panel_vectors",
    "put_together",
    "put_vectors",
    "take_panel",
]

#: Unknowns of a panel at most.
PANEL = 4
#: Places in ``state``: what tests a pivot, the largest so far in each lane, should be below 1; pivots that are
#: negative; the largest test of all groups; negative pivots of all together; the largest test up to which factors are
#: trusted; how far ahead memory is asked for, 0 where it is near; matrices until the scale is tested again; whether
#: factors are written past the caches; whether the scale is tested with the matrix at hand; 0 in each lane as long as
#: all entries of the matrix are finite, else nan.
WORST = 0
NEGATIVE = 8
LARGEST = 16
COUNTED = 17
TRUSTED = 18
DISTANCE = 24
UNWATCHED = 25
STREAMED = 26
WATCHED = 27
CHECK = 32
STATE = 40
#: The scale is tested with one matrix in so many and one more, or, where it was far from not serving, with fewer.
SELDOM = 3.0
RARELY = 11.0
#: A scale serves as long as the largest entries of all rows are within this factor of 1; that far they are not far
#: from where it does not.
STALE = 1024.0
UNEASY = 32.0
#: Makes any number nothing, but not infinity.
NO_SHARE = 1e-200


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


@native(inline=True)
def panel_vectors(members: i64, count: i64) -> i64:
    """How many vectors are kept of a panel."""
    return members * (members + 1) // 2 + members * count


@native(inline=True)
def ask_ahead(distance: i64, vectors: i64, far: i64, at: i64, x: f64s) -> None:
    """Ask for what is so far ahead of some vectors of ``x``, which are ``far`` numbers apart."""
    if distance > 0:
        for k in range(vectors):
            prefetch8(x, at + distance + k * far)


@native(inline=True)
def ask_behind(distance: i64, vectors: i64, at: i64, x: f64s) -> None:
    """Ask for what is so far behind some vectors of ``x``, the last one first: processors foresee a steady descent."""
    if distance > 0:
        for k in range(vectors):
            prefetch8(x, at - distance + 8 * (vectors - 1 - k))


@native(inline=True)
def put_vectors(streamed: i64, vectors: i64, part: f64s, at: i64, x: f64s) -> None:
    """Copy some vectors of ``part`` to ``x`` from ``at`` on, past the caches when ``streamed``."""
    if streamed != 0:
        for k in range(vectors):
            stream8(x, at + 8 * k, load8(part, 8 * k))
    else:
        for k in range(vectors):
            store8(x, at + 8 * k, load8(part, 8 * k))


@native(fused=True, inline=True)
def _update_four(
    distance: i64, streamed: i64, count: i64, rows: i32s, factors: f64s, columns: f64s, work: f64s, target: f64s
) -> None:  # fmt: skip
    """Subtract what four members leave; their rows of ``factors`` and ``columns`` are ``count`` vectors.

    Meanwhile the memory of later factors, ``distance`` ahead, is asked for: to wait for it then takes longer.  Or the
    factors are copied to ``target`` past the caches where they are ``streamed``: they are in registers for a moment,
    and a processor that multiplies has little else to store.
    """
    i = 0
    far = 8 * count
    while i + 1 < count:
        e = 8 * i
        row = rows[i]
        base = 4 * row * (row + 1)
        below = rows[i + 1]
        base_below = 4 * below * (below + 1)
        a0 = load8(factors, e)
        a1 = load8(factors, e + far)
        a2 = load8(factors, e + 2 * far)
        a3 = load8(factors, e + 3 * far)
        b0 = load8(factors, e + 8)
        b1 = load8(factors, e + far + 8)
        b2 = load8(factors, e + 2 * far + 8)
        b3 = load8(factors, e + 3 * far + 8)
        ask_ahead(distance, 4, far, e, factors)
        ask_ahead(distance, 4, far, e + 8, factors)
        if streamed != 0:
            stream8(target, e, a0)
            stream8(target, e + 8, b0)
            stream8(target, e + far, a1)
            stream8(target, e + far + 8, b1)
            stream8(target, e + 2 * far, a2)
            stream8(target, e + 2 * far + 8, b2)
            stream8(target, e + 3 * far, a3)
            stream8(target, e + 3 * far + 8, b3)
        for j in range(i + 1):
            other = 8 * rows[j]
            at = 8 * j
            c0 = load8(columns, at)
            c1 = load8(columns, at + far)
            c2 = load8(columns, at + 2 * far)
            c3 = load8(columns, at + 3 * far)
            one = load8(work, base + other) - a0 * c0 - a1 * c1 - a2 * c2 - a3 * c3
            two = load8(work, base_below + other) - b0 * c0 - b1 * c1 - b2 * c2 - b3 * c3
            store8(work, base + other, one)
            store8(work, base_below + other, two)
        at = e + 8
        last = load8(work, base_below + 8 * below)
        last = last - b0 * load8(columns, at) - b1 * load8(columns, at + far)
        last = last - b2 * load8(columns, at + 2 * far) - b3 * load8(columns, at + 3 * far)
        store8(work, base_below + 8 * below, last)
        i += 2
    if i < count:
        e = 8 * i
        row = rows[i]
        base = 4 * row * (row + 1)
        a0 = load8(factors, e)
        a1 = load8(factors, e + far)
        a2 = load8(factors, e + 2 * far)
        a3 = load8(factors, e + 3 * far)
        if streamed != 0:
            stream8(target, e, a0)
            stream8(target, e + far, a1)
            stream8(target, e + 2 * far, a2)
            stream8(target, e + 3 * far, a3)
        for j in range(i + 1):
            other = 8 * rows[j]
            at = 8 * j
            one = load8(work, base + other) - a0 * load8(columns, at) - a1 * load8(columns, at + far)
            one = one - a2 * load8(columns, at + 2 * far) - a3 * load8(columns, at + 3 * far)
            store8(work, base + other, one)


@native(fused=True, inline=True)
def _update_two(
    distance: i64, streamed: i64, count: i64, rows: i32s, length: i64, begin: i64, factors: f64s, columns: f64s,
    work: f64s, target: f64s,
) -> None:  # fmt: skip
    """The same for two members, of rows that are ``length`` vectors apart and looked at from ``begin`` on."""
    far = 8 * length
    i = 0
    while i + 1 < count:
        e = 8 * (begin + i)
        row = rows[i]
        base = 4 * row * (row + 1)
        below = rows[i + 1]
        base_below = 4 * below * (below + 1)
        a0 = load8(factors, e)
        a1 = load8(factors, e + far)
        b0 = load8(factors, e + 8)
        b1 = load8(factors, e + far + 8)
        ask_ahead(distance, 2, far, e, factors)
        ask_ahead(distance, 2, far, e + 8, factors)
        if streamed != 0:
            stream8(target, e, a0)
            stream8(target, e + 8, b0)
            stream8(target, e + far, a1)
            stream8(target, e + far + 8, b1)
        for j in range(i + 1):
            other = 8 * rows[j]
            at = 8 * (begin + j)
            c0 = load8(columns, at)
            c1 = load8(columns, at + far)
            store8(work, base + other, load8(work, base + other) - a0 * c0 - a1 * c1)
            store8(work, base_below + other, load8(work, base_below + other) - b0 * c0 - b1 * c1)
        at = e + 8
        last = load8(work, base_below + 8 * below) - b0 * load8(columns, at) - b1 * load8(columns, at + far)
        store8(work, base_below + 8 * below, last)
        i += 2
    if i < count:
        e = 8 * (begin + i)
        row = rows[i]
        base = 4 * row * (row + 1)
        a0 = load8(factors, e)
        a1 = load8(factors, e + far)
        if streamed != 0:
            stream8(target, e, a0)
            stream8(target, e + far, a1)
        for j in range(i + 1):
            other = 8 * rows[j]
            at = 8 * (begin + j)
            one = load8(work, base + other) - a0 * load8(columns, at) - a1 * load8(columns, at + far)
            store8(work, base + other, one)


@native(fast=True, inline=True)
def _update_one(
    distance: i64, streamed: i64, count: i64, rows: i32s, begin: i64, factors: f64s, columns: f64s, work: f64s,
    target: f64s,
) -> None:  # fmt: skip
    """The same for one member."""
    for i in range(count):
        e = 8 * (begin + i)
        row = rows[i]
        base = 4 * row * (row + 1)
        a0 = load8(factors, e)
        ask_ahead(distance, 1, 0, e, factors)
        if streamed != 0:
            stream8(target, e, a0)
        for j in range(i + 1):
            other = 8 * rows[j]
            store8(work, base + other, load8(work, base + other) - a0 * load8(columns, 8 * (begin + j)))


@native(fast=True, inline=True)
def _take_single(
    p: i64, members: i64, length: i64, growth: f64, suspect: f64, columns: f64s, factors: f64s,
    state: f64s,
) -> None:  # fmt: skip
    """Take the pivot of member ``p`` out of the panel, whose rows are ``length`` vectors long."""
    own = 8 * p * length
    d = load8(columns, own + 8 * p)
    reciprocal = 1.0 / d
    most = splat8(0.0)
    for e in range(p + 1, length):
        value = load8(columns, own + 8 * e)
        most = max8(abs8(value), most)
        store8(factors, own + 8 * e, value * reciprocal)
    store8(factors, own + 8 * p, reciprocal)
    size = abs8(reciprocal)
    worst = max8(size * suspect, load8(state, WORST))
    store8(state, WORST, max8(most * most * size * growth, worst))
    store8(state, NEGATIVE, load8(state, NEGATIVE) + negative8(d))
    for q in range(p + 1, members):
        factor = load8(factors, own + 8 * q)
        row = 8 * q * length
        for e in range(q, length):
            store8(columns, row + 8 * e, load8(columns, row + 8 * e) - factor * load8(columns, own + 8 * e))


@native(fast=True, inline=True)
def _take_pair(
    p: i64, members: i64, length: i64, growth: f64, suspect: f64, columns: f64s, factors: f64s,
    state: f64s,
) -> None:  # fmt: skip
    """The same for members ``p`` and ``p + 1``."""
    one = 8 * p * length
    two = one + 8 * length
    a = load8(columns, one + 8 * p)
    b = load8(columns, one + 8 * p + 8)
    c = load8(columns, two + 8 * p + 8)
    determinant = a * c - b * b
    reciprocal = 1.0 / determinant
    inverse_pp = c * reciprocal
    inverse_pq = -(b * reciprocal)
    inverse_qq = a * reciprocal
    most_p = splat8(0.0)
    most_q = splat8(0.0)
    factor_p = splat8(0.0)
    factor_q = splat8(0.0)
    for e in range(p + 2, length):
        value_p = load8(columns, one + 8 * e)
        value_q = load8(columns, two + 8 * e)
        scaled_p = inverse_pp * value_p + inverse_pq * value_q
        scaled_q = inverse_pq * value_p + inverse_qq * value_q
        store8(factors, one + 8 * e, scaled_p)
        store8(factors, two + 8 * e, scaled_q)
        most_p = max8(abs8(value_p), most_p)
        most_q = max8(abs8(value_q), most_q)
        factor_p = max8(abs8(scaled_p), factor_p)
        factor_q = max8(abs8(scaled_q), factor_q)
    store8(factors, one + 8 * p, inverse_pp)
    store8(factors, one + 8 * p + 8, inverse_pq)
    store8(factors, two + 8 * p + 8, inverse_qq)
    size = max8(abs8(inverse_pq), max8(abs8(inverse_pp), abs8(inverse_qq)))
    # All three may be undefined (0 times infinity): the reciprocal is infinite then.
    size = max8(size, abs8(reciprocal) * NO_SHARE)
    worst = max8(size * suspect, load8(state, WORST))
    store8(state, WORST, max8((most_p * factor_p + most_q * factor_q) * growth, worst))
    mixed = negative8(determinant)
    store8(state, NEGATIVE, load8(state, NEGATIVE) + mixed + 2.0 * (1.0 - mixed) * negative8(a))
    for q in range(p + 2, members):
        by_p = load8(factors, one + 8 * q)
        by_q = load8(factors, two + 8 * q)
        row = 8 * q * length
        for e in range(q, length):
            change = by_p * load8(columns, one + 8 * e) + by_q * load8(columns, two + 8 * e)
            store8(columns, row + 8 * e, load8(columns, row + 8 * e) - change)


@native(fast=True, inline=True)
def _take_corner(
    members: i64, length: i64, kinds: i32s, sources: i32s, growth: f64, suspect: f64, work: f64s, columns: f64s,
    corner: f64s, factors: f64s, state: f64s,
) -> None:  # fmt: skip
    """Eliminate the members from each other, of C and L only ``members`` columns; L is in ``corner``, and kept."""
    for k in range(members):
        for e in range(k, members):
            store8(columns, 8 * (k * members + e), load8(work, 8 * sources[k * length + e]))
    p = 0
    while p < members:
        if kinds[p] == 2:
            _take_pair(p, members, members, growth, suspect, columns, corner, state)
            p += 2
        else:
            _take_single(p, members, members, growth, suspect, columns, corner, state)
            p += 1
    _keep_corner(members, members, corner, factors)


@native(fast=True, inline=True)
def _keep_corner(members: i64, length: i64, corner: f64s, factors: f64s) -> None:
    """Copy the upper triangle; rows of ``corner`` are ``length`` vectors apart."""
    at = 0
    for p in range(members):
        for q in range(p, members):
            store8(factors, 8 * at, load8(corner, 8 * (p * length + q)))
            at += 1


@native(fast=True, inline=True)
def _scale_four(
    count: i64, kinds: i32s, sources: i32s, growth: f64, work: f64s, corner: f64s, columns: f64s, factors: f64s,
    state: f64s,
) -> None:  # fmt: skip
    """The rest of four members' columns, once they have been eliminated from each other, and the factors."""
    length = 4 + count
    far = 8 * count
    d0 = load8(corner, 0)
    l01 = load8(corner, 8)
    l02 = load8(corner, 16)
    l03 = load8(corner, 24)
    d1 = load8(corner, 40)
    l12 = load8(corner, 48)
    l13 = load8(corner, 56)
    d2 = load8(corner, 80)
    l23 = load8(corner, 88)
    d3 = load8(corner, 120)
    o01 = splat8(0.0)
    o12 = splat8(0.0)
    o23 = splat8(0.0)
    if kinds[0] == 2:
        o01 = l01
        l01 = splat8(0.0)
    if kinds[1] == 2:
        o12 = l12
        l12 = splat8(0.0)
    if kinds[2] == 2:
        o23 = l23
        l23 = splat8(0.0)
    most0 = splat8(0.0)
    most1 = splat8(0.0)
    most2 = splat8(0.0)
    most3 = splat8(0.0)
    for e in range(count):
        at = 8 * e
        source = 4 + e
        c0 = load8(work, 8 * sources[source])
        c1 = load8(work, 8 * sources[length + source]) - l01 * c0
        c2 = load8(work, 8 * sources[2 * length + source]) - l02 * c0
        c2 = c2 - l12 * c1
        c3 = load8(work, 8 * sources[3 * length + source]) - l03 * c0
        c3 = c3 - l13 * c1
        c3 = c3 - l23 * c2
        f0 = d0 * c0 + o01 * c1
        f1 = d1 * c1 + o01 * c0 + o12 * c2
        f2 = d2 * c2 + o12 * c1 + o23 * c3
        f3 = d3 * c3 + o23 * c2
        store8(columns, at, c0)
        store8(columns, at + far, c1)
        store8(columns, at + 2 * far, c2)
        store8(columns, at + 3 * far, c3)
        store8(factors, at, f0)
        store8(factors, at + far, f1)
        store8(factors, at + 2 * far, f2)
        store8(factors, at + 3 * far, f3)
        most0 = max8(abs8(c0), most0)
        most1 = max8(abs8(c1), most1)
        most2 = max8(abs8(c2), most2)
        most3 = max8(abs8(c3), most3)
    # What D^-1 makes of the largest of C is no less than the largest factor.
    high0 = abs8(d0) * most0 + abs8(o01) * most1
    high1 = abs8(d1) * most1 + abs8(o01) * most0 + abs8(o12) * most2
    high2 = abs8(d2) * most2 + abs8(o12) * most1 + abs8(o23) * most3
    high3 = abs8(d3) * most3 + abs8(o23) * most2
    worst = max8(max8(most0 * high0, most1 * high1), max8(most2 * high2, most3 * high3))
    store8(state, WORST, max8(worst * growth, load8(state, WORST)))


@native(fast=True, inline=True)
def _scale_two(
    count: i64, kinds: i32s, sources: i32s, growth: f64, work: f64s, corner: f64s, columns: f64s, factors: f64s,
    state: f64s,
) -> None:  # fmt: skip
    """The same for two members."""
    length = 2 + count
    far = 8 * count
    d0 = load8(corner, 0)
    l01 = load8(corner, 8)
    d1 = load8(corner, 24)
    o01 = splat8(0.0)
    if kinds[0] == 2:
        o01 = l01
        l01 = splat8(0.0)
    most0 = splat8(0.0)
    most1 = splat8(0.0)
    for e in range(count):
        at = 8 * e
        c0 = load8(work, 8 * sources[2 + e])
        c1 = load8(work, 8 * sources[length + 2 + e]) - l01 * c0
        f0 = d0 * c0 + o01 * c1
        f1 = d1 * c1 + o01 * c0
        store8(columns, at, c0)
        store8(columns, at + far, c1)
        store8(factors, at, f0)
        store8(factors, at + far, f1)
        most0 = max8(abs8(c0), most0)
        most1 = max8(abs8(c1), most1)
    high0 = abs8(d0) * most0 + abs8(o01) * most1
    high1 = abs8(d1) * most1 + abs8(o01) * most0
    store8(state, WORST, max8(max8(most0 * high0, most1 * high1) * growth, load8(state, WORST)))


@native(fast=True, inline=True)
def _take_three(
    distance: i64, streamed: i64, count: i64, kinds: i32s, rows: i32s, sources: i32s, growth: f64, suspect: f64,
    work: f64s, columns: f64s, whole: f64s, factors: f64s, target: f64s, state: f64s,
) -> None:  # fmt: skip
    """Take three members out at once; ``whole`` is room for all of L."""
    length = 3 + count
    for k in range(3):
        row = k * length
        for e in range(k, length):
            store8(columns, 8 * (row + e), load8(work, 8 * sources[row + e]))
    p = 0
    while p < 3:
        if kinds[p] == 2:
            _take_pair(p, 3, length, growth, suspect, columns, whole, state)
            p += 2
        else:
            _take_single(p, 3, length, growth, suspect, columns, whole, state)
            p += 1
    _update_two(0, 0, count, rows, length, 3, whole, columns, work, target)
    last = 16 * length
    _update_one(0, 0, count, rows, 3, whole[last:], columns[last:], work, target)
    _keep_corner(3, length, whole, factors)
    for k in range(3):
        for e in range(count):
            at = 8 * (6 + k * count + e)
            value = load8(whole, 8 * (k * length + 3 + e))
            if streamed != 0:
                stream8(target, at, value)
            else:
                ask_ahead(distance, 1, 0, at, factors)
                store8(factors, at, value)


@native(fast=True)
def take_panel(
    distance: i64, streamed: i64, members: i64, count: i64, kinds: i32s, rows: i32s, sources: i32s, growth: f64,
    suspect: f64, work: f64s, columns: f64s, factors: f64s, target: f64s, state: f64s,
) -> None:  # fmt: skip
    """Take the members out of ``work``; ``columns`` is room for them twice over.

    Args:
        factors: room for theirs, where they are kept unless they are ``streamed`` to ``target``.
    """
    length = members + count
    # Room for C without the corner is followed by that for C and for L in the corner.
    corner = columns[8 * members * count :]
    corner_vectors = panel_vectors(members, 0)
    rest = factors[8 * corner_vectors :]
    rest_target = target[8 * corner_vectors :]
    if members == 4:
        own = corner[128:]
        _take_corner(4, length, kinds, sources, growth, suspect, work, corner, own, factors, state)
        _scale_four(count, kinds, sources, growth, work, own, columns, rest, state)
        _update_four(distance, streamed, count, rows, rest, columns, work, rest_target)
    elif members == 2:
        own = corner[32:]
        _take_corner(2, length, kinds, sources, growth, suspect, work, corner, own, factors, state)
        _scale_two(count, kinds, sources, growth, work, own, columns, rest, state)
        _update_two(distance, streamed, count, rows, count, 0, rest, columns, work, rest_target)
    elif members == 3:
        whole = columns[24 * length :]
        _take_three(
            distance, streamed, count, kinds, rows, sources, growth, suspect, work, columns, whole, factors, target,
            state,
        )  # fmt: skip
    else:
        for e in range(length):
            store8(columns, 8 * e, load8(work, 8 * sources[e]))
        _take_single(0, 1, length, growth, suspect, columns, factors, state)
        _update_one(distance, streamed, count, rows, 1, factors, columns, work, target)
    if streamed != 0:
        put_vectors(1, corner_vectors, factors, 0, target)
