"""Eight segments of the horizon eliminated at once, one in each lane of the vectors, stage by stage.

All lanes take the same pivots in the same order, fixed before.  What is in work is a dense lower triangle of vectors,
row by row: entry (i, j), i >= j, of all eight lanes is at ``work[8 (i (i + 1) / 2 + j)]``.  Its rows are, in order,

    U   unknowns of the stage, which are all eliminated
    F   unknowns of the next stage that couple with these
    L   states of the seam before the segment (see stc.solver.kkt.seams), which couple with its first stage
    B   unknowns that couple with every stage

and F becomes part of the next step's U.  Pivots are taken in panels of unknowns that share their rows.

In ``code``, a panel is: how many members, how many rows; for each member 1, 2 for the first of a pair or 0 for the
second; the members; the rows, increasing; where C is in the triangle, member by member.

What belongs to a group of eight segments is found by way of a table, FIELDS numbers for each group.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, i32s, i64, i64s, native
from stc.codegen.native_vector import (
    abs8,
    gather8,
    largest8,
    load8,
    max8,
    negative8,
    prefetch8,
    splat8,
    store8,
    stream8,
    sum8,
)
from stc.solver.kkt.lane_memory import ask_ahead
from stc.solver.kkt.lane_panel import panel_vectors, take_panel
from stc.solver.kkt.lane_runs import RUN, bring_entries
from stc.solver.kkt.lane_state import (
    CHECK,
    DISTANCE,
    FETCHED,
    LARGEST,
    NEGATIVE,
    STALE,
    STREAMED,
    WORST,
    spread_in,
)

__all__ = [
    "FIELDS",
    "RUNS",
    "ask_for_step",
    "collect_ends",
    "collect_following",
    "collect_own",
    "eliminate",
    "note_outside",
]

#: The numbers of a group: how many steps; unknowns of U, of F, L and B; ...
STEPS, OWN, NEXT, LEFT, BORDER = range(5)
#: ... where the unknowns of U begin in vectors, step by step, eight for each place; where in vectors those of the last
#: step's F are, as listed in ``index``, and, right behind them there, of L and B; ...
UNKNOWNS, LASTS, ENDS = 5, 6, 7
#: ... entries of a stage: how many (of which the first ADDED are added to what is carried over, the others stored
#: there), where the sources of each step are listed in ``index``, and where the places of
#: one step, three numbers each (entry, and its row and column in any order, the first the same for many entries in a
#: row), in ``code``; the same for those of L with the first stage; ...
ENTRIES, ENTRY_INDEX, ENTRY_CODE = 8, 9, 10
FIRST, FIRST_INDEX, FIRST_CODE = 11, 12, 13
#: ... panels, and where they are in ``code``; entries to be cleared before each step, before the first step, and those
#: that move (from, to); ...
PANELS, PANEL_CODE, CLEARED, CLEARED_CODE, EMPTY, EMPTY_CODE, MOVED, MOVED_CODE = range(14, 22)
#: ... what is left at the end: how many entries, which, and where each lane's go (targets); ...
RESULTS, RESULT_CODE, RESULT_INDEX = 22, 23, 24
#: ... where factors begin and how many vectors a step has; segments, the other lanes being copies of the first; where
#: the places of F in the next step's U, and the places of the panels in ``code``, are listed in ``code``; where the
#: scaled entries begin: those of L with the first stage, then the diagonal and the entries of each step; ...
FACTORS, FACTOR_STEP, SEGMENTS, FOLLOWING, PANEL_STARTS, MATRIX, ADDED = 25, 26, 27, 28, 29, 30, 31
#: ... where ``index`` has the runs of the entries (see stc.solver.kkt.lane_runs), 0 where each step loads its own.
RUNS = 32
FIELDS = 33
#: Entries of the matrix are asked for so many steps ahead; a line of memory has those of a lane for so many or more.
STEPS_AHEAD = 8
STEPS_OF_LINE = 4
#: Magnitudes below this are zeros.
NOTHING = 1e-300


@native(fast=True, inline=True)
def collect_own(step: i64, group: i64s, x: f64s, part: f64s) -> None:
    """Copy what a vector has for a step's U to ``part``."""
    own = group[OWN]
    here = group[UNKNOWNS] + 8 * step * own
    for k in range(own):
        store8(part, 8 * k, load8(x, here + 8 * k))


