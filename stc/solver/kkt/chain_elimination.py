"""Stages of a chain eliminated one after the other, in a window whose places are fixed before.

Unknowns of a stage stand in the window in the opposite order of their elimination, behind those that it leaves to later
stages:

    B   unknowns that couple with every stage
    F   unknowns of the next stage that couple with these
    U   unknowns of the stage, the first one to be eliminated last

Of the window there is the lower triangle, row by row, ``stride`` numbers each.  So whatever a pivot couples with is to
the left of it in its own row, and rows are read and written in blocks of eight numbers.  Pivots are taken in panels of
one, two or four unknowns; D has blocks of one and, for the first or last two of a panel, of two unknowns.

What is right of the diagonal is never read as a number that counts, but is finite where all else is.

Programs are lists of numbers, one for all stages of a kind.  They begin with PROGRAM numbers, places of lists being
counted from there.  Each stage has FIELDS numbers in a table.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native, sqrt
from stc.codegen.native_vector import abs8, expand8, largest8, load8, max8, splat8, store8
from stc.solver.kkt.lane_panel import (
    COUNTED,
    DISTANCE,
    LARGEST,
    ask_ahead,
    is_doubtful,
    is_watched,
    note_watched,
)
from stc.solver.kkt.segmented_passes import DOUBTED_SCALE, REFUSED, STALE, STALE_SCALE
from stc.solver.kkt.values import spread_of

__all__ = [
    "BASE",
    "BLOCK",
    "BLOCKS",
    "BLOCKS_AT",
    "BORDER",
    "CARRIED",
    "CARRIED_TO",
    "CLEARED",
    "CLEARED_AT",
    "CODE",
    "ENTRIES",
    "FACTORS",
    "FIELDS",
    "INSIDE",
    "MATRIX",
    "PANELS",
    "PANELS_AT",
    "PLACES_AT",
    "PROGRAM",
    "RECORD",
    "ROWS",
    "ROWS_AT",
    "SIZE",
    "SOURCES",
    "WHERE",
    "eliminate",
    "entries_at",
    "gather_rows",
    "padded",
    "share_of",
]

#: Numbers that are read and written together.
BLOCK = 8
#: Of a stage: where its program begins, and its unknowns in vectors, the sources of its entries, what is kept of its
#: matrix and its factors.
CODE, BASE, SOURCES, MATRIX, FACTORS, FIELDS = 0, 1, 2, 3, 4, 5
#: Of a program: rows of the window; unknowns of U; where the unknowns of F and U are in vectors, counted from BASE, in
#: the order of the window; ...
SIZE, INSIDE, WHERE = 0, 1, 2
#: ... blocks without entries to be cleared first, by their places in the window; entries off the diagonal; blocks with
#: entries, row by row: the column where each begins, its row, which of its numbers are entries, bit by bit, and the
#: first one of these; rows with blocks, each with how many; ...
CLEARED, CLEARED_AT, ENTRIES, BLOCKS, BLOCKS_AT, ROWS, ROWS_AT = 3, 4, 5, 6, 7, 8, 9
RECORD = 4
#: ... how many rows the stage before has left, and where its triangle goes, entry by entry; ...
CARRIED, CARRIED_TO = 10, 11
#: ... panels: members, 2 where the first two make one pivot, the same of the last two, row of the first member (the
#: others are above), blocks, rows; column of each block, and how many rows have it to the left of their diagonal or on
#: it; for each row, decreasing, where it begins in the window and where its factor is, behind those of the corner.
PANELS, PANELS_AT = 12, 13
#: ... where each panel begins, counted from PANELS_AT, and its factors.
PLACES_AT = 14
#: ... and how many unknowns of B it leaves.
BORDER, PROGRAM = 15, 16
#: Places in ``state``: the largest entries on the diagonal of D^-1 so far, in groups of eight; the largest products due
#: to these, the same; a sum that is finite if all pivots are; negative pivots; the largest entry of D^-1 beside the
#: diagonal; the square of the largest product due to one. Others are as in lane_panel.
INVERSE, PRODUCT, CHECK, NEGATIVE, BESIDE, MIXED = 0, 8, 19, 20, 21, 22
#: Of a panel's factors, behind those of the corner: the first terms of the largest products.
FIRST_PRODUCTS = 12


@native(inline=True)
def share_of(count: i64, parts: i64) -> i64:
    """How many of ``count`` each of some parts takes, but for the last ones."""
    return (count + parts - 1) // parts


@native(inline=True)
def padded(count: i64) -> i64:
    """Room for so many numbers in whole blocks."""
    return share_of(count, BLOCK) * BLOCK


@native(inline=True)
def entries_at(program: i32s) -> i64:
    """Where the entries are in what is kept of a stage: behind the scale and the diagonal."""
    return padded(program[SIZE]) + padded(program[INSIDE])


@native(fast=True, inline=True)
def gather_rows(
    size: i64, border: i64, border_base: i64, base: i64, where: i32s, x: f64s, part: f64s
) -> None:
    """Bring what a vector has for the rows of a window to ``part``."""
    for k in range(border):
        part[k] = x[border_base + k]
    own = x[base:]
    for k in range(border, size):
        part[k] = own[where[k - border]]


@native(fast=True, inline=True)
def _measure(program: i32s, border_base: i64, base: i64, kept: f64s, peaks: f64s, most: f64s) -> None:
    """Raise ``most`` to the largest magnitudes of the rows of a stage; ``peaks`` is room for nine times its rows."""
    size = program[SIZE]
    border = program[BORDER]
    own = program[INSIDE]
    inside = size - own
    where = program[program[WHERE] :]
    by_row = peaks[padded(size + 1) :]
    diagonal = kept[padded(size) :]
    entries = kept[entries_at(program) :]
    for k in range(size):
        peaks[k] = 0.0
        store8(by_row, BLOCK * k, splat8(0.0))
    for k in range(own):
        peaks[inside + k] = fabs(diagonal[k]) * kept[inside + k] * kept[inside + k]
    blocks = program[program[BLOCKS_AT] :]
    for b in range(program[BLOCKS]):
        j = blocks[RECORD * b]
        i = blocks[RECORD * b + 1]
        value = abs8(expand8(entries, blocks[RECORD * b + 3], blocks[RECORD * b + 2]))
        value = value * (load8(kept, j) * kept[i])
        store8(peaks, j, max8(value, load8(peaks, j)))
        store8(by_row, BLOCK * i, max8(value, load8(by_row, BLOCK * i)))
    for k in range(border):
        high_k = max(peaks[k], largest8(load8(by_row, BLOCK * k)))
        most[border_base + k] = max(most[border_base + k], high_k)
    outside = most[base:]
    for k in range(border, size):
        to = where[k - border]
        outside[to] = max(outside[to], max(peaks[k], largest8(load8(by_row, BLOCK * k))))


@native(fast=True)
def _begin(
    stage: i64s, program: i32s, border_base: i64, index: i32s, diagonal: f64s, scale: f64s, kept: f64s
) -> None:
    """Keep the scale and the diagonal of a stage."""
    size = program[SIZE]
    border = program[BORDER]
    base = stage[BASE]
    where = program[program[WHERE] :]
    gather_rows(size, border, border_base, base, where, scale, kept)
    for k in range(size, padded(size)):
        kept[k] = 0.0
    own = kept[padded(size) :]
    inside = size - program[INSIDE]
    unknowns = index[base:]
    for k in range(inside, size):
        own[k - inside] = diagonal[unknowns[where[k - border]]]


@native(small=True)
def _copy(first: i64, last: i64, sources: i32s, given: f64s, entries: f64s) -> None:
    """Copy entries, one by one: gathered in vectors they would take longer."""
    for e in range(first, last):
        entries[e] = given[sources[e]]


@native(fast=True)
def _clear(first: i64, last: i64, cleared: i32s, window: f64s) -> None:
    """Clear blocks of the window."""
    for k in range(first, last):
        store8(window, cleared[k], 0.0)


@native(fast=True)
def _place(
    first: i64, last: i64, blocks: i32s, stride: i64, scales: f64s, entries: f64s, window: f64s
) -> None:
    """Bring scaled entries to the window, block by block."""
    for b in range(first, last):
        j = blocks[RECORD * b]
        i = blocks[RECORD * b + 1]
        value = expand8(entries, blocks[RECORD * b + 3], blocks[RECORD * b + 2])
        store8(window, i * stride + j, value * (load8(scales, j) * scales[i]))


@native(fast=True)
def _complete(program: i32s, stride: i64, kept: f64s, left: f64s, window: f64s) -> None:
    """Bring the diagonal to the window, and what the stage before has left."""
    size = program[SIZE]
    own = kept[padded(size) :]
    inside = size - program[INSIDE]
    for k in range(inside, size):
        window[k * (stride + 1)] = own[k - inside] * kept[k] * kept[k]
    carried = program[CARRIED]
    target = program[program[CARRIED_TO] :]
    for e in range(carried * (carried + 1) // 2):
        window[target[e]] += left[e]


@native(fast=True, inline=True)
def _note_pair(e: f64, square: f64, other_square: f64, state: f64s) -> None:
    """Note the entry beside the diagonal of an inverse, and what it adds, by the largest squares of two rows of C."""
    state[BESIDE] = max(state[BESIDE], fabs(e))
    state[MIXED] = max(state[MIXED], 4.0 * e * e * square * other_square)
    state[CHECK] += e


@native(fast=True)
def _invert_four(panel: i32s, stride: i64, window: f64s, factors: f64s, state: f64s) -> None:
    """L and D^-1 of the corner where four unknowns meet."""
    high = panel[3]
    place = high * (stride + 1)
    a00 = window[place]
    a01 = window[place - 1]
    a02 = window[place - 2]
    a03 = window[place - 3]
    a11 = window[place - stride - 1]
    a12 = window[place - stride - 2]
    a13 = window[place - stride - 3]
    a22 = window[place - 2 * stride - 2]
    a23 = window[place - 2 * stride - 3]
    a33 = window[place - 3 * stride - 3]
    negative = 0.0
    e01 = 0.0
    e23 = 0.0
    l01 = 0.0
    l23 = 0.0
    if panel[1] == 2:
        determinant = a00 * a11 - a01 * a01
        reciprocal = 1.0 / determinant
        d0 = a11 * reciprocal
        d1 = a00 * reciprocal
        e01 = -(a01 * reciprocal)
        l02 = d0 * a02 + e01 * a12
        l03 = d0 * a03 + e01 * a13
        l12 = d1 * a12 + e01 * a02
        l13 = d1 * a13 + e01 * a03
        negative += 1.0 if determinant < 0.0 else (2.0 if a00 < 0.0 else 0.0)
    else:
        # The second pivot is the quotient of two determinants, so that neither division waits for the other.
        d0 = 1.0 / a00
        d1 = a00 / (a00 * a11 - a01 * a01)
        l01 = d0 * a01
        l02 = d0 * a02
        l03 = d0 * a03
        a12 -= l01 * a02
        a13 -= l01 * a03
        l12 = d1 * a12
        l13 = d1 * a13
        negative += (1.0 if d0 < 0.0 else 0.0) + (1.0 if d1 < 0.0 else 0.0)
    a22 -= l02 * a02 + l12 * a12
    a23 -= l02 * a03 + l12 * a13
    a33 -= l03 * a03 + l13 * a13
    if panel[2] == 2:
        determinant = a22 * a33 - a23 * a23
        reciprocal = 1.0 / determinant
        d2 = a33 * reciprocal
        d3 = a22 * reciprocal
        e23 = -(a23 * reciprocal)
        negative += 1.0 if determinant < 0.0 else (2.0 if a22 < 0.0 else 0.0)
    else:
        d2 = 1.0 / a22
        d3 = a22 / (a22 * a33 - a23 * a23)
        l23 = d2 * a23
        negative += (1.0 if d2 < 0.0 else 0.0) + (1.0 if d3 < 0.0 else 0.0)
    factors[0] = d0
    factors[1] = d1
    factors[2] = d2
    factors[3] = d3
    factors[4] = e01
    factors[5] = e23
    factors[6] = l01
    factors[7] = l02
    factors[8] = l03
    factors[9] = l12
    factors[10] = l13
    factors[11] = l23
    factors[FIRST_PRODUCTS] = a01 * a01 + a02 * a02 + a03 * a03
    factors[FIRST_PRODUCTS + 1] = a12 * a12 + a13 * a13
    factors[FIRST_PRODUCTS + 2] = a23 * a23
    state[NEGATIVE] += negative


@native(fused=True)
def _take_four(
    distance: i64, panel: i32s, stride: i64, masks: f64s, window: f64s, factors: f64s, state: f64s
) -> None:  # fmt: skip
    """Take four unknowns out of the window, whose corner is done."""
    high = panel[3]
    d0 = factors[0]
    d1 = factors[1]
    d2 = factors[2]
    d3 = factors[3]
    e01 = factors[4]
    e23 = factors[5]
    l01 = factors[6]
    l02 = factors[7]
    l03 = factors[8]
    l12 = factors[9]
    l13 = factors[10]
    l23 = factors[11]
    blocks = panel[4]
    columns = panel[6:]
    rows = columns[2 * blocks :]
    m0 = splat8(factors[FIRST_PRODUCTS])
    m1 = splat8(factors[FIRST_PRODUCTS + 1])
    m2 = splat8(factors[FIRST_PRODUCTS + 2])
    m3 = splat8(0.0)
    first = columns[0]
    at = high * stride
    # In the first block there may be columns of the panel itself.
    mask = load8(masks, 8 * min(max(high - 3 - first, 0), 8))
    b = 0
    if blocks % 2 == 1:
        c0 = load8(window, at + first) * mask
        c1 = load8(window, at - stride + first) * mask - l01 * c0
        c2 = load8(window, at - 2 * stride + first) * mask - l02 * c0 - l12 * c1
        c3 = load8(window, at - 3 * stride + first) * mask - l03 * c0 - l13 * c1 - l23 * c2
        ask_ahead(distance, 4, 8, 16, factors)
        store8(factors, 16, d0 * c0 + e01 * c1)
        store8(factors, 24, d1 * c1 + e01 * c0)
        store8(factors, 32, d2 * c2 + e23 * c3)
        store8(factors, 40, d3 * c3 + e23 * c2)
        m0 = max8(c0 * c0, m0)
        m1 = max8(c1 * c1, m1)
        m2 = max8(c2 * c2, m2)
        m3 = max8(c3 * c3, m3)
        for r in range(columns[1]):
            to = rows[2 * r] + first
            k = rows[2 * r + 1]
            value = load8(window, to) - factors[k] * c0 - factors[k + 8] * c1
            store8(window, to, value - factors[k + 16] * c2 - factors[k + 24] * c3)
        b = 1
        mask = splat8(1.0)
    while b < blocks:
        # Two blocks at a time: rows have the same factors for both.
        column = columns[2 * b]
        other = columns[2 * b + 2]
        c0 = load8(window, at + column) * mask
        c1 = load8(window, at - stride + column) * mask - l01 * c0
        c2 = load8(window, at - 2 * stride + column) * mask - l02 * c0 - l12 * c1
        c3 = load8(window, at - 3 * stride + column) * mask - l03 * c0 - l13 * c1 - l23 * c2
        o0 = load8(window, at + other)
        o1 = load8(window, at - stride + other) - l01 * o0
        o2 = load8(window, at - 2 * stride + other) - l02 * o0 - l12 * o1
        o3 = load8(window, at - 3 * stride + other) - l03 * o0 - l13 * o1 - l23 * o2
        own = 16 + 32 * b
        ask_ahead(distance, 8, 8, own, factors)
        store8(factors, own, d0 * c0 + e01 * c1)
        store8(factors, own + 8, d1 * c1 + e01 * c0)
        store8(factors, own + 16, d2 * c2 + e23 * c3)
        store8(factors, own + 24, d3 * c3 + e23 * c2)
        store8(factors, own + 32, d0 * o0 + e01 * o1)
        store8(factors, own + 40, d1 * o1 + e01 * o0)
        store8(factors, own + 48, d2 * o2 + e23 * o3)
        store8(factors, own + 56, d3 * o3 + e23 * o2)
        m0 = max8(o0 * o0, max8(c0 * c0, m0))
        m1 = max8(o1 * o1, max8(c1 * c1, m1))
        m2 = max8(o2 * o2, max8(c2 * c2, m2))
        m3 = max8(o3 * o3, max8(c3 * c3, m3))
        both = columns[2 * b + 1]
        for r in range(both):
            to = rows[2 * r]
            k = rows[2 * r + 1]
            f0 = factors[k]
            f1 = factors[k + 8]
            f2 = factors[k + 16]
            f3 = factors[k + 24]
            value = load8(window, to + column) - f0 * c0 - f1 * c1
            beside = load8(window, to + other) - f0 * o0 - f1 * o1
            store8(window, to + column, value - f2 * c2 - f3 * c3)
            store8(window, to + other, beside - f2 * o2 - f3 * o3)
        for r in range(both, columns[2 * b + 3]):
            to = rows[2 * r] + other
            k = rows[2 * r + 1]
            value = load8(window, to) - factors[k] * o0 - factors[k + 8] * o1
            store8(window, to, value - factors[k + 16] * o2 - factors[k + 24] * o3)
        b += 2
        mask = splat8(1.0)
    s0 = fabs(d0)
    s1 = fabs(d1)
    s2 = fabs(d2)
    s3 = fabs(d3)
    if panel[1] == 2:
        _note_pair(e01, largest8(m0), largest8(m1), state)
    if panel[2] == 2:
        _note_pair(e23, largest8(m2), largest8(m3), state)
    inverse = max8(max8(splat8(s0), splat8(s1)), max8(splat8(s2), splat8(s3)))
    store8(state, INVERSE, max8(inverse, load8(state, INVERSE)))
    product = max8(max8(m0 * s0, m1 * s1), max8(m2 * s2, m3 * s3))
    store8(state, PRODUCT, max8(product, load8(state, PRODUCT)))
    state[CHECK] += s0 + s1 + s2 + s3


@native(fast=True)
def _invert_two(panel: i32s, stride: i64, window: f64s, factors: f64s, state: f64s) -> None:
    """The same as ``_invert_four`` for two."""
    high = panel[3]
    place = high * (stride + 1)
    a00 = window[place]
    a01 = window[place - 1]
    a11 = window[place - stride - 1]
    e01 = 0.0
    l01 = 0.0
    if panel[1] == 2:
        determinant = a00 * a11 - a01 * a01
        reciprocal = 1.0 / determinant
        d0 = a11 * reciprocal
        d1 = a00 * reciprocal
        e01 = -(a01 * reciprocal)
        negative = 1.0 if determinant < 0.0 else (2.0 if a00 < 0.0 else 0.0)
    else:
        d0 = 1.0 / a00
        d1 = a00 / (a00 * a11 - a01 * a01)
        l01 = d0 * a01
        negative = (1.0 if d0 < 0.0 else 0.0) + (1.0 if d1 < 0.0 else 0.0)
    factors[0] = d0
    factors[1] = d1
    factors[2] = e01
    factors[3] = l01
    factors[4] = a01 * a01
    state[NEGATIVE] += negative


@native(fused=True)
def _take_two(
    distance: i64, panel: i32s, stride: i64, masks: f64s, window: f64s, factors: f64s, state: f64s
) -> None:  # fmt: skip
    """The same as ``_take_four`` for two."""
    high = panel[3]
    d0 = factors[0]
    d1 = factors[1]
    e01 = factors[2]
    l01 = factors[3]
    blocks = panel[4]
    columns = panel[6:]
    rows = columns[2 * blocks :]
    m0 = splat8(factors[4])
    m1 = splat8(0.0)
    for b in range(blocks):
        column = columns[2 * b]
        at = high * stride + column
        mask = load8(masks, 8 * min(max(high - 1 - column, 0), 8))
        c0 = load8(window, at) * mask
        c1 = load8(window, at - stride) * mask - l01 * c0
        own = 8 + 16 * b
        ask_ahead(distance, 2, 8, own, factors)
        store8(factors, own, d0 * c0 + e01 * c1)
        store8(factors, own + 8, d1 * c1 + e01 * c0)
        m0 = max8(c0 * c0, m0)
        m1 = max8(c1 * c1, m1)
        for r in range(columns[2 * b + 1]):
            to = rows[2 * r] + column
            k = rows[2 * r + 1]
            store8(window, to, load8(window, to) - factors[k] * c0 - factors[k + 8] * c1)
    s0 = fabs(d0)
    s1 = fabs(d1)
    if panel[1] == 2:
        _note_pair(e01, largest8(m0), largest8(m1), state)
    store8(state, INVERSE, max8(max8(splat8(s0), splat8(s1)), load8(state, INVERSE)))
    store8(state, PRODUCT, max8(max8(m0 * s0, m1 * s1), load8(state, PRODUCT)))
    state[CHECK] += s0 + s1


@native(fused=True)
def _take_one(
    distance: i64, panel: i32s, stride: i64, masks: f64s, window: f64s, factors: f64s, state: f64s
) -> None:  # fmt: skip
    """The same for one."""
    high = panel[3]
    d0 = factors[0]
    blocks = panel[4]
    columns = panel[6:]
    rows = columns[2 * blocks :]
    most = splat8(0.0)
    for b in range(blocks):
        column = columns[2 * b]
        c0 = load8(window, high * stride + column) * load8(masks, 8 * min(max(high - column, 0), 8))
        f0 = d0 * c0
        ask_ahead(distance, 1, 0, 8 + 8 * b, factors)
        store8(factors, 8 + 8 * b, f0)
        most = max8(c0 * c0, most)
        for r in range(columns[2 * b + 1]):
            to = rows[2 * r] + column
            store8(window, to, load8(window, to) - factors[rows[2 * r + 1]] * c0)
    store8(state, INVERSE, max8(splat8(fabs(d0)), load8(state, INVERSE)))
    store8(state, PRODUCT, max8(most * fabs(d0), load8(state, PRODUCT)))
    state[NEGATIVE] += 1.0 if d0 < 0.0 else 0.0
    state[CHECK] += fabs(d0)


@native(fast=True, inline=True)
def _take_panels(
    stage: i64s, program: i32s, stride: i64, masks: f64s, window: f64s, factors: f64s, more: i64, following: i64s,
    coming: i32s, border_base: i64, source: i32s, index: i32s, given: f64s, diagonal: f64s, scale: f64s, ahead: f64s,
    beside: f64s, state: f64s,
) -> None:  # fmt: skip
    """Take the unknowns of a stage out of the window, while the ``following`` one comes to that ``beside``.

    It does, but for its diagonal, where there is one ``more``.  A slice of this goes between the corner of each panel
    and its rows: in the first half of the panels entries are copied, in the second one they are brought to the window.
    """
    entries = ahead[entries_at(coming) :]
    sources = source[following[SOURCES] :]
    cleared = coming[coming[CLEARED_AT] :]
    blocks = coming[coming[BLOCKS_AT] :]
    last_clear = more * coming[CLEARED]
    last_copy = more * coming[ENTRIES]
    last_place = more * coming[BLOCKS]
    panels = program[program[PANELS_AT] :]
    places = program[program[PLACES_AT] :]
    count = program[PANELS]
    distance = int(state[DISTANCE])
    half = max(count // 2, 1)
    rest = max(count - half, 1)
    clears = share_of(last_clear, half)
    copies = share_of(last_copy, half)
    placings = share_of(last_place, rest)
    at_clear = 0
    at_copy = 0
    at_place = 0
    for p in range(count):
        panel = panels[places[2 * p] :]
        own = factors[stage[FACTORS] + places[2 * p + 1] :]
        if panel[0] == 4:
            _invert_four(panel, stride, window, own, state)
        elif panel[0] == 2:
            _invert_two(panel, stride, window, own, state)
        else:
            own[0] = 1.0 / window[panel[3] * (stride + 1)]
        if p == 0 and more != 0:
            _begin(following, coming, border_base, index, diagonal, scale, ahead)
        if p < half:
            to_clear = min(at_clear + clears, last_clear)
            to_copy = min(at_copy + copies, last_copy)
            _clear(at_clear, to_clear, cleared, beside)
            _copy(at_copy, to_copy, sources, given, entries)
            at_clear = to_clear
            at_copy = to_copy
        else:
            to_place = min(at_place + placings, last_place)
            _place(at_place, to_place, blocks, stride, ahead, entries, beside)
            at_place = to_place
        if panel[0] == 4:
            _take_four(distance, panel, stride, masks, window, own, state)
        elif panel[0] == 2:
            _take_two(distance, panel, stride, masks, window, own, state)
        else:
            _take_one(distance, panel, stride, masks, window, own, state)
    if count == 0 and more != 0:
        _begin(following, coming, border_base, index, diagonal, scale, ahead)
    _clear(at_clear, last_clear, cleared, beside)
    _copy(at_copy, last_copy, sources, given, entries)
    _place(at_place, last_place, blocks, stride, ahead, entries, beside)


@native(fast=True, inline=True)
def _worst(growth: f64, suspect: f64, state: f64s) -> f64:
    """What the test of all pivots so far is; nan where one of them is not finite."""
    product = largest8(load8(state, PRODUCT)) + sqrt(state[MIXED])
    worst = max(growth * product, suspect * max(largest8(load8(state, INVERSE)), state[BESIDE]))
    return worst + 0.0 * state[CHECK]


@native(fast=True, inline=True)
def _leave(program: i32s, stride: i64, window: f64s, left: f64s) -> None:
    """Take what a stage leaves out of the window."""
    for i in range(program[SIZE] - program[INSIDE]):
        begin = i * (i + 1) // 2
        for j in range(0, i + 1, BLOCK):
            store8(left, begin + j, load8(window, i * stride + j))


@native(fast=True)
def eliminate(
    stages: i64,
    table: i64s,
    code: i32s,
    border: i64,
    border_base: i64,
    stride: i64,
    growth: f64,
    suspect: f64,
    masks: f64s,
    source: i32s,
    index: i32s,
    given: f64s,
    diagonal: f64s,
    scale: f64s,
    left: f64s,
    peaks: f64s,
    matrix: f64s,
    most: f64s,
    windows: f64s,
    factors: f64s,
    state: f64s,
) -> i64:
    """Eliminate all stages.

    Pivots wait for one another; meanwhile the next stage is loaded, into the other one of two windows.

    Args:
        stages, table, code: FIELDS numbers for each stage, and the programs they refer to.
        border, border_base: unknowns of B, and where they are in vectors.
        growth, suspect: pivots are accepted as long as no product that is subtracted exceeds 1 / growth, and no
            entry of D^-1 1 / suspect, in the scaled matrix.
        masks: k ones and 8 - k zeros, for k from 0 to 8.
        source: of each entry in ``given``, stage by stage, in the order of the blocks; index: which unknown is at each
            place of vectors.
        given: entries of the matrix: H, J, p and d; diagonal: that of the matrix, (N,).
        scale, most: of the unknowns, vectors; the latter become the largest entries of all rows.
        left, peaks, windows: work space, the latter for two windows.
        matrix: what is kept of each stage for products with the matrix: the scale of its rows, the diagonal of U,
            the entries in the order of the blocks.
        factors, state: the results.

    Returns:
        0, ``REFUSED`` when a pivot was not accepted, ``STALE_SCALE`` when the scale does not serve the matrix,
        ``DOUBTED_SCALE`` when it was not tested but perhaps does not; ``state[COUNTED]`` becomes the number of negative
        pivots, ``state[LARGEST]`` what the test was.
    """
    for k in range(LARGEST):
        state[k] = 0.0
    state[CHECK] = 0.0
    state[NEGATIVE] = 0.0
    state[BESIDE] = 0.0
    state[MIXED] = 0.0
    watched = is_watched(state)
    if watched != 0:
        for k in range(border_base + border):
            most[k] = 0.0
    for k in range(border * (border + 1) // 2):
        left[k] = 0.0
    first = code[table[CODE] :]
    kept = matrix[table[MATRIX] :]
    entries = kept[entries_at(first) :]
    _begin(table, first, border_base, index, diagonal, scale, kept)
    _clear(0, first[CLEARED], first[first[CLEARED_AT] :], windows)
    _copy(0, first[ENTRIES], source[table[SOURCES] :], given, entries)
    _place(0, first[BLOCKS], first[first[BLOCKS_AT] :], stride, kept, entries, windows)
    for s in range(stages):
        stage = table[s * FIELDS :]
        program = code[stage[CODE] :]
        kept = matrix[stage[MATRIX] :]
        window = windows[s % 2 * stride * stride :]
        _complete(program, stride, kept, left, window)
        more = 1 if s + 1 < stages else 0
        following = table[(s + more) * FIELDS :]
        _take_panels(
            stage, program, stride, masks, window, factors, more, following, code[following[CODE] :], border_base,
            source, index, given, diagonal, scale, matrix[following[MATRIX] :],
            windows[(s + 1) % 2 * stride * stride :], state,
        )  # fmt: skip
        if watched != 0:
            _measure(program, border_base, stage[BASE], kept, peaks, most)
        worst = _worst(growth, suspect, state)
        if not (worst < 1.0):
            return REFUSED
        state[LARGEST] = worst
        _leave(program, stride, window, left)
    state[COUNTED] = state[NEGATIVE]
    if watched != 0:
        spread = spread_of(border_base + border, most)
        note_watched(spread, state)
        return STALE_SCALE if spread > STALE else 0
    return DOUBTED_SCALE if is_doubtful(state) != 0 else 0
