"""In which order to eliminate the unknowns of one stage, found by eliminating its pattern.

Greedy minimum degree in the manner of Markowitz, with 1x1 and 2x2 pivots (Duff and Reid 1983): at each step the
pivot with the fewest multiplications per unknown is taken.  For a 2x2 pivot on p and q, whose columns have the
patterns P and Q,

    D^-1 = [ a_qq  -a_pq ] / det        fills  P x Q,   P x P if a_qq != 0,   Q x Q if a_pp != 0,
           [-a_pq   a_pp ]

so that a row of the problem without diagonal, paired with a variable, costs little more than |P| |Q|.

A pattern is a symmetric matrix of strengths in the window's slots: NONE, WEAK (there, but perhaps small) or STRONG
(good as a pivot, in the equilibrated matrix).
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, i32s, i64, native

__all__ = ["NONE", "STRONG", "UNPLANNED", "WEAK", "order_stage"]

NONE = 0
WEAK = 1
STRONG = 2

#: Kinds of unknowns in an order: first of a pivot of one or two, second of two, not eliminated.
SECOND = 0
UNPLANNED = -1

#: Weak pivots look this much more expensive than strong ones.
WEAK_PENALTY = 1e4


@native
def _pair_cost(p: i64, q: i64, stride: i64, pattern: i32s, degree: i32s) -> f64:
    """Multiplications per unknown of a 2x2 pivot."""
    size_p = 1.0 * (degree[p] - 1)
    size_q = 1.0 * (degree[q] - 1)
    cost = size_p * size_q
    if pattern[p * stride + p] != NONE:
        cost += 0.5 * size_q * size_q
    if pattern[q * stride + q] != NONE:
        cost += 0.5 * size_p * size_p
    return 0.5 * cost


@native
def _fill(
    count_i: i64,
    rows: i32s,
    count_j: i64,
    others: i32s,
    p: i64,
    q: i64,
    strength: i64,
    stride: i64,
    pattern: i32s,
) -> None:
    """Fill from the products of column ``p`` at ``rows`` with column ``q`` at ``others``, both ways."""
    for k in range(count_i):
        i = rows[k]
        by_row = min(pattern[i * stride + p], strength)
        for e in range(count_j):
            j = others[e]
            now = min(by_row, pattern[j * stride + q])
            pattern[i * stride + j] = max(pattern[i * stride + j], now)
            pattern[j * stride + i] = max(pattern[j * stride + i], now)


@native
def _list_row(p: i64, left_out: i64, top: i64, stride: i64, pattern: i32s, listed: i32s) -> i64:
    """Slots coupled with ``p``, without itself and ``left_out``; their number."""
    count = 0
    row = pattern[p * stride :]
    for k in range(top):
        if row[k] != NONE and k != p and k != left_out:
            listed[count] = k
            count += 1
    return count


@native
def order_stage(
    stride: i64,
    top: i64,
    count: i64,
    waiting: i32s,
    pattern: i32s,
    degree: i32s,
    row_p: i32s,
    row_q: i32s,
    order: i32s,
    kinds: i32s,
    starts: i32s,
    capacity: i64,
    lists: i32s,
) -> i64:
    """Eliminate the slots ``waiting`` (count,) from a pattern (stride * stride,), in place.

    Args:
        order: the slots in the order of their elimination, (count,).
        kinds: 1 or 2 where a pivot begins, 0 for the second of two, -1 for slots without a pivot: these come
            last, and the pattern then is as if they had been eliminated one by one.
        starts: the column of pivot k is ``lists[starts[k]:starts[k + 1]]``; the second of two has an empty one,
            (count + 1,).
        capacity: length of ``lists``.
        degree, row_p, row_q: work space, (stride,).

    Returns:
        The number of entries in ``lists``, or -1 when they do not fit.
    """
    for k in range(top):
        degree[k] = _list_row(k, k, top, stride, pattern, row_p)
    done = 0
    used = 0
    starts[0] = 0
    while done < count:
        best = -1.0
        best_p = -1
        best_q = -1
        for k in range(done, count):
            p = waiting[k]
            own = pattern[p * stride + p]
            if own != NONE:
                cost = 0.5 * degree[p] * degree[p]
                if own == WEAK:
                    cost = (cost + 1.0) * WEAK_PENALTY
                if best < 0.0 or cost < best:
                    best = cost
                    best_p = p
                    best_q = -1
            if own == STRONG:
                continue
            for e in range(done, count):
                q = waiting[e]
                coupling = pattern[p * stride + q]
                if coupling == NONE or q == p:
                    continue
                cost = _pair_cost(p, q, stride, pattern, degree)
                if coupling == WEAK:
                    cost = (cost + 1.0) * WEAK_PENALTY
                if best < 0.0 or cost < best:
                    best = cost
                    best_p = p
                    best_q = q
        kind = 1
        p = best_p
        q = best_q
        if p < 0:
            kind = UNPLANNED
            p = waiting[done]
        elif q >= 0:
            kind = 2
            # The one without diagonal comes second: its zeros stay zeros.
            if pattern[p * stride + p] < pattern[q * stride + q]:
                p, q = q, p
        count_p = _list_row(p, q, top, stride, pattern, row_p)
        count_q = 0
        if used + top > capacity:
            return -1
        if kind == 2:
            count_q = _list_row(q, p, top, stride, pattern, row_q)
            own_p = pattern[p * stride + p]
            own_q = pattern[q * stride + q]
            coupling = pattern[p * stride + q]
            _fill(count_p, row_p, count_q, row_q, p, q, coupling, stride, pattern)
            if own_q != NONE:
                _fill(count_p, row_p, count_p, row_p, p, p, own_q, stride, pattern)
            if own_p != NONE:
                _fill(count_q, row_q, count_q, row_q, q, q, own_p, stride, pattern)
        else:
            _fill(count_p, row_p, count_p, row_p, p, p, max(pattern[p * stride + p], WEAK), stride, pattern)
        for k in range(top):
            if k != p and k != q:
                touched = pattern[p * stride + k] != NONE
                if kind == 2:
                    touched = touched or pattern[q * stride + k] != NONE
                if touched:
                    lists[used] = k
                    used += 1
        for k in range(top):
            pattern[p * stride + k] = NONE
            pattern[k * stride + p] = NONE
            if kind == 2:
                pattern[q * stride + k] = NONE
                pattern[k * stride + q] = NONE
        for k in range(starts[done], used):
            slot = lists[k]
            degree[slot] = _list_row(slot, slot, top, stride, pattern, row_p)
        for member in range(2 if kind == 2 else 1):
            slot = p if member == 0 else q
            for k in range(done, count):
                if waiting[k] == slot:
                    waiting[k] = waiting[done]
                    waiting[done] = slot
            order[done] = slot
            kinds[done] = kind if member == 0 else SECOND
            done += 1
            starts[done] = used
    return used