@native(fast=True, inline=True)
def collect_following(step: i64, group: i64s, index: i32s, code: i32s, x: f64s, part: f64s) -> None:
    """Copy what a vector has for a step's F to ``part``."""
    own = group[OWN]
    if step < group[STEPS] - 1:
        after = group[UNKNOWNS] + 8 * (step + 1) * own
        following = code[group[FOLLOWING] :]
        for k in range(group[NEXT]):
            store8(part, 8 * (own + k), load8(x, after + 8 * following[k]))
    else:
        lasts = index[group[LASTS] :]
        for k in range(group[NEXT]):
            store8(part, 8 * (own + k), gather8(x, lasts, 8 * k))


@native(fast=True, inline=True)
def collect_ends(group: i64s, index: i32s, x: f64s, part: f64s) -> None:
    """Copy what a vector has for L and B to ``part``."""
    near = group[OWN] + group[NEXT]
    outer = index[group[ENDS] :]
    for k in range(group[LEFT] + group[BORDER]):
        store8(part, 8 * (near + k), gather8(x, outer, 8 * k))


@native(fast=True, inline=True)
def note_outside(group: i64s, index: i32s, part: f64s, most: f64s) -> None:
    """Raise what a vector has for the last F, L and B to what is in ``part``."""
    own = group[OWN]
    outside = index[group[LASTS] :]
    for lane in range(group[SEGMENTS]):
        for k in range(group[NEXT] + group[LEFT] + group[BORDER]):
            at = outside[8 * k + lane]
            most[at] = max(most[at], part[8 * (own + k) + lane])


@native(fast=True, inline=True)
def _load_entries(
    distance: i64, streamed: i64, watched: i64, added: i64, brought: i64, count: i64, sources: i32s, places: i32s,
    given: f64s, ring: f64s, scales: f64s, matrix: f64s, most: f64s, work: f64s, state: f64s,
) -> None:  # fmt: skip
    """Add or store scaled entries in the triangle, keep them, and note their magnitudes in both of their rows.

    And note in ``state`` whether they are finite: pivots need not tell.  They are in ``ring`` where they have been
    ``brought``.
    """
    check = load8(state, CHECK)
    i = 0
    scale_i = load8(scales, 0)
    most_i = load8(most, 0)
    for k in range(count):
        if 8 * places[3 * k + 1] != i:
            if watched != 0:
                store8(most, i, most_i)
            i = 8 * places[3 * k + 1]
            scale_i = load8(scales, i)
            if watched != 0:
                most_i = load8(most, i)
        j = 8 * places[3 * k + 2]
        value = splat8(0.0)
        if brought != 0:
            value = load8(ring, 8 * k)
        else:
            value = gather8(given, sources, 8 * k)
        value = value * scale_i * load8(scales, j)
        check += value * 0.0
        if streamed != 0:
            stream8(matrix, 8 * k, value)
        else:
            store8(matrix, 8 * k, value)
            ask_ahead(distance, 1, 0, 8 * k, matrix)
        at = 8 * places[3 * k]
        if added != 0:
            store8(work, at, load8(work, at) + value)
        else:
            store8(work, at, value)
        if watched != 0:
            size = abs8(value)
            most_i = max8(size, most_i)
            store8(most, j, max8(size, load8(most, j)))
    if watched != 0:
        store8(most, i, most_i)
    store8(state, CHECK, check)


@native(fast=True, inline=True)
def _watch_step(step: i64, group: i64s, following: i32s, most: f64s, spread: f64s) -> None:
    """Note how far the largest entries of a step's own rows are from 1, and carry over the others."""
    own = group[OWN]
    high = load8(spread, 0)
    low = load8(spread, 8)
    for k in range(own):
        size = load8(most, 8 * k)
        size += negative8(size - NOTHING)
        high = max8(high, size)
        low = max8(low, -size)
        store8(most, 8 * k, 0.0)
    store8(spread, 0, high)
    store8(spread, 8, low)
    if step < group[STEPS] - 1:
        for k in range(group[NEXT]):
            store8(most, 8 * following[k], load8(most, 8 * (own + k)))
            store8(most, 8 * (own + k), 0.0)


