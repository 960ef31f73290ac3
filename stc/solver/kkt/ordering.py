"""In which order to eliminate the unknowns of one stage, found by eliminating the sizes of its entries.

Pivots of one and two unknowns (Duff and Reid 1983) are taken greedily: among those that should pass the threshold
test with a margin, the ones with few multiplications are compared by the entries that they add.  For a pivot on p and
q, whose columns have the patterns P and Q,

    D^-1 = [ a_qq  -a_pq ] / det        fills  P x Q,   P x P if a_qq != 0,   Q x Q if a_pp != 0,
           [-a_pq   a_pp ]

so that a row of the problem without diagonal, paired with a variable, costs little more than |P| |Q|.

Sizes are entries of a stage like those to come in the window's slots, with their signs, zero where there is none: so
that pivots which always cancel, because fewer unknowns than these are behind them, are seen to.  An entry that cancels
is still an entry, if a tiny one.
"""

from __future__ import annotations

from stc.codegen.native import copysign, f64, f64s, fabs, i32s, i64, i64s, native
from stc.solver.kkt.slot_sets import fill, lowest, missing, note_rows, patterns, slot_of, words_of

__all__ = [
    "COMPARED",
    "LEAF",
    "MARGIN",
    "SECOND",
    "SETS",
    "SMALLEST",
    "UNPLANNED",
    "follow_order",
    "order_stage",
    "take_leaves",
]

#: Kinds of unknowns in an order: first of a pivot of one or two, second of two, not eliminated.
SECOND = 0
UNPLANNED = -1

#: The thresholds that pivots are planned for are multiples of this.
MARGIN = 0.01
#: Leaves have no more entries than this in their columns, and diagonals of at least this share of the largest: they
#: leave no choice later.
LEAF = 4
STRONG = 0.3
#: Sizes stay between these, so that what is there never vanishes.
SMALLEST = 1e-30
LARGEST = 1e30
#: Entries below this are no pivots at all.
NEGLIGIBLE = 1e-9
#: What may fail the test is planned only where nothing else is left: its cost is multiplied by this.
PENALTY = 1e6
#: Slots looked at in the search for one pivot, about.
EFFORT = 30000
#: Those with at most this many times the fewest multiplications are compared by their fill, as a rule.
COMPARED = 2.0
#: Sets of slots that the search needs room for.
SETS = 4


@native
def _column(p: i64, left_out: i64, top: i64, sizes: f64s, listed: i32s) -> i64:
    """Slots coupled with ``p``, without itself and ``left_out``; their number."""
    count = 0
    row = sizes[p * top :]
    for k in range(top):
        listed[count] = k
        count += row[k] != 0.0 and k != p and k != left_out
    return count


@native(fast=True)
def _measure(p: i64, top: i64, sizes: f64s, degree: i32s, most: f64s) -> None:
    """Number of entries of a column, and the largest of them, both without the diagonal."""
    row = sizes[p * top :]
    count = 0
    high = 0.0
    for k in range(top):
        value = fabs(row[k])
        count += value != 0.0
        high = max(high, value)
    if row[p] != 0.0:
        count -= 1
        if fabs(row[p]) >= high:
            high = 0.0
            for k in range(top):
                high = max(high, fabs(row[k]) if k != p else 0.0)
    degree[p] = count
    most[p] = high


@native(fast=True)
def _largest(p: i64, left_out: i64, top: i64, sizes: f64s, most: f64s) -> f64:
    """Largest entry of a column off the diagonal and outside ``left_out``."""
    row = sizes[p * top :]
    high = most[p]
    if fabs(row[left_out]) == high:
        high = 0.0
        for k in range(top):
            high = max(high, fabs(row[k]) if k != p and k != left_out else 0.0)
    return high


@native
def _one_cost(p: i64, margin: f64, top: i64, sizes: f64s, degree: i32s, most: f64s) -> f64:
    """Multiplications of a 1x1 pivot, or -1."""
    own = fabs(sizes[p * top + p])
    cost = -1.0
    if own > NEGLIGIBLE:
        cost = 0.5 * degree[p] * (degree[p] + 1)
        if own < margin * most[p]:
            cost = (cost + 1.0) * PENALTY
    return cost


