"""Consecutive pivots of a stage's order that are eliminated together, in panels (see stc.solver.kkt.panel).

Together they have the rows that any of them has.  What that wastes on zeros is weighed against what every panel costs
besides: groups are the cheapest ones of an order (by dynamic programming over where they end), for costs in cycles as
measured.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, i32s, i64, native
from stc.solver.kkt.ordering import SECOND, SMALLEST

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
    count: i64, stride: i64, order: i32s, kinds: i32s, starts: i32s, lists: i32s, work: f64s, mark: i32s,
    best: f64s, cut: i32s,
) -> None:  # fmt: skip
    """Where the group that ends before each place begins, in the cheapest sequence of groups."""
    stamp = 0
    best[0] = 0.0
    for k in range(stride):
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


@native(small=True)
def _take_out(p: i64, q: i64, top: i64, stride: i64, pattern: f64s, rows: i32s) -> i64:
    """Eliminate a slot, and ``q`` when that is another, from a pattern; the rows of the column, how many these are."""
    count = 0
    for k in range(top):
        rows[count] = k
        count += k != p and k != q and (pattern[p * stride + k] != 0.0 or pattern[q * stride + k] != 0.0)
    full_p = p == q or pattern[q * stride + q] != 0.0
    full_q = p != q and pattern[p * stride + p] != 0.0
    for k in range(count):
        i = rows[k]
        i_in_p = pattern[p * stride + i] != 0.0
        i_in_q = p != q and pattern[q * stride + i] != 0.0
        for e in range(k + 1):
            j = rows[e]
            j_in_p = pattern[p * stride + j] != 0.0
            j_in_q = p != q and pattern[q * stride + j] != 0.0
            crossed = (i_in_p and j_in_q) or (i_in_q and j_in_p)
            if crossed or (full_p and i_in_p and j_in_p) or (full_q and i_in_q and j_in_q):
                if pattern[i * stride + j] == 0.0:
                    pattern[i * stride + j] = SMALLEST
                    pattern[j * stride + i] = SMALLEST
    for k in range(top):
        pattern[p * stride + k] = 0.0
        pattern[k * stride + p] = 0.0
        pattern[q * stride + k] = 0.0
        pattern[k * stride + q] = 0.0
    return count


@native(small=True)
def _take_exactly(
    members: i64, order: i32s, kinds: i32s, top: i64, stride: i64, pattern: f64s, mark: i32s, rows: i32s
) -> i64:  # fmt: skip
    """Eliminate a group from a pattern in its order: its rows; how many, or -1 less that where not all couple."""
    for k in range(top):
        mark[k] = 0
    for k in range(members):
        if kinds[k] != SECOND:
            q = order[k + 1] if kinds[k] == 2 else order[k]
            for e in range(_take_out(order[k], q, top, stride, pattern, rows)):
                mark[rows[e]] = 1
    for k in range(members):
        mark[order[k]] = 0
    count = 0
    missing = 0
    for k in range(top):
        if mark[k] != 0:
            rows[count] = k
            count += 1
            for e in range(count):
                missing += pattern[k * stride + rows[e]] == 0.0
    return count if missing == 0 else -1 - count


@native(small=True)
def _take_in_any_order(
    members: i64, order: i32s, top: i64, stride: i64, pattern: f64s, mark: i32s, rows: i32s, planned: i64,
    known: i32s, surplus: i32s,
) -> i64:  # fmt: skip
    """Eliminate a group from a pattern and couple all its rows with each other; how many are surplus.

    Those are not among ``known`` (planned,), which increase.
    """
    for k in range(top):
        mark[k] = 0
    for k in range(members):
        column = pattern[order[k] * stride :]
        for e in range(top):
            if column[e] != 0.0:
                mark[e] = 1
    for k in range(members):
        own = order[k]
        mark[own] = 0
        for e in range(top):
            pattern[own * stride + e] = 0.0
            pattern[e * stride + own] = 0.0
    count = 0
    for k in range(top):
        if mark[k] != 0:
            rows[count] = k
            count += 1
    for k in range(count):
        row = pattern[rows[k] * stride :]
        for e in range(count):
            row[rows[e]] = 1.0
    beyond = 0
    at = 0
    for k in range(count):
        while at < planned and known[at] < rows[k]:
            at += 1
        if at == planned or known[at] != rows[k]:
            surplus[beyond] = rows[k]
            beyond += 1
    return beyond


@native(small=True)
def _exact_work(
    count: i64, order: i32s, kinds: i32s, top: i64, stride: i64, pattern: f64s, rows: i32s, work: f64s
) -> None:  # fmt: skip
    """How many products each pivot needs when only what is there is multiplied; the pattern is lost."""
    for k in range(count):
        work[k] = 0.0
        if kinds[k] == SECOND:
            continue
        p = order[k]
        members = 1
        q = p
        if kinds[k] == 2:
            members = 2
            q = order[k + 1]
        size_p = 0.0
        size_q = 0.0
        for e in range(top):
            if e != p and e != q:
                size_p += pattern[p * stride + e] != 0.0
                size_q += pattern[q * stride + e] != 0.0
        work[k] = 0.5 * size_p * size_p
        if members == 2:
            work[k] = size_p * size_q
            if pattern[q * stride + q] != 0.0:
                work[k] += 0.5 * size_p * size_p
            if pattern[p * stride + p] != 0.0:
                work[k] += 0.5 * size_q * size_q
        _take_out(p, q, top, stride, pattern, rows)


@native(small=True)
def group_stage(
    stride: i64, top: i64, count: i64, order: i32s, kinds: i32s, starts: i32s, lists: i32s, before: f64s,
    pattern: f64s, sizes: f64s, cover: f64s, mark: i32s, found: i32s, work: f64s, best: f64s, cut: i32s,
    group: i32s, fixed: i32s, group_starts: i32s, surplus_starts: i32s, group_rows: i32s,
) -> i64:  # fmt: skip
    """Cut the order that ``order_stage`` has found into groups.

    Args:
        stride, top, count, order, kinds, starts, lists: its arguments and results.
        before: the sizes as they were, (stride * stride,).
        sizes: those that it left, to which entries are added that it may have missed.
        cover: nonzero where the window may have an entry in whatever order the groups' pivots are taken,
            (stride * stride,); the same for what is left afterwards.
        pattern: work space, (stride * stride,); mark, found: (stride,); work, best, cut: (count + 1,).
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
    for k in range(top * stride):
        pattern[k] = before[k]
    _exact_work(count, order, kinds, top, stride, pattern, group_rows, work)
    _cut(count, stride, order, kinds, starts, lists, work, mark, best, cut)
    for k in range(top * stride):
        pattern[k] = before[k]
    end = count
    for k in range(count):
        group[k] = 0
    while end > 0:
        begin = cut[end]
        group[begin] = end - begin
        end = begin
    used = 0
    group_starts[0] = 0
    for k in range(count):
        members = group[k]
        if members > 0:
            rows = _take_exactly(members, order[k:], kinds[k:], top, stride, pattern, mark, group_rows[used:])
            fixed[k] = rows < 0
            used += max(rows, -1 - rows)
        group_starts[k + 1] = used
    surplus_starts[0] = used
    for k in range(count):
        if group[k] > 0:
            begin = group_starts[k]
            used += _take_in_any_order(
                group[k], order[k:], top, stride, cover, mark, found, group_starts[k + 1] - begin, group_rows[begin:],
                group_rows[used:],
            )  # fmt: skip
        surplus_starts[k + 1] = used
    for k in range(top * stride):
        if pattern[k] != 0.0 and sizes[k] == 0.0:
            sizes[k] = SMALLEST
    return used