@native(fast=True, inline=True)
def ask_for_step(
    step: i64, group: i64s, index: i32s, diagonal: f64s, given: f64s
) -> None:  # fmt: skip
    """Ask for the entries of a later step; some lanes take their turn with each step, since lines last for several."""
    if step + STEPS_AHEAD < group[STEPS]:
        own = group[OWN]
        count = group[ENTRIES]
        lane = 8 // STEPS_OF_LINE * (step % STEPS_OF_LINE)
        sources = index[group[ENTRY_INDEX] + 8 * (step + STEPS_AHEAD) * count + lane :]
        diagonals = index[group[UNKNOWNS] + 8 * (step + STEPS_AHEAD) * own + lane :]
        for turn in range(8 // STEPS_OF_LINE):
            for k in range(count):
                prefetch8(given, sources[8 * k + turn])
            for k in range(own):
                prefetch8(diagonal, diagonals[8 * k + turn])


@native(fast=True)
def _load_step(
    distance: i64, streamed: i64, fetched: i64, watched: i64, step: i64, group: i64s, index: i32s, code: i32s,
    diagonal: f64s, given: f64s, ring: f64s, scale: f64s, work: f64s, scales: f64s, matrix: f64s, most: f64s,
    spread: f64s, state: f64s,
) -> None:  # fmt: skip
    """Carry over what the step before has left, and add the scaled entries of the matrix."""
    own = group[OWN]
    near = own + group[NEXT]
    ends = group[LEFT] + group[BORDER]
    here = group[UNKNOWNS] + 8 * step * own
    following = code[group[FOLLOWING] :]
    cleared = code[group[CLEARED_CODE] :]
    for k in range(group[CLEARED]):
        store8(work, 8 * cleared[k], 0.0)
    collect_own(step, group, scale, scales)
    collect_following(step, group, index, code, scale, scales)
    kept = matrix[8 * group[MATRIX] :]
    if step > 0:
        moved = code[group[MOVED_CODE] :]
        for k in range(group[MOVED]):
            left = 8 * moved[2 * k]
            store8(work, 8 * moved[2 * k + 1], load8(work, left))
            store8(work, left, 0.0)
    else:
        empty = code[group[EMPTY_CODE] :]
        for k in range(group[EMPTY]):
            store8(work, 8 * empty[k], 0.0)
        collect_ends(group, index, scale, scales)
        for k in range(near + ends):
            store8(most, 8 * k, 0.0)
        _load_entries(
            distance,
            streamed,
            watched,
            1,
            0,
            group[FIRST],
            index[group[FIRST_INDEX] :],
            code[group[FIRST_CODE] :],
            given,
            ring,
            scales,
            kept,
            most,
            work,
            state,
        )
    if fetched != 0:
        ask_for_step(step, group, index, diagonal, given)
    count = group[ENTRIES]
    kept = kept[8 * (group[FIRST] + step * (own + count)) :]
    diagonals = index[here:]
    for k in range(own):
        s = load8(scales, 8 * k)
        value = s * s * gather8(diagonal, diagonals, 8 * k)
        if streamed != 0:
            stream8(kept, 8 * k, value)
        else:
            store8(kept, 8 * k, value)
            ask_ahead(distance, 1, 0, 8 * k, kept)
        at = 4 * k * (k + 3)
        store8(work, at, load8(work, at) + value)
        if watched != 0:
            store8(most, 8 * k, max8(abs8(value), load8(most, 8 * k)))
    added = group[ADDED]
    sources = index[group[ENTRY_INDEX] + 8 * step * count :]
    places = code[group[ENTRY_CODE] :]
    kept = kept[8 * own :]
    if group[RUNS] > 0:
        bring_entries(
            step, group[STEPS], count, index[group[RUNS] :], index[group[ENTRY_INDEX] :], given, ring
        )
        own_ring = ring[8 * count * (step % RUN) :]
        _load_entries(
            distance, streamed, watched, 1, 1, added, sources, places, given, own_ring, scales, kept, most, work, state
        )  # fmt: skip
        _load_entries(
            distance, streamed, watched, 0, 1, count - added, sources, places[3 * added :], given,
            own_ring[8 * added :], scales, kept[8 * added :], most, work, state,
        )  # fmt: skip
    else:
        _load_entries(
            distance, streamed, watched, 1, 0, added, sources, places, given, ring, scales, kept, most, work, state
        )  # fmt: skip
        _load_entries(
            distance, streamed, watched, 0, 0, count - added, sources[8 * added :], places[3 * added :], given, ring,
            scales, kept[8 * added :], most, work, state,
        )  # fmt: skip
    if watched != 0:
        _watch_step(step, group, following, most, spread)


@native(fast=True)
def eliminate(
    groups: i64,
    table: i64s,
    index: i32s,
    code: i32s,
    growth: f64,
    suspect: f64,
    given: f64s,
    ring: f64s,
    diagonal: f64s,
    scale: f64s,
    result: f64s,
    work: f64s,
    scales: f64s,
    known: f64s,
    made: f64s,
    matrix: f64s,
    watched: i64,
    most: f64s,
    outer_most: f64s,
    spread: f64s,
    factors: f64s,
    state: f64s,
) -> i64:
    """Eliminate all segments.

    Args:
        groups, table: how many groups of segments, FIELDS numbers for each.
        index, code: what the table refers to; ``code`` is shared by groups of one kind.
        growth, suspect: pivots are accepted as long as no product that is subtracted exceeds 1 / growth, and no
            entry of D^-1 1 / suspect, in the scaled matrix.
        given: entries of the matrix: H, J, p and d; diagonal: that of the matrix, (N,).
        scale: of the unknowns, a vector in the order of the segments, and so is ``outer_most``: largest entries so
            far of the rows outside of segments, which are updated.
        result: where the entries are added that are left, as ``index`` tells.
        work, scales, known, most: work space; made: the same, for the factors of a panel; ring: the same, for the
            entries of RUN steps.
        matrix: the scaled entries, for products with the matrix.
        watched: 1 where ``outer_most`` and ``spread`` are asked for.
        spread: largest entry of the row that has the largest one, and the negative of the least, of the rows in
            segments: the maximum with what is there, eight of each.
        factors: the factors; ``state``: see stc.solver.kkt.lane_state.

    Returns:
        How many pivots are negative, -1 when one was not accepted, an entry is not finite or ``scale`` has turned out
        not to serve.
    """
    negative = 0.0
    distance = int(state[DISTANCE])
    streamed = int(state[STREAMED])
    fetched = int(state[FETCHED])
    writing = 0 if streamed != 0 else distance
    state[LARGEST] = 0.0
    store8(state, CHECK, splat8(0.0))
    for g in range(groups):
        group = table[g * FIELDS :]
        for k in range(LARGEST):
            state[k] = 0.0
        at = 8 * group[FACTORS]
        for step in range(group[STEPS]):
            _load_step(
                distance, streamed, fetched, watched, step, group, index, code, diagonal, given, ring, scale, work,
                scales, matrix, most, spread, state,
            )  # fmt: skip
            panel = code[group[PANEL_CODE] :]
            for _panel in range(group[PANELS]):
                members = panel[0]
                count = panel[1]
                rows = panel[2 + 2 * members :]
                kept = factors[at:]
                if streamed != 0:
                    kept = made[0:]
                take_panel(
                    writing, streamed, members, count, panel[2:], rows, rows[count:], growth, suspect, work, known,
                    kept, factors[at:], state,
                )  # fmt: skip
                panel = rows[count + members * (members + count) :]
                at += 8 * panel_vectors(members, count)
            if not (largest8(load8(state, WORST)) < 1.0):
                return -1
        if sum8(load8(state, CHECK)) != 0.0 or (watched != 0 and spread_in(spread) > STALE):
            return -1  # what is left would be in vain
        state[LARGEST] = max(state[LARGEST], largest8(load8(state, WORST)))
        for lane in range(group[SEGMENTS]):
            negative += state[NEGATIVE + lane]
            places = code[group[RESULT_CODE] :]
            targets = index[group[RESULT_INDEX] :]
            for k in range(group[RESULTS]):
                target = targets[8 * k + lane]
                value = work[8 * places[k] + lane]
                if target >= 0:
                    result[target] += value
                else:
                    result[-1 - target] -= value
        if watched != 0:
            note_outside(group, index, most, outer_most)
    return int(negative)
