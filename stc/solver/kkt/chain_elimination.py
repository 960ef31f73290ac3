"""Stages of a chain eliminated one after the other, in a window whose places are fixed before.

Unknowns of a stage stand in the window in the opposite order of their elimination, behind those that it leaves to later
stages:

    B   unknowns that couple with every stage
    F   unknowns of the next stage that couple with these
    U   unknowns of the stage, the first one to be eliminated last

Of the window there is the lower triangle, row by row, ``stride`` numbers each.  So whatever a pivot couples with is to
the left of it in its own row, and rows are read and written in blocks of eight numbers.  Pivots are taken in panels
(see stc.solver.kkt.chain_panel).

What is right of the diagonal is never read as a number that counts, but is finite where all else is.

In vectors, too, the unknowns of U follow one another as in the window, stage by stage, and B comes last; there is room
for seven more numbers, which are read but do not count.

Programs are lists of numbers, one for all stages of a kind.  They begin with PROGRAM numbers, places of lists being
counted from there.  Each stage has FIELDS numbers in a table.
"""

from __future__ import annotations

from stc.codegen.calls import invoke
from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native
from stc.codegen.native_vector import abs8, gather8, largest8, load8, masked8, max8, splat8, store8
from stc.solver.kkt.chain_panel import NEGATIVE, begin_tests, invert_corner, take_panel, worst_test
from stc.solver.kkt.lane_state import (
    COUNTED,
    DISTANCE,
    LARGEST,
    STALE,
    STATE,
    WATCHED,
    is_doubtful,
    is_watched,
    note_watched,
    put_together,
)
from stc.solver.kkt.segmented_passes import DOUBTED_SCALE, REFUSED, STALE_SCALE
from stc.solver.kkt.values import raise_to, spread_of

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
    "JOINED",
    "JOINED_TO",
    "MATRIX",
    "OUTER",
    "PANELS",
    "PANELS_AT",
    "PLACES_AT",
    "PROGRAM",
    "RECORD",
    "ROWS",
    "ROWS_AT",
    "SIZE",
    "SOURCES",
    "eliminate",
    "eliminate_run",
    "entries_at",
    "gather_outer",
    "gather_rows",
    "padded",
    "put_own",
    "share_of",
    "take_own",
]

#: Numbers that are read and written together.
BLOCK = 8
#: Of a stage: where its program begins, and its unknowns in vectors, the sources of its entries, what is kept of its
#: matrix and its factors; where in the programs the places of F in vectors are, counted from BASE.
CODE, BASE, SOURCES, MATRIX, FACTORS, OUTER, FIELDS = 0, 1, 2, 3, 4, 5, 6
#: Of a program: rows of the window; unknowns of U, and of B; ...
SIZE, INSIDE, BORDER = 0, 1, 2
#: ... blocks without entries to be cleared first, by their places in the window; entries off the diagonal, with the
#: zeros between those of a block, and behind the last one up to whole vectors; blocks with entries, row by row: the
#: column where each begins, its row, which of its numbers are among these, bit by bit, and where its first number
#: would be; rows with blocks, each with how many; ...
CLEARED, CLEARED_AT, ENTRIES, BLOCKS, BLOCKS_AT, ROWS, ROWS_AT = 3, 4, 5, 6, 7, 8, 9
RECORD = 4
#: ... how many rows the stage before has left, and where its triangle goes, entry by entry; ...
CARRIED, CARRIED_TO = 10, 11
#: ... panels (see stc.solver.kkt.chain_panel); ...
PANELS, PANELS_AT = 12, 13
#: ... where each panel begins, counted from PANELS_AT, and its factors; ...
PLACES_AT = 14
#: ... the same as CARRIED for a second part of the chain that has come to its end.
JOINED, JOINED_TO, PROGRAM = 15, 16, 17


@native(inline=True)
def share_of(count: i64, parts: i64) -> i64:
    """How many of ``count`` each of some parts takes, but for the last ones."""
    return (count + parts - 1) // parts


@native
def padded(count: i64) -> i64:
    """Room for so many numbers in whole blocks."""
    return share_of(count, BLOCK) * BLOCK


@native(inline=True)
def entries_at(program: i32s) -> i64:
    """Where the entries are in what is kept of a stage: behind the scale and the diagonal."""
    return padded(program[SIZE]) + padded(program[INSIDE])