@native
def _two_cost(
    p: i64, q: i64, margin: f64, top: i64, sizes: f64s, degree: i32s, most: f64s, limit: f64
) -> f64:
    """Multiplications per unknown of a 2x2 pivot, or -1; any number above ``limit`` when it is above."""
    b = sizes[p * top + q]
    a = sizes[p * top + p]
    c = sizes[q * top + q]
    determinant = fabs(a * c - b * b)
    if fabs(b) <= NEGLIGIBLE or determinant < 0.5 * max(b * b, fabs(a * c)):
        return -1.0
    size_p = 1.0 * (degree[p] - 1)
    size_q = 1.0 * (degree[q] - 1)
    cost = size_p * size_q
    if a != 0.0:
        cost += 0.5 * size_q * (size_q + 1.0)
    if c != 0.0:
        cost += 0.5 * size_p * (size_p + 1.0)
    cost *= 0.5
    if cost <= limit:
        most_p = _largest(p, q, top, sizes, most)
        most_q = _largest(q, p, top, sizes, most)
        a = fabs(a)
        b = fabs(b)
        c = fabs(c)
        if margin * max(c * most_p + b * most_q, b * most_p + a * most_q) > determinant:
            cost = (cost + 1.0) * PENALTY
    return cost


@native
def _added(p: i64, q: i64, words: i64, top: i64, sizes: f64s, bits: i64s, sets: i64s) -> f64:
    """Entries per unknown that the elimination of p, and of q when that is no less than 0, would add.

    Args:
        bits: which entries each row has (see ``slot_sets.note_rows``); sets: work space, (SETS * words,).
    """
    patterns(p, q, words, bits, sets)
    of_p = sets[0:]
    of_q = sets[words:]
    in_both = sets[2 * words :]
    in_q_only = sets[3 * words :]
    full_p = q < 0
    full_q = False
    if q >= 0:
        full_p = sizes[q * top + q] != 0.0
        full_q = sizes[p * top + p] != 0.0
    for w in range(words):
        in_both[w] = of_p[w] & of_q[w]
        in_q_only[w] = of_q[w] ^ in_both[w]
    once = 0
    twice = 0  # pairs inside one set are met from either end, a diagonal once
    for w in range(words):
        left = of_p[w] | of_q[w]
        while left != 0:
            one = lowest(left)
            left = left ^ one
            i = slot_of(w, one)
            row = bits[i * words :]
            own = 1 if sizes[i * top + i] == 0.0 else 0
            if of_p[w] & one != 0:
                if in_both[w] & one != 0:
                    once += missing(words, in_q_only, row)
                    if not full_p:
                        twice += missing(words, in_both, row) - own
                else:
                    # With ``full_p``, pairs of P and of both are counted again, which is too much by little.
                    once += missing(words, of_q, row)
                if full_p:
                    twice += missing(words, of_p, row) - own
            elif full_q:
                twice += missing(words, in_q_only, row) - own
    added = once + 0.5 * twice
    return added if q < 0 else 0.5 * added


@native
def _choose(
    done: i64, count: i64, waiting: i32s, margin: f64, compared: f64, top: i64, sizes: f64s, degree: i32s, most: f64s,
    weak: i32s, words: i64, bits: i64s, candidates: i64, first: i32s, second: i32s, costs: f64s,
) -> i64:  # fmt: skip
    """The next pivot as ``p * (top + 1) + q + 1``, q being -1 for a single one; -1 when there is none."""
    least = -1.0
    found = 0
    effort = 0
    weak_count = 0  # of those before, which may have to be paired
    for k in range(done, count):
        one = waiting[k]
        strong = fabs(sizes[one * top + one]) >= margin * most[one]
        cost = _one_cost(one, margin, top, sizes, degree, most)
        if cost >= 0.0 and (least < 0.0 or cost <= compared * least + 2.0):
            least = cost if least < 0.0 else min(least, cost)
            if found < candidates:
                first[found] = one
                second[found] = -1
                costs[found] = cost
                found += 1
        # Two strong ones will do alone.
        others = waiting[done:]
        before = k - done
        if strong:
            others = weak[0:]
            before = weak_count
        for e in range(before):
            other = others[e]
            if effort > EFFORT:
                break
            if sizes[one * top + other] == 0.0:
                continue
            limit = compared * least + 2.0 if least >= 0.0 else PENALTY
            cost = _two_cost(one, other, margin, top, sizes, degree, most, limit)
            if cost >= 0.0 and (least < 0.0 or cost <= limit):
                effort += 2 * top
                least = cost if least < 0.0 else min(least, cost)
                if found < candidates:
                    first[found] = one
                    second[found] = other
                    costs[found] = cost
                    found += 1
        if not strong:
            weak[weak_count] = one
            weak_count += 1
    best = -1.0
    chosen = -1
    effort = 0
    for k in range(found):
        if costs[k] <= compared * least + 2.0 and effort <= EFFORT:
            p = first[k]
            q = second[k]
            effort += degree[p] * degree[p] // 2
            if q >= 0:
                effort += degree[p] * degree[q]
            cost = _added(p, q, words, top, sizes, bits, bits[top * words :]) + 1e-3 * costs[k]
            if best < 0.0 or cost < best:
                best = cost
                chosen = p * (top + 1) + q + 1
    return chosen


