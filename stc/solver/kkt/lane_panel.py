"""One panel of pivots taken out of eight segments at once (see stc.solver.kkt.lanes).

    C   members x (members + rows), what is left of their columns
    L   D^-1 C, the factors, which are kept             work[rows, rows] -= C^T L

The triangle's entry (i, j), i >= j, of all eight lanes is at ``work[8 (i (i + 1) / 2 + j)]``.  All that is kept of a
panel are the corner, members x members of L, and then the rest of L, the factors of one row after those of another.  Of
the corner there is the upper triangle, row by row: D^-1 on the diagonal, and beside it the other entry of D^-1 where a
pivot has two unknowns, which have no factor there.

C is made in registers, of two rows at a time, and so are their factors; both rows are updated at once, each up to its
diagonal, while their C is there.  So nothing but the triangle and the factors goes through memory.  Where a register
holds four numbers, four lanes take their turn with two rows, then the other four: the vectors of eight would not fit.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, i32s, i64, native
from stc.codegen.native_vector import (
    abs8,
    absw,
    load8,
    loadw,
    max8,
    maxw,
    negativew,
    splatw,
    store8,
    storew,
    wide,
)
from stc.solver.kkt.lane_memory import ask_ahead, put_vectors
from stc.solver.kkt.lane_state import NEGATIVE, WORST

__all__ = ["KNOWN", "PANEL", "panel_vectors", "take_panel"]

#: Unknowns of a panel at most.
PANEL = 4
#: Makes any number nothing, but not infinity.
NO_SHARE = 1e-200
#: Places in what is known of the members of a panel, eight numbers each: D^-1 on its diagonal, L in the corner (01, 02,
#: 03, 12, 13, 23), D^-1 beside its diagonal, and the largest entries of C; numbers of all.
CORNER = 32
BESIDE = 80
MOST = 104
KNOWN = 136


@native
def panel_vectors(members: i64, count: i64) -> i64:
    """How many vectors are kept of a panel."""
    return members * (members + 1) // 2 + members * count


@native(fused=True, inline=True)
def _take_corner(
    part: i64, members: i64, length: i64, kinds: i32s, sources: i32s, suspect: f64, work: f64s, known: f64s,
    factors: f64s, state: f64s,
) -> None:  # fmt: skip
    """Eliminate the members from each other; that is the corner of C.

    Args:
        part: lane at which to begin, of as many as a register holds.
        members: one to four; a constant.
        length: of C's rows.
    """
    nothing = splatw(0.0)
    negative = loadw(state, NEGATIVE + part)
    a00 = loadw(work, 8 * sources[0] + part)
    a01 = nothing
    a02 = nothing
    a03 = nothing
    a11 = nothing
    a12 = nothing
    a13 = nothing
    a22 = nothing
    a23 = nothing
    a33 = nothing
    if members > 1:
        a01 = loadw(work, 8 * sources[1] + part)
        a11 = loadw(work, 8 * sources[length + 1] + part)
    if members > 2:
        a02 = loadw(work, 8 * sources[2] + part)
        a12 = loadw(work, 8 * sources[length + 2] + part)
        a22 = loadw(work, 8 * sources[2 * length + 2] + part)
    if members > 3:
        a03 = loadw(work, 8 * sources[3] + part)
        a13 = loadw(work, 8 * sources[length + 3] + part)
        a23 = loadw(work, 8 * sources[2 * length + 3] + part)
        a33 = loadw(work, 8 * sources[3 * length + 3] + part)
    d0 = nothing
    d1 = nothing
    d2 = nothing
    d3 = nothing
    l01 = nothing
    l02 = nothing
    l03 = nothing
    l12 = nothing
    l13 = nothing
    l23 = nothing
    # Entries of D^-1 beside the diagonal; one of both is zero where the other is not.
    e01 = nothing
    e12 = nothing
    e23 = nothing
    most0 = nothing
    most1 = nothing
    most2 = nothing
    # All of D^-1 may be undefined (0 times infinity): the reciprocal is infinite then.
    undefined = nothing
    if members > 1 and kinds[0] == 2:
        determinant = a00 * a11 - a01 * a01
        reciprocal = 1.0 / determinant
        d0 = a11 * reciprocal
        d1 = a00 * reciprocal
        e01 = -(a01 * reciprocal)
        undefined = absw(reciprocal)
        mixed = negativew(determinant)
        negative += mixed + 2.0 * (1.0 - mixed) * negativew(a00)
        if members > 2:
            l02 = d0 * a02 + e01 * a12
            l12 = d1 * a12 + e01 * a02
            a22 = a22 - l02 * a02 - l12 * a12
            most0 = absw(a02)
            most1 = absw(a12)
        if members > 3:
            l03 = d0 * a03 + e01 * a13
            l13 = d1 * a13 + e01 * a03
            a23 = a23 - l02 * a03 - l12 * a13
            a33 = a33 - l03 * a03 - l13 * a13
            most0 = maxw(absw(a03), most0)
            most1 = maxw(absw(a13), most1)
    else:
        d0 = 1.0 / a00
        negative += negativew(a00)
        if members > 1:
            l01 = d0 * a01
            a11 = a11 - l01 * a01
            most0 = absw(a01)
        if members > 2:
            l02 = d0 * a02
            a12 = a12 - l01 * a02
            a22 = a22 - l02 * a02
            most0 = maxw(absw(a02), most0)
        if members > 3:
            l03 = d0 * a03
            a13 = a13 - l01 * a03
            a23 = a23 - l02 * a03
            a33 = a33 - l03 * a03
            most0 = maxw(absw(a03), most0)
        if members > 2 and kinds[1] == 2:
            determinant = a11 * a22 - a12 * a12
            reciprocal = 1.0 / determinant
            d1 = a22 * reciprocal
            d2 = a11 * reciprocal
            e12 = -(a12 * reciprocal)
            undefined = absw(reciprocal)
            mixed = negativew(determinant)
            negative += mixed + 2.0 * (1.0 - mixed) * negativew(a11)
            if members > 3:
                l13 = d1 * a13 + e12 * a23
                l23 = d2 * a23 + e12 * a13
                a33 = a33 - l13 * a13 - l23 * a23
                most1 = absw(a13)
                most2 = absw(a23)
        elif members > 1:
            d1 = 1.0 / a11
            negative += negativew(a11)
            if members > 2:
                l12 = d1 * a12
                a22 = a22 - l12 * a12
                most1 = absw(a12)
            if members > 3:
                l13 = d1 * a13
                a23 = a23 - l12 * a13
                a33 = a33 - l13 * a13
                most1 = maxw(absw(a13), most1)
    if members > 3 and kinds[2] == 2:
        determinant = a22 * a33 - a23 * a23
        reciprocal = 1.0 / determinant
        d2 = a33 * reciprocal
        d3 = a22 * reciprocal
        e23 = -(a23 * reciprocal)
        undefined = maxw(absw(reciprocal), undefined)
        mixed = negativew(determinant)
        negative += mixed + 2.0 * (1.0 - mixed) * negativew(a22)
    elif members > 2 and kinds[2] == 1:
        d2 = 1.0 / a22
        negative += negativew(a22)
        if members > 3:
            l23 = d2 * a23
            a33 = a33 - l23 * a23
            most2 = absw(a23)
    if members > 3 and kinds[3] == 1:
        d3 = 1.0 / a33
        negative += negativew(a33)
    storew(state, NEGATIVE + part, negative)
    storew(state, WORST + part, maxw(undefined * (NO_SHARE * suspect), loadw(state, WORST + part)))
    storew(known, part, d0)
    storew(known, MOST + part, most0)
    storew(factors, part, d0)
    if members > 1:
        storew(known, 8 + part, d1)
        storew(known, CORNER + part, l01)
        storew(known, BESIDE + part, e01)
        storew(known, MOST + 8 + part, most1)
        storew(factors, 8 + part, l01 + e01)
        storew(factors, 8 * members + part, d1)
    if members > 2:
        storew(known, 16 + part, d2)
        storew(known, CORNER + 8 + part, l02)
        storew(known, CORNER + 24 + part, l12)
        storew(known, BESIDE + 8 + part, e12)
        storew(known, MOST + 16 + part, most2)
        storew(factors, 16 + part, l02)
        storew(factors, 8 * members + 8 + part, l12 + e12)
        storew(factors, 16 * members - 8 + part, d2)
    if members > 3:
        storew(known, 24 + part, d3)
        storew(known, CORNER + 16 + part, l03)
        storew(known, CORNER + 32 + part, l13)
        storew(known, CORNER + 40 + part, l23)
        storew(known, BESIDE + 16 + part, e23)
        storew(known, MOST + 24 + part, nothing)
        storew(factors, 24 + part, l03)
        storew(factors, 48 + part, l13)
        storew(factors, 64 + part, l23 + e23)
        storew(factors, 72 + part, d3)


@native(fused=True, inline=True)
def _take_two_rows(
    part: i64, members: i64, singles: i64, pairs: i64, i: i64, length: i64, rows: i32s, sources: i32s, work: f64s,
    known: f64s, factors: f64s,
) -> None:  # fmt: skip
    """Make the factors of rows i and i + 1, and take the members out of these up to their diagonal.

    Args:
        part: lane at which to begin, of as many as a register holds.
        members: one to four; a constant, as are the next two.
        singles, pairs: 1 where all pivots have one unknown, or two.
        length: of C's rows.
        known: what ``_take_corner`` has left, where the largest entries of C are raised.
        factors: those of the panel, without the corner.
    """
    own = members + i
    at = 8 * members * i + part
    a0 = loadw(work, 8 * sources[own] + part)
    b0 = loadw(work, 8 * sources[own + 1] + part)
    storew(known, MOST + part, maxw(absw(b0), maxw(absw(a0), loadw(known, MOST + part))))
    d = loadw(known, part)
    f0 = d * a0
    g0 = d * b0
    a1 = a0
    a2 = a0
    a3 = a0
    b1 = b0
    b2 = b0
    b3 = b0
    f1 = f0
    f2 = f0
    f3 = f0
    g1 = g0
    g2 = g0
    g3 = g0
    if members > 1:
        a1 = loadw(work, 8 * sources[length + own] + part)
        b1 = loadw(work, 8 * sources[length + own + 1] + part)
        if pairs == 0:
            factor = loadw(known, CORNER + part)
            a1 = a1 - factor * a0
            b1 = b1 - factor * b0
        storew(known, MOST + 8 + part, maxw(absw(b1), maxw(absw(a1), loadw(known, MOST + 8 + part))))
        d = loadw(known, 8 + part)
        f1 = d * a1
        g1 = d * b1
        if singles == 0:
            beside = loadw(known, BESIDE + part)
            f0 = f0 + beside * a1
            g0 = g0 + beside * b1
            f1 = f1 + beside * a0
            g1 = g1 + beside * b0
    if members > 2:
        factor = loadw(known, CORNER + 8 + part)
        a2 = loadw(work, 8 * sources[2 * length + own] + part) - factor * a0
        b2 = loadw(work, 8 * sources[2 * length + own + 1] + part) - factor * b0
        factor = loadw(known, CORNER + 24 + part)
        a2 = a2 - factor * a1
        b2 = b2 - factor * b1
        storew(known, MOST + 16 + part, maxw(absw(b2), maxw(absw(a2), loadw(known, MOST + 16 + part))))
        d = loadw(known, 16 + part)
        f2 = d * a2
        g2 = d * b2
        if singles == 0 and pairs == 0:
            beside = loadw(known, BESIDE + 8 + part)
            f1 = f1 + beside * a2
            g1 = g1 + beside * b2
            f2 = f2 + beside * a1
            g2 = g2 + beside * b1
    if members > 3:
        factor = loadw(known, CORNER + 16 + part)
        a3 = loadw(work, 8 * sources[3 * length + own] + part) - factor * a0
        b3 = loadw(work, 8 * sources[3 * length + own + 1] + part) - factor * b0
        factor = loadw(known, CORNER + 32 + part)
        a3 = a3 - factor * a1
        b3 = b3 - factor * b1
        if pairs == 0:
            factor = loadw(known, CORNER + 40 + part)
            a3 = a3 - factor * a2
            b3 = b3 - factor * b2
        storew(known, MOST + 24 + part, maxw(absw(b3), maxw(absw(a3), loadw(known, MOST + 24 + part))))
        d = loadw(known, 24 + part)
        f3 = d * a3
        g3 = d * b3
        if singles == 0:
            beside = loadw(known, BESIDE + 16 + part)
            f2 = f2 + beside * a3
            g2 = g2 + beside * b3
            f3 = f3 + beside * a2
            g3 = g3 + beside * b2
    storew(factors, at, f0)
    storew(factors, at + 8 * members, g0)
    if members > 1:
        storew(factors, at + 8, f1)
        storew(factors, at + 8 * members + 8, g1)
    if members > 2:
        storew(factors, at + 16, f2)
        storew(factors, at + 8 * members + 16, g2)
    if members > 3:
        storew(factors, at + 24, f3)
        storew(factors, at + 8 * members + 24, g3)
    row = rows[i]
    base = 4 * row * (row + 1) + part
    below = rows[i + 1]
    base_below = 4 * below * (below + 1) + part
    one = loadw(work, base + 8 * row) - a0 * f0
    two = loadw(work, base_below + 8 * row) - b0 * f0
    last = loadw(work, base_below + 8 * below) - b0 * g0
    if members > 1:
        one = one - a1 * f1
        two = two - b1 * f1
        last = last - b1 * g1
    if members > 2:
        one = one - a2 * f2
        two = two - b2 * f2
        last = last - b2 * g2
    if members > 3:
        one = one - a3 * f3
        two = two - b3 * f3
        last = last - b3 * g3
    storew(work, base + 8 * row, one)
    storew(work, base_below + 8 * row, two)
    storew(work, base_below + 8 * below, last)
    for j in range(i):
        other = 8 * rows[j]
        k = 8 * members * j + part
        f = loadw(factors, k)
        one = loadw(work, base + other) - a0 * f
        two = loadw(work, base_below + other) - b0 * f
        if members > 1:
            f = loadw(factors, k + 8)
            one = one - a1 * f
            two = two - b1 * f
        if members > 2:
            f = loadw(factors, k + 16)
            one = one - a2 * f
            two = two - b2 * f
        if members > 3:
            f = loadw(factors, k + 24)
            one = one - a3 * f
            two = two - b3 * f
        storew(work, base + other, one)
        storew(work, base_below + other, two)


@native(fused=True, inline=True)
def _take_row(
    part: i64, members: i64, singles: i64, pairs: i64, i: i64, length: i64, rows: i32s, sources: i32s, work: f64s,
    known: f64s, factors: f64s,
) -> None:  # fmt: skip
    """The same for row i alone."""
    own = members + i
    at = 8 * members * i + part
    a0 = loadw(work, 8 * sources[own] + part)
    storew(known, MOST + part, maxw(absw(a0), loadw(known, MOST + part)))
    f0 = loadw(known, part) * a0
    a1 = a0
    a2 = a0
    a3 = a0
    f1 = f0
    f2 = f0
    f3 = f0
    if members > 1:
        a1 = loadw(work, 8 * sources[length + own] + part)
        if pairs == 0:
            a1 = a1 - loadw(known, CORNER + part) * a0
        storew(known, MOST + 8 + part, maxw(absw(a1), loadw(known, MOST + 8 + part)))
        f1 = loadw(known, 8 + part) * a1
        if singles == 0:
            beside = loadw(known, BESIDE + part)
            f0 = f0 + beside * a1
            f1 = f1 + beside * a0
    if members > 2:
        a2 = loadw(work, 8 * sources[2 * length + own] + part)
        a2 = a2 - loadw(known, CORNER + 8 + part) * a0 - loadw(known, CORNER + 24 + part) * a1
        storew(known, MOST + 16 + part, maxw(absw(a2), loadw(known, MOST + 16 + part)))
        f2 = loadw(known, 16 + part) * a2
        if singles == 0 and pairs == 0:
            beside = loadw(known, BESIDE + 8 + part)
            f1 = f1 + beside * a2
            f2 = f2 + beside * a1
    if members > 3:
        a3 = loadw(work, 8 * sources[3 * length + own] + part)
        a3 = a3 - loadw(known, CORNER + 16 + part) * a0 - loadw(known, CORNER + 32 + part) * a1
        if pairs == 0:
            a3 = a3 - loadw(known, CORNER + 40 + part) * a2
        storew(known, MOST + 24 + part, maxw(absw(a3), loadw(known, MOST + 24 + part)))
        f3 = loadw(known, 24 + part) * a3
        if singles == 0:
            beside = loadw(known, BESIDE + 16 + part)
            f2 = f2 + beside * a3
            f3 = f3 + beside * a2
    row = rows[i]
    base = 4 * row * (row + 1) + part
    one = loadw(work, base + 8 * row) - a0 * f0
    storew(factors, at, f0)
    if members > 1:
        one = one - a1 * f1
        storew(factors, at + 8, f1)
    if members > 2:
        one = one - a2 * f2
        storew(factors, at + 16, f2)
    if members > 3:
        one = one - a3 * f3
        storew(factors, at + 24, f3)
    storew(work, base + 8 * row, one)
    for j in range(i):
        other = 8 * rows[j]
        k = 8 * members * j + part
        one = loadw(work, base + other) - a0 * loadw(factors, k)
        if members > 1:
            one = one - a1 * loadw(factors, k + 8)
        if members > 2:
            one = one - a2 * loadw(factors, k + 16)
        if members > 3:
            one = one - a3 * loadw(factors, k + 24)
        storew(work, base + other, one)


@native(fast=True, inline=True)
def _note_growth(members: i64, growth: f64, suspect: f64, known: f64s, state: f64s) -> None:
    """Test the pivots: what D^-1 makes of the largest of C is no less than the largest factor."""
    worst = load8(state, WORST)
    for p in range(members):
        most = load8(known, MOST + 8 * p)
        size = abs8(load8(known, 8 * p))
        high = size * most
        if p > 0:
            high += abs8(load8(known, BESIDE + 8 * p - 8)) * load8(known, MOST + 8 * p - 8)
        if p + 1 < members:
            beside = abs8(load8(known, BESIDE + 8 * p))
            high += beside * load8(known, MOST + 8 * p + 8)
            size = max8(beside, size)
        worst = max8(size * suspect, worst)
        worst = max8(most * high * growth, worst)
    store8(state, WORST, worst)


@native(inline=True)
def _take_rows(
    members: i64, singles: i64, pairs: i64, distance: i64, streamed: i64, count: i64, rows: i32s, sources: i32s,
    work: f64s, known: f64s, factors: f64s, target: f64s,
) -> None:  # fmt: skip
    """Make the factors of all rows and take the members out of them.

    Meanwhile the memory of later factors, ``distance`` ahead, is asked for: to wait for it then takes longer.
    """
    length = members + count
    i = 0
    while i < count:
        at = 8 * members * i
        taken = 2 if i + 1 < count else 1
        if streamed == 0:
            ask_ahead(distance, taken * members, 8, at, factors)
        part = 0
        while part < 8:
            if taken == 2:
                _take_two_rows(
                    part, members, singles, pairs, i, length, rows, sources, work, known, factors
                )  # fmt: skip
            else:
                _take_row(part, members, singles, pairs, i, length, rows, sources, work, known, factors)
            part += wide()
        if streamed != 0:
            put_vectors(1, taken * members, factors[at:], at, target)
        i += taken


@native(inline=True)
def _take(
    members: i64, singles: i64, pairs: i64, distance: i64, streamed: i64, count: i64, kinds: i32s, rows: i32s,
    sources: i32s, growth: f64, suspect: f64, work: f64s, known: f64s, factors: f64s, target: f64s, state: f64s,
) -> None:  # fmt: skip
    """The same as ``take_panel``, for a constant number of members, and for constant ``singles`` and ``pairs``."""
    corner_vectors = panel_vectors(members, 0)
    part = 0
    while part < 8:
        _take_corner(part, members, members + count, kinds, sources, suspect, work, known, factors, state)
        part += wide()
    rest = factors[8 * corner_vectors :]
    _take_rows(
        members, singles, pairs, distance, streamed, count, rows, sources, work, known, rest,
        target[8 * corner_vectors :],
    )  # fmt: skip
    _note_growth(members, growth, suspect, known, state)
    if streamed != 0:
        put_vectors(1, corner_vectors, factors, 0, target)


@native(fast=True)
def take_panel(
    distance: i64, streamed: i64, members: i64, count: i64, kinds: i32s, rows: i32s, sources: i32s, growth: f64,
    suspect: f64, work: f64s, known: f64s, factors: f64s, target: f64s, state: f64s,
) -> None:  # fmt: skip
    """Take the members out of ``work``.

    Args:
        known: KNOWN numbers to work with.
        factors: room for theirs, where they are kept unless they are ``streamed`` to ``target``.
    """
    singles = 1
    for k in range(members):
        if kinds[k] == 2:
            singles = 0
    if members == 4:
        if singles != 0:
            _take(
                4, 1, 0, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
                target, state,
            )  # fmt: skip
        elif kinds[0] == 2 and kinds[2] == 2:
            _take(
                4, 0, 1, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
                target, state,
            )  # fmt: skip
        else:
            _take(
                4, 0, 0, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
                target, state,
            )  # fmt: skip
    elif members == 3:
        if singles != 0:
            _take(
                3, 1, 0, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
                target, state,
            )  # fmt: skip
        else:
            _take(
                3, 0, 0, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
                target, state,
            )  # fmt: skip
    elif members == 2:
        if singles != 0:
            _take(
                2, 1, 0, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
                target, state,
            )  # fmt: skip
        else:
            _take(
                2, 0, 1, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
                target, state,
            )  # fmt: skip
    else:
        _take(
            1, 1, 0, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
            target, state,
        )  # fmt: skip