@native(fast=True, inline=True)
def gather_outer(stage: i64s, code: i32s, x: f64s, part: f64s) -> None:
    """Bring what a vector has for B and F to ``part``."""
    program = code[stage[CODE] :]
    outer = code[stage[OUTER] :]
    own = x[stage[BASE] :]
    border = program[BORDER]
    for k in range(border):
        part[k] = x[code[k]]
    for k in range(border, program[SIZE] - program[INSIDE]):
        part[k] = own[outer[k - border]]


@native(inline=True)
def take_own(stage: i64s, code: i32s, x: f64s, part: f64s) -> None:
    """The same for U; up to seven numbers behind change as well."""
    program = code[stage[CODE] :]
    inside = program[SIZE] - program[INSIDE]
    for k in range(0, program[INSIDE], BLOCK):
        store8(part, inside + k, load8(x, stage[BASE] + k))


@native(inline=True)
def put_own(stage: i64s, code: i32s, part: f64s, x: f64s) -> None:
    """The opposite, where nothing else changes."""
    program = code[stage[CODE] :]
    base = stage[BASE]
    count = program[INSIDE]
    inside = program[SIZE] - count
    whole = count // BLOCK * BLOCK
    for k in range(0, whole, BLOCK):
        store8(x, base + k, load8(part, inside + k))
    for k in range(whole, count):
        x[base + k] = part[inside + k]


@native(fast=True, inline=True)
def gather_rows(stage: i64s, code: i32s, x: f64s, part: f64s) -> None:
    """Bring what a vector has for all rows of a window to ``part``; up to seven numbers behind change as well."""
    gather_outer(stage, code, x, part)
    take_own(stage, code, x, part)


@native(fast=True, inline=True)
def _measure(stage: i64s, code: i32s, kept: f64s, peaks: f64s, most: f64s) -> None:
    """Raise ``most`` to the largest magnitudes of the rows of a stage; ``peaks`` is room for nine times its rows."""
    program = code[stage[CODE] :]
    outer = code[stage[OUTER] :]
    base = stage[BASE]
    size = program[SIZE]
    border = program[BORDER]
    own = program[INSIDE]
    inside = size - own
    by_row = peaks[padded(size + 1) :]
    diagonal = kept[padded(size) :]
    entries = kept[entries_at(program) :]
    for k in range(size):
        peaks[k] = 0.0
        store8(by_row, BLOCK * k, splat8(0.0))
    for k in range(own):
        peaks[inside + k] = fabs(diagonal[k]) * kept[inside + k] * kept[inside + k]
    blocks = program[program[BLOCKS_AT] :]
    rows = program[program[ROWS_AT] :]
    b = 0
    for r in range(program[ROWS]):
        i = rows[2 * r]
        end = b + rows[2 * r + 1]
        scale_i = kept[i]
        high = splat8(0.0)
        while b < end:
            j = blocks[RECORD * b]
            value = abs8(masked8(entries, blocks[RECORD * b + 3], blocks[RECORD * b + 2]))
            value = value * (load8(kept, j) * scale_i)
            store8(peaks, j, max8(value, load8(peaks, j)))
            high = max8(value, high)
            b += 1
        store8(by_row, BLOCK * i, high)
    for k in range(border):
        high_k = max(peaks[k], largest8(load8(by_row, BLOCK * k)))
        most[code[k]] = max(most[code[k]], high_k)
    beyond = most[base:]
    for k in range(border, inside):
        to = outer[k - border]
        beyond[to] = max(beyond[to], max(peaks[k], largest8(load8(by_row, BLOCK * k))))
    for k in range(inside, size):
        to = base + k - inside
        most[to] = max(most[to], max(peaks[k], largest8(load8(by_row, BLOCK * k))))


@native(fast=True, short=True)
def _begin(stage: i64s, code: i32s, index: i32s, diagonal: f64s, scale: f64s, kept: f64s) -> None:
    """Keep the scale and the diagonal of a stage."""
    program = code[stage[CODE] :]
    size = program[SIZE]
    gather_rows(stage, code, scale, kept)
    for k in range(size, padded(size)):
        kept[k] = 0.0
    own = kept[padded(size) :]
    for k in range(0, program[INSIDE], BLOCK):
        store8(own, k, gather8(diagonal, index, stage[BASE] + k))


@native(fast=True, short=True)
def _copy(first: i64, last: i64, sources: i32s, given: f64s, entries: f64s) -> None:
    """Copy entries, whole blocks of them."""
    for e in range(first, last, BLOCK):
        store8(entries, e, gather8(given, sources, e))


