"""One panel of pivots taken out of eight segments at once (see stc.solver.kkt.lanes).

    C   members x (members + rows), what is left of their columns
    L   D^-1 C, the factors, which are kept             work[rows, rows] -= C^T L

The triangle's entry (i, j), i >= j, of all eight lanes is at ``work[8 (i (i + 1) / 2 + j)]``.  All that is kept of a
panel are the corner, members x members of L, and then the rest of L, the factors of one row after those of another.  Of
the corner there is the upper triangle, row by row: D^-1 on the diagonal, and beside it the other entry of D^-1 where a
pivot has two unknowns, which have no factor there.

The corner comes first (``lane_corner``).  The rest of C is made in registers, of two rows at a time, and so are their
factors; both rows are updated at once, each up to its diagonal, while their C is there.  So nothing but the triangle
and the factors goes through memory.  Where a register holds four numbers, four lanes take their turn with two rows,
then the other four: the vectors of eight would not fit.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, i32s, i64, native
from stc.codegen.native_vector import abs8, absw, load8, loadw, max8, maxw, store8, storew, wide
from stc.solver.kkt.lane_corner import BESIDE, CORNER, KNOWN, MOST, take_corner
from stc.solver.kkt.lane_memory import ask_ahead, put_vectors
from stc.solver.kkt.lane_state import WORST

__all__ = ["KNOWN", "PANEL", "panel_vectors", "take_panel"]

#: Unknowns of a panel at most.
PANEL = 4


@native
def panel_vectors(members: i64, count: i64) -> i64:
    """How many vectors are kept of a panel."""
    return members * (members + 1) // 2 + members * count


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
        known: what ``take_corner`` has left, where the largest entries of C are raised.
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
        take_corner(part, members, members + count, kinds, sources, suspect, work, known, factors, state)
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