@native
def _choose_any(
    all_taken: i64, done: i64, count: i64, waiting: i32s, margin: f64, top: i64, sizes: f64s, most: f64s
) -> i64:  # fmt: skip
    """The same where every order costs the same: single pivots as long as there are strong ones, the strongest first
    where all are taken as they come."""
    best = margin
    chosen = -1
    for k in range(done, count):
        p = waiting[k]
        own = fabs(sizes[p * top + p])
        if own > NEGLIGIBLE and own >= best * most[p] and (all_taken != 0 or chosen < 0):
            best = own / max(most[p], SMALLEST)
            chosen = p
    if chosen >= 0:
        return chosen * (top + 1)
    for k in range(done, count):
        p = waiting[k]
        q = -1
        size = NEGLIGIBLE
        for e in range(done, count):
            other = waiting[e]
            if other != p and fabs(sizes[p * top + other]) > size:
                size = fabs(sizes[p * top + other])
                q = other
        if q >= 0:
            return p * (top + 1) + q + 1
    return -1


@native
def _kept(value: f64) -> f64:
    """An entry within the limits, and not zero."""
    return copysign(min(max(fabs(value), SMALLEST), LARGEST), value)


@native
def _fill_pivot(
    p: i64, q: i64, margin: f64, top: i64, sizes: f64s, most: f64s, row_p: i32s, row_q: i32s
) -> None:
    """Subtract what the elimination of p, and of q when that is no less than 0, leaves behind."""
    count = _column(p, q, top, sizes, row_p)
    a = sizes[p * top + p]
    if q < 0:
        reciprocal = 1.0 / copysign(max(max(fabs(a), margin * most[p]), SMALLEST), a)
        for k in range(count):
            i = row_p[k]
            by_row = sizes[i * top + p] * reciprocal
            for e in range(k + 1):
                j = row_p[e]
                value = _kept(sizes[i * top + j] - by_row * sizes[j * top + p])
                sizes[i * top + j] = value
                sizes[j * top + i] = value
        return
    # The columns' common list.
    for k in range(_column(q, p, top, sizes, row_q)):
        if sizes[p * top + row_q[k]] == 0.0:
            row_p[count] = row_q[k]
            count += 1
    b = sizes[p * top + q]
    c = sizes[q * top + q]
    determinant = a * (c / b) - b
    for k in range(count):
        i = row_p[k]
        of_p = ((c / b) * sizes[i * top + p] - sizes[i * top + q]) / determinant
        of_q = ((a / b) * sizes[i * top + q] - sizes[i * top + p]) / determinant
        for e in range(k + 1):
            j = row_p[e]
            product = of_p * sizes[j * top + p] + of_q * sizes[j * top + q]
            if product != 0.0:
                value = _kept(sizes[i * top + j] - product)
                sizes[i * top + j] = value
                sizes[j * top + i] = value


@native
def _drop(p: i64, q: i64, top: i64, sizes: f64s, used: i64, lists: i32s) -> i64:
    """Take a pivot's rows and columns out and append its column's slots to ``lists``; their new length."""
    for k in range(top):
        if k != p and k != q:
            touched = sizes[p * top + k] != 0.0
            if q >= 0:
                touched = touched or sizes[q * top + k] != 0.0
            if touched:
                lists[used] = k
                used += 1
    for k in range(top):
        sizes[p * top + k] = 0.0
        sizes[k * top + p] = 0.0
        if q >= 0:
            sizes[q * top + k] = 0.0
            sizes[k * top + q] = 0.0
    return used


@native
def follow_order(
    top: i64, count: i64, order: i32s, kinds: i32s, sizes: f64s, degree: i32s, most: f64s, row_p: i32s, row_q: i32s,
    lists: i32s,
) -> None:  # fmt: skip
    """Eliminate slots in a known order; arguments as in ``order_stage``, ``lists`` is work space, (top,)."""
    for k in range(count):
        if kinds[k] != SECOND:
            p = order[k]
            q = -1
            if kinds[k] == 2:
                q = order[k + 1]
            _measure(p, top, sizes, degree, most)
            _fill_pivot(p, q, MARGIN, top, sizes, most, row_p, row_q)
            _drop(p, q, top, sizes, 0, lists)