@native(fast=True, short=True)
def _clear(first: i64, last: i64, cleared: i32s, window: f64s) -> None:
    """Clear blocks of the window."""
    for k in range(first, last):
        store8(window, cleared[k], 0.0)


@native(fast=True, short=True)
def _place(
    first: i64, last: i64, blocks: i32s, stride: i64, scales: f64s, entries: f64s, window: f64s
) -> None:
    """Bring scaled entries to the window, block by block."""
    for b in range(first, last):
        j = blocks[RECORD * b]
        i = blocks[RECORD * b + 1]
        value = masked8(entries, blocks[RECORD * b + 3], blocks[RECORD * b + 2])
        store8(window, i * stride + j, value * (load8(scales, j) * scales[i]))


@native(fast=True, short=True)
def _complete(program: i32s, stride: i64, kept: f64s, left: f64s, joined: f64s, window: f64s) -> None:
    """Bring the diagonal to the window, and what the stage before has left, and a second part that ends there."""
    size = program[SIZE]
    own = kept[padded(size) :]
    inside = size - program[INSIDE]
    for k in range(inside, size):
        window[k * (stride + 1)] = own[k - inside] * kept[k] * kept[k]
    carried = program[CARRIED]
    target = program[program[CARRIED_TO] :]
    for e in range(carried * (carried + 1) // 2):
        window[target[e]] += left[e]
    second = program[JOINED]
    target = program[program[JOINED_TO] :]
    for e in range(second * (second + 1) // 2):
        window[target[e]] += joined[e]


@native(fast=True, inline=True)
def _take_panels(
    stage: i64s, code: i32s, stride: i64, masks: f64s, window: f64s, factors: f64s, more: i64, following: i64s,
    source: i32s, index: i32s, given: f64s, diagonal: f64s, scale: f64s, ahead: f64s, beside: f64s, state: f64s,
) -> None:  # fmt: skip
    """Take the unknowns of a stage out of the window, while the ``following`` one comes to that ``beside``.

    It does, but for its diagonal, where there is one ``more``.  A slice of this goes between the corner of each panel
    and its rows: in the first half of the panels entries are copied, in the second one they are brought to the window.
    """
    program = code[stage[CODE] :]
    coming = code[following[CODE] :]
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
    copies = padded(share_of(last_copy, half))
    placings = share_of(last_place, rest)
    at_clear = 0
    at_copy = 0
    at_place = 0
    for p in range(count):
        panel = panels[places[2 * p] :]
        own = factors[stage[FACTORS] + places[2 * p + 1] :]
        invert_corner(panel, stride, window, own, state)
        if p == 0 and more != 0:
            _begin(following, code, index, diagonal, scale, ahead)
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
        take_panel(distance, panel, stride, masks, window, own, state)
    if count == 0 and more != 0:
        _begin(following, code, index, diagonal, scale, ahead)
    _clear(at_clear, last_clear, cleared, beside)
    _copy(at_copy, last_copy, sources, given, entries)
    _place(at_place, last_place, blocks, stride, ahead, entries, beside)


@native(fast=True, inline=True)
def _leave(program: i32s, stride: i64, window: f64s, left: f64s) -> None:
    """Take what a stage leaves out of the window."""
    for i in range(program[SIZE] - program[INSIDE]):
        begin = i * (i + 1) // 2
        for j in range(0, i + 1, BLOCK):
            store8(left, begin + j, load8(window, i * stride + j))


@native(fast=True, short=True)
def eliminate_run(
    stages: i64,
    table: i64s,
    code: i32s,
    index: i32s,
    stride: i64,
    growth: f64,
    suspect: f64,
    masks: f64s,
    source: i32s,
    given: f64s,
    diagonal: f64s,
    scale: f64s,
    cleared: i64,
    joined: f64s,
    left: f64s,
    peaks: f64s,
    matrix: f64s,
    size: i64,
    most: f64s,
    windows: f64s,
    factors: f64s,
    state: f64s,
) -> None:
    """Eliminate stages that follow one another; ``state[COUNTED]`` becomes the negative pivots, -1 if one is refused.

    Pivots wait for one another; meanwhile the next stage is loaded, into the other one of two windows.

    Args:
        stages, table, code: FIELDS numbers for each stage, and the places of B in vectors, then the programs, that
            stages refer to.
        index: which unknown is at each place of vectors.
        growth, suspect: pivots are accepted as long as no product that is subtracted exceeds 1 / growth, and no
            entry of D^-1 1 / suspect, in the scaled matrix.
        masks: k ones and 8 - k zeros, for k from 0 to 8.
        source: of each entry in ``given``, where there is a zero as well, stage by stage, in the order of the blocks.
        given: entries of the matrix: H, J, p and d; diagonal: that of the matrix, (N,).
        scale: a vector.
        cleared: so many numbers of ``left``, what these stages leave, are cleared first; else it has what was left
            before; joined: what a second part has left.
        peaks, windows: work space, the latter for two windows.
        matrix: what is kept of each stage for products with the matrix: the scale of its rows, the diagonal of U,
            the entries in the order of the blocks.
        size, most: numbers of ``most`` that are cleared first; where ``state[WATCHED]``, it is raised to the largest
            entries of rows, a vector.
        factors, state: the results.
    """
    begin_tests(state)
    watched = int(state[WATCHED])
    if watched != 0:
        for k in range(size):
            most[k] = 0.0
    for k in range(cleared):
        left[k] = 0.0
    first = code[table[CODE] :]
    kept = matrix[table[MATRIX] :]
    entries = kept[entries_at(first) :]
    _begin(table, code, index, diagonal, scale, kept)
    _clear(0, first[CLEARED], first[first[CLEARED_AT] :], windows)
    _copy(0, first[ENTRIES], source[table[SOURCES] :], given, entries)
    _place(0, first[BLOCKS], first[first[BLOCKS_AT] :], stride, kept, entries, windows)
    for s in range(stages):
        stage = table[s * FIELDS :]
        program = code[stage[CODE] :]
        kept = matrix[stage[MATRIX] :]
        window = windows[s % 2 * stride * stride :]
        _complete(program, stride, kept, left, joined, window)
        more = 1 if s + 1 < stages else 0
        following = table[(s + more) * FIELDS :]
        _take_panels(
            stage, code, stride, masks, window, factors, more, following, source, index, given, diagonal, scale,
            matrix[following[MATRIX] :], windows[(s + 1) % 2 * stride * stride :], state,
        )  # fmt: skip
        if watched != 0:
            _measure(stage, code, kept, peaks, most)
        worst = worst_test(growth, suspect, state)
        if not (worst < 1.0):
            state[COUNTED] = -1.0
            return
        state[LARGEST] = worst
        _leave(program, stride, window, left)
    state[COUNTED] = state[NEGATIVE]


@native(fast=True)
def _take_scale(size: i64, places: i32s, scale: f64s, own_scale: f64s) -> None:
    """The scale in the order of vectors."""
    for k in range(size):
        own_scale[k] = scale[places[k]]


@native(shared=True)
def eliminate(
    calls: i64s,
    place: i64,
    runs: i64,
    states: f64s,
    other_most: f64s,
    size: i64,
    places: i32s,
    scale: f64s,
    own_scale: f64s,
    most: f64s,
    state: f64s,
) -> i64:
    """Eliminate all stages.

    Args:
        calls, place: where ``eliminate_run`` of the parts of the chain is among the prepared calls, and behind it the
            run of what comes after them.
        runs: 1, or 3 where there are two parts and something behind; states: of each run.
        other_most: what is ``most`` to the second part.
        size: N; places: where ``scale`` (N,) has that of each place of vectors; own_scale becomes the vector.
        most: becomes the largest entries of all rows, a vector.

    Returns:
        0, ``REFUSED`` when a pivot was not accepted, ``STALE_SCALE`` when the scale does not serve the matrix,
        ``DOUBTED_SCALE`` when it was not tested but perhaps does not; ``state[COUNTED]`` becomes the number of negative
        pivots, ``state[LARGEST]`` what the test was.
    """
    _take_scale(size, places, scale, own_scale)
    watched = is_watched(state)
    for run in range(runs):
        states[run * STATE + WATCHED] = 1.0 * watched
        states[run * STATE + COUNTED] = 0.0
    invoke(calls, place)
    if runs > 1:
        if states[COUNTED] < 0.0 or states[STATE + COUNTED] < 0.0:
            return REFUSED
        if watched != 0:
            raise_to(size, other_most, most)
        invoke(calls, place + 1)
    if put_together(runs, states, state) != 0:
        return REFUSED
    if watched != 0:
        spread = spread_of(size, most)
        note_watched(spread, state)
        return STALE_SCALE if spread > STALE else 0
    return DOUBTED_SCALE if is_doubtful(state) != 0 else 0
