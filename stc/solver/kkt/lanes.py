"""Eight segments of the horizon eliminated at once, one in each lane of the vectors, stage by stage.

All lanes take the same pivots in the same order, fixed before.  What is in work is a dense lower triangle of vectors,
row by row: entry (i, j), i >= j, of all eight lanes is at ``work[8 (i (i + 1) / 2 + j)]``.  Its rows are, in order,

    U   unknowns of the stage, which are all eliminated
    F   unknowns of the next stage that couple with these
    L   unknowns before the segment that couple with its first stage
    B   unknowns that couple with every stage

and F becomes part of the next step's U.  Pivots are taken in panels of unknowns that share their rows.

In ``code``, a panel is: how many members, how many rows; for each member 1, 2 for the first of a pair or 0 for the
second; the members; the rows, increasing; where C is in the triangle, member by member.

What belongs to a group of eight segments is found by way of a table, FIELDS numbers for each group.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, i32s, i64, i64s, native
from stc.codegen.native_vector import gather8, largest8, load8, store8
from stc.solver.kkt.lane_panel import LARGEST, NEGATIVE, WORST, take_panel

__all__ = ["FIELDS", "eliminate"]

#: The numbers of a group: how many steps; unknowns of U, variables among these, of F, L and B; ...
STEPS, OWN, VARIABLES, NEXT, LEFT, BORDER = range(6)
#: ... where the unknowns of U and F of each step are listed in ``index``, eight for each place; those of L and B; ...
UNKNOWNS, ENDS = 6, 7
#: ... entries of a stage: how many, where the sources of each step are listed in ``index``, and where the places of
#: one step, three numbers each (entry, row and column), in ``code``; the same for those of L with the first stage; the
#: same for entries of H on the diagonal, their places being single numbers; ...
ENTRIES, ENTRY_INDEX, ENTRY_CODE = 8, 9, 10
FIRST, FIRST_INDEX, FIRST_CODE = 11, 12, 13
CURVED, CURVED_INDEX, CURVED_CODE = 14, 15, 16
#: ... panels, and where they are in ``code``; entries to be cleared before each step, before the first step, and those
#: that move (from, to); ...
PANELS, PANEL_CODE, CLEARED, CLEARED_CODE, EMPTY, EMPTY_CODE, MOVED, MOVED_CODE = range(17, 25)
#: ... what is left at the end: how many entries, which, and where each lane's go (targets); ...
RESULTS, RESULT_CODE, RESULT_INDEX = 25, 26, 27
#: ... where factors begin and how many vectors a step has; segments, the other lanes being copies of the first; where
#: the places of F in the next step's U, and the places of the panels in ``code``, are listed in ``code``.
FACTORS, FACTOR_STEP, SEGMENTS, FOLLOWING, PANEL_STARTS = 28, 29, 30, 31, 32
FIELDS = 33


@native(fast=True)
def _load_step(
    step: i64, group: i64s, index: i32s, code: i32s, diagonal: i64, given: f64s, scale: f64s, work: f64s,
    scales: f64s, moving: f64s,
) -> None:  # fmt: skip
    """Carry over what the step before has left, and add the scaled entries of the matrix."""
    own = group[OWN]
    near = own + group[NEXT]
    moved = code[group[MOVED_CODE] :]
    if step > 0:
        for k in range(group[MOVED]):
            store8(moving, 8 * k, load8(work, 8 * moved[2 * k]))
    cleared = code[group[CLEARED_CODE] :]
    for k in range(group[CLEARED]):
        store8(work, 8 * cleared[k], 0.0)
    if step > 0:
        for k in range(group[MOVED]):
            store8(work, 8 * moved[2 * k + 1], load8(moving, 8 * k))
    else:
        empty = code[group[EMPTY_CODE] :]
        for k in range(group[EMPTY]):
            store8(work, 8 * empty[k], 0.0)
        ends = index[group[ENDS] :]
        for k in range(group[LEFT] + group[BORDER]):
            store8(scales, 8 * (near + k), gather8(scale, ends, 8 * k))
    unknowns = index[group[UNKNOWNS] + 8 * step * near :]
    for k in range(near):
        store8(scales, 8 * k, gather8(scale, unknowns, 8 * k))
    diagonals = given[diagonal:]
    for k in range(own):
        s = load8(scales, 8 * k)
        value = s * s * gather8(diagonals, unknowns, 8 * k)
        at = 4 * k * (k + 3)
        if k < group[VARIABLES]:
            store8(work, at, load8(work, at) + value)
        else:
            store8(work, at, load8(work, at) - value)
    count = group[CURVED]
    sources = index[group[CURVED_INDEX] + 8 * step * count :]
    places = code[group[CURVED_CODE] :]
    for k in range(count):
        i = places[k]
        s = load8(scales, 8 * i)
        at = 4 * i * (i + 3)
        store8(work, at, load8(work, at) + s * s * gather8(given, sources, 8 * k))
    count = group[ENTRIES]
    sources = index[group[ENTRY_INDEX] + 8 * step * count :]
    places = code[group[ENTRY_CODE] :]
    for k in range(count):
        value = gather8(given, sources, 8 * k) * load8(scales, 8 * places[3 * k + 1])
        value = value * load8(scales, 8 * places[3 * k + 2])
        at = 8 * places[3 * k]
        store8(work, at, load8(work, at) + value)
    if step == 0:
        sources = index[group[FIRST_INDEX] :]
        places = code[group[FIRST_CODE] :]
        for k in range(group[FIRST]):
            value = gather8(given, sources, 8 * k) * load8(scales, 8 * places[3 * k + 1])
            value = value * load8(scales, 8 * places[3 * k + 2])
            at = 8 * places[3 * k]
            store8(work, at, load8(work, at) + value)


@native(fast=True)
def eliminate(
    groups: i64,
    table: i64s,
    index: i32s,
    code: i32s,
    diagonal: i64,
    growth: f64,
    suspect: f64,
    given: f64s,
    scale: f64s,
    result: f64s,
    work: f64s,
    scales: f64s,
    moving: f64s,
    columns: f64s,
    factors: f64s,
    state: f64s,
) -> i64:
    """Eliminate all segments.

    Args:
        groups, table: how many groups of segments, FIELDS numbers for each.
        index, code: what the table refers to; ``code`` is shared by groups of one kind.
        diagonal: where the diagonal begins in ``given``.
        growth, suspect: pivots are accepted as long as no product that is subtracted exceeds 1 / growth, and no
            entry of D^-1 1 / suspect, in the scaled matrix.
        given: entries of the matrix: H, J, p and d.
        scale: of each unknown, (N,).
        result: where the entries are added that are left, as ``index`` tells.
        work, scales, moving, columns: work space.
        factors: the factors; ``state``: see above.

    Returns:
        How many pivots are negative, -1 when one was not accepted.
    """
    negative = 0.0
    state[LARGEST] = 0.0
    for g in range(groups):
        group = table[g * FIELDS :]
        for k in range(LARGEST):
            state[k] = 0.0
        at = 8 * group[FACTORS]
        for step in range(group[STEPS]):
            _load_step(step, group, index, code, diagonal, given, scale, work, scales, moving)
            panel = code[group[PANEL_CODE] :]
            for _panel in range(group[PANELS]):
                members = panel[0]
                count = panel[1]
                rows = panel[2 + 2 * members :]
                size = members * (members + count)
                take_panel(
                    members, count, panel[2:], rows, rows[count:], growth, suspect, work, columns, factors[at:],
                    state,
                )  # fmt: skip
                panel = rows[count + size :]
                at += 8 * size
            if not (largest8(load8(state, WORST)) < 1.0):
                return -1
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
    return int(negative)
