"""Consecutive pivots of a stage's order that are eliminated together, in panels (see stc.solver.kkt.panel).

Together they have the rows that any of them has.  What that wastes on zeros is weighed against what every panel costs
besides: groups are the cheapest ones of an order (by dynamic programming over where they end), for costs in cycles as
measured.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, i32s, i64, i64s, native
from stc.solver.kkt.ordering import SECOND, SMALLEST
from stc.solver.kkt.slot_sets import (
    fills_own,
    leave_out,
    listed,
    missing,
    note_rows,
    size_of,
    take_out,
    words_of,
)

__all__ = ["MEMBERS", "group_stage"]

#: Pivots of a group, in unknowns, at most.
MEMBERS = 16
#: Cycles charged for a superfluous product, beyond those of the panel: it may be there for nothing later on, too.
AVERSION = 0.5


@native(inline=True)
def _cost(members: f64, rows: f64) -> f64:
    """Cycles of a panel, about."""
    length = members + rows
    moved = 2.0 * members * (0.5 * members + rows)
    inside = 0.5 * members * members * (6.0 + 0.2 * length) + members * (60.0 + 0.8 * length)
    update = 0.5 * rows * rows * (1.2 + members / 9.0) + rows * (8.0 + members)
    return 400.0 + moved + inside + update


@native(small=True)
def _cut(
    count: i64, top: i64, order: i32s, kinds: i32s, starts: i32s, lists: i32s, work: f64s, mark: i32s, best: f64s,
    cut: i32s,
) -> None:  # fmt: skip
    """Where the group that ends before each place begins, in the cheapest sequence of groups."""
    stamp = 0
    best[0] = 0.0
    for k in range(top):
        mark[k] = 0
    for end in range(1, count + 1):
        best[end] = -1.0
        if end < count and kinds[end] == SECOND:
            continue
        stamp += 1
        rows = 0
        needed = 0.0
        begin = end
        while begin > 0 and end - begin < MEMBERS:
            begin -= 1
            needed += work[begin]
            for k in range(starts[begin], starts[begin + 1]):
                slot = lists[k]
                if mark[slot] != stamp:
                    mark[slot] = stamp
                    rows += 1
            own = order[begin]
            if mark[own] == stamp:
                rows -= 1
            mark[own] = stamp
            if kinds[begin] == SECOND:
                continue
            members = 1.0 * (end - begin)
            total = best[begin] + _cost(members, 1.0 * rows)
            # Products of full columns, as if these were all there is to it, less those that are needed.
            length = rows + 0.5 * members
            full = 0.5 * members * (length * length + members * members / 12.0)
            total += AVERSION * max(full - needed, 0.0)
            if best[end] < 0.0 or total < best[end]:
                best[end] = total
                cut[end] = begin


@native
def _take_exactly(
    members: i64, order: i32s, kinds: i32s, words: i64, bits: i64s, sets: i64s, union: i64s, rows: i32s
) -> i64:  # fmt: skip
    """Eliminate a group from a pattern in its order: its rows; how many, or -1 less that where not all couple.

    ``sets`` and ``union`` are work space, (2 * words,) and (words,).
    """
    for w in range(words):
        union[w] = 0
    for k in range(members):
        if kinds[k] != SECOND:
            q = -1
            if kinds[k] == 2:
                q = order[k + 1]
            take_out(order[k], q, words, bits, sets)
            for w in range(words):
                union[w] |= sets[w] | sets[words + w]
    for k in range(members):
        leave_out(order[k], union)
    count = listed(words, union, rows)
    for k in range(count):
        if missing(words, union, bits[rows[k] * words :]) > 0:
            return -1 - count
    return count


@native
def _take_in_any_order(
    members: i64, order: i32s, words: i64, bits: i64s, union: i64s, rows: i32s, planned: i64, known: i32s, surplus: i32s
) -> i64:  # fmt: skip
    """Eliminate a group from a pattern and couple all its rows with each other; how many are surplus.

    Those are not among ``known`` (planned,). ``union`` is work space, (words,), and ``rows`` for all slots.
    """
    for w in range(words):
        union[w] = 0
    for k in range(members):
        own = bits[order[k] * words :]
        for w in range(words):
            union[w] |= own[w]
            own[w] = 0
    for k in range(members):
        leave_out(order[k], union)
    for k in range(listed(words, union, rows)):
        row = bits[rows[k] * words :]
        for w in range(words):
            row[w] |= union[w]
        for e in range(members):
            leave_out(order[e], row)
    for k in range(planned):
        leave_out(known[k], union)
    return listed(words, union, surplus)


@native
def _exact_work(count: i64, order: i32s, kinds: i32s, words: i64, bits: i64s, sets: i64s, work: f64s) -> None:
    """How many products each pivot needs when only what is there is multiplied; the pattern is lost."""
    for k in range(count):
        work[k] = 0.0
        if kinds[k] == SECOND:
            continue
        p = order[k]
        q = -1
        if kinds[k] == 2:
            q = order[k + 1]
        full_p = fills_own(q, words, bits)
        full_q = fills_own(p, words, bits)
        take_out(p, q, words, bits, sets)
        size_p = 1.0 * size_of(words, sets)
        size_q = 1.0 * size_of(words, sets[words:])
        work[k] = size_p * size_q + 0.5 * full_p * size_p * size_p + 0.5 * full_q * size_q * size_q


@native(small=True)
def group_stage(
    top: i64, count: i64, order: i32s, kinds: i32s, starts: i32s, lists: i32s, before: f64s, bits: i64s, sizes: f64s,
    cover: f64s, mark: i32s, found: i32s, work: f64s, best: f64s, cut: i32s, group: i32s, fixed: i32s,
    group_starts: i32s, surplus_starts: i32s, group_rows: i32s,
) -> i64:  # fmt: skip
    """Cut the order that ``order_stage`` has found into groups.

    Args:
        top, count, order, kinds, starts, lists: its arguments and results.
        before: the sizes as they were, (top * top,).
        sizes: those that it left, to which entries are added that it may have missed.
        cover: nonzero where the window may have an entry in whatever order the groups' pivots are taken, (top * top,);
            the same for what is left afterwards.
        bits: work space, ((top + SETS) * words_of(top),); mark, found: (top,); work, best, cut: (count + 1,).
        group: how many unknowns the group has that begins at a place of the order, 0 where none begins, (count,).
        fixed: whether its rows do not all couple afterwards, so that the order inside matters, (count,).
        group_starts: the rows of the group at place k are ``group_rows[group_starts[k]:group_starts[k + 1]]``,
            (count + 1,).
        surplus_starts: other rows that it may have are
            ``group_rows[surplus_starts[k]:surplus_starts[k + 1]]``, (count + 1,).
        group_rows: room for ``2 * count * top``.

    Returns:
        The number of entries in ``group_rows``.
    """
    words = words_of(top)
    sets = bits[top * words :]
    union = sets[2 * words :]
    note_rows(top, words, before, bits)
    _exact_work(count, order, kinds, words, bits, sets, work)
    _cut(count, top, order, kinds, starts, lists, work, mark, best, cut)
    end = count
    for k in range(count):
        group[k] = 0
    while end > 0:
        begin = cut[end]
        group[begin] = end - begin
        end = begin
    used = 0
    group_starts[0] = 0
    note_rows(top, words, before, bits)
    for k in range(count):
        members = group[k]
        if members > 0:
            rows = _take_exactly(members, order[k:], kinds[k:], words, bits, sets, union, group_rows[used:])
            fixed[k] = rows < 0
            used += max(rows, -1 - rows)
        group_starts[k + 1] = used
    for k in range(top):
        for e in range(listed(words, bits[k * words :], found)):
            if sizes[k * top + found[e]] == 0.0:
                sizes[k * top + found[e]] = SMALLEST
    surplus_starts[0] = used
    note_rows(top, words, cover, bits)
    for k in range(count):
        if group[k] > 0:
            begin = group_starts[k]
            used += _take_in_any_order(
                group[k], order[k:], words, bits, union, found, group_starts[k + 1] - begin, group_rows[begin:],
                group_rows[used:],
            )  # fmt: skip
        surplus_starts[k + 1] = used
    for k in range(top):
        for e in range(top):
            cover[k * top + e] = 0.0
        for e in range(listed(words, bits[k * words :], found)):
            cover[k * top + found[e]] = 1.0
    return used