@native(small=True)
def take_leaves(
    top: i64, count: i64, waiting: i32s, fresh: i32s, sizes: f64s, degree: i32s, most: f64s, row_p: i32s, row_q: i32s,
) -> i64:  # fmt: skip
    """Eliminate slots with few entries and a strong diagonal, no two of them coupled, before all others.

    Args:
        top, count, waiting, sizes: those of ``order_stage``; leaves come first in ``waiting`` afterwards.
        fresh: slots that enter the window at this stage, (top,), so that their columns are still as in the
            matrix; those of the leaves and their neighbours are cleared.

    Returns:
        The number of leaves.
    """
    leaves = 0
    for k in range(top):
        _measure(k, top, sizes, degree, most)
    for k in range(count):
        p = waiting[k]
        own = fabs(sizes[p * top + p])
        if fresh[p] != 0 and degree[p] <= LEAF and own > NEGLIGIBLE and own >= STRONG * most[p]:
            fresh[p] = 0
            for e in range(_column(p, -1, top, sizes, row_p)):
                fresh[row_p[e]] = 0
            waiting[k] = waiting[leaves]
            waiting[leaves] = p
            leaves += 1
    for k in range(leaves):
        p = waiting[k]
        _fill_pivot(p, -1, MARGIN, top, sizes, most, row_p, row_q)
        for e in range(top):
            sizes[p * top + e] = 0.0
            sizes[e * top + p] = 0.0
    return leaves


@native
def order_stage(
    top: i64,
    count: i64,
    waiting: i32s,
    margin: f64,
    compared: f64,
    all_taken: i64,
    sizes: f64s,
    degree: i32s,
    most: f64s,
    row_p: i32s,
    row_q: i32s,
    bits: i64s,
    candidates: i64,
    first: i32s,
    second: i32s,
    costs: f64s,
    order: i32s,
    kinds: i32s,
    starts: i32s,
    capacity: i64,
    lists: i32s,
) -> i64:
    """Eliminate the slots ``waiting`` (count,) from the sizes (top * top,), in place.

    Args:
        top: how many slots are in use.
        margin: the threshold that pivots are planned for.
        compared: pivots with at most this many times the fewest multiplications are compared by their fill.
        all_taken: 1 where whoever eliminates takes all pivots in that order, whatever their values: then these count
            to the end. Where pivots that turn out weak are taken later, it is better to expect little of that: once
            every order costs the same, the sizes stay as they are.
        order: the slots in the order of their elimination, (count,).
        kinds: 1 or 2 where a pivot begins, 0 for the second of two, -1 for slots without a pivot: these come
            last, and the sizes then are as if they had been eliminated one by one.
        starts: the column of pivot k is ``lists[starts[k]:starts[k + 1]]``; the second of two has an empty one,
            (count + 1,).
        capacity: length of ``lists``.
        degree, most, row_p, row_q: work space, (top,); bits: ((top + SETS) * words_of(top),).
        first, second, costs: work space, (candidates,).

    Returns:
        The number of entries in ``lists``, or -1 when they do not fit.
    """
    words = words_of(top)
    note_rows(top, words, sizes, bits)
    for k in range(top):
        _measure(k, top, sizes, degree, most)
    done = 0
    used = 0
    full = False
    starts[0] = 0
    while done < count:
        if used + top > capacity:
            return -1
        if full:
            chosen = _choose_any(all_taken, done, count, waiting, margin, top, sizes, most)
        else:
            chosen = _choose(
                done, count, waiting, margin, compared, top, sizes, degree, most, row_p, words, bits, candidates,
                first, second, costs,
            )  # fmt: skip
        kind = 1
        p = waiting[done]
        q = -1
        if chosen < 0:
            kind = UNPLANNED
        else:
            p = chosen // (top + 1)
            q = chosen % (top + 1) - 1
            if q >= 0:
                kind = 2
                # The one without diagonal comes second: its zeros stay zeros.
                if fabs(sizes[p * top + p]) < fabs(sizes[q * top + q]):
                    p, q = q, p
        if all_taken != 0 or not full:
            _fill_pivot(p, q, margin, top, sizes, most, row_p, row_q)
        if not full:
            full_p = 1
            full_q = 0
            if q >= 0:
                full_p = 1 if sizes[q * top + q] != 0.0 else 0
                full_q = 1 if sizes[p * top + p] != 0.0 else 0
            fill(p, q, full_p, full_q, words, bits, bits[top * words :])
            # Once a single pivot has coupled all that is left, nothing can be filled any more.
            coupled = 0
            for k in range(top):
                coupled += degree[k] > 0
            full = kind != 2 and degree[p] == coupled - 1
        degree[p] = 0
        if q >= 0:
            degree[q] = 0
        used = _drop(p, q, top, sizes, used, lists)
        if all_taken != 0 or not full:
            for k in range(starts[done], used):
                _measure(lists[k], top, sizes, degree, most)
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
