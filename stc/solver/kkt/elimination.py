"""LDL^T of a sparse symmetric matrix in a window that slides over the stages, with threshold pivoting.

At each stage the rows of its unknowns are added to the window, and the unknowns are taken out in the planned
order by 1x1 and 2x2 pivots:

    1x1   d = a_pp                 accepted when  |d| >= u max_j |a_pj|
    2x2   D = [a_pp a_pq]          accepted when  |D^-1| [max_j |a_pj|] <= 1/u  (in each row)
              [a_pq a_qq]                                [max_j |a_qj|]

(Duff and Reid 1983), so no factor exceeds 1/u.  What is not accepted is tried again after the others, then
delayed to the next stage.  Columns are gathered along the planned lists of slots while elimination follows the
plan, and by looking for nonzeros otherwise.  The entries are expected equilibrated, near 1.

Factors: pivot k takes out the positions ``pivots[2 k]`` and, when 2x2, ``pivots[2 k + 1]`` (otherwise -1). Its
rows are ``indices[starts[2 k]:starts[2 k + 2]]``; their factors, in pairs when 2x2, begin at
``factors[starts[2 k + 1]]``; ``inverse[3 k:3 k + 3]`` is D^-1 as (pp, pq, qq).
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native
from stc.solver.kkt.window import (
    clear,
    gather,
    gather_listed,
    largest,
    merge,
    subtract_one,
    subtract_two,
)

__all__ = ["COUNTS", "factorize"]

#: Places in ``counts``.
PIVOTS = 0
INDICES = 1
FACTORS = 2
POSITIVE = 3
NEGATIVE = 4
ZERO = 5
DELAYED = 6
REJECTED = 7
HELD = 8  # delayed unknowns that are in the window now
SCANNED = 9  # stages that left the plan
COUNTS = 16

#: Results of ``factorize``.
DONE = 0
FACTORS_FULL = 1
WINDOW_FULL = 2

#: A 2x2 pivot needs a determinant of at least this much of its larger product.
CANCELLATION = 1e-3
#: Thresholds below this are not tried.
LOWEST_THRESHOLD = 1e-10


@native
def _assemble(
    first: i64, last: i64, size: i64, pointers: i32s, columns: i32s, values: f64s, slot: i32s, owner: i32s,
    stride: i64, window: f64s,
) -> None:  # fmt: skip
    """Add the rows of the positions from ``first`` to ``last`` to the window."""
    upper = values[size:]
    for k in range(first, last):
        own = slot[k]
        owner[own] = k
        row = own * stride
        window[row + own] += values[k]
        for e in range(pointers[k], pointers[k + 1]):
            other = slot[columns[e]]
            owner[other] = columns[e]
            if other < own:
                window[row + other] += upper[e]
            else:
                window[other * stride + own] += upper[e]


@native(inline=True)
def _entry(i: i64, j: i64, stride: i64, window: f64s) -> f64:
    """Entry of the symmetric window."""
    return window[max(i, j) * stride + min(i, j)]


@native(inline=True)
def _pair_accepted(a: f64, b: f64, c: f64, most_p: f64, most_q: f64, threshold: f64, tiny: f64) -> i64:
    """Whether [[a, b], [b, c]] is a good pivot for columns with these largest other entries."""
    product = a * c
    square = b * b
    size = fabs(product - square)
    largest_entry = max(max(fabs(a), fabs(c)), fabs(b))
    good = 1
    if b == 0.0 or size < CANCELLATION * max(fabs(product), square) or size <= tiny * largest_entry:
        good = 0
    elif threshold * (fabs(c) * most_p + fabs(b) * most_q) > size:
        good = 0
    elif threshold * (fabs(b) * most_p + fabs(a) * most_q) > size:
        good = 0
    return good


@native
def _partner(count: i64, found: i32s, values: f64s, owner: i32s, last: i64) -> i64:
    """Place in the list of the largest entry among positions before ``last``, or -1."""
    best = -1
    most = 0.0
    for k in range(count):
        value = fabs(values[k])
        if value > most and owner[found[k]] < last:
            most = value
            best = k
    return best


@native
def _take_one(
    p: i64, d: f64, count: i64, listed: i32s, first: f64s, capacity: i64, slot: i32s, owner: i32s, stride: i64,
    window: f64s, spread: f64s, pivots: i32s, starts: i64s, indices: i32s, factors: f64s, inverse: f64s,
    counts: i64s,
) -> i64:  # fmt: skip
    """Eliminate a 1x1 pivot; 0 when the factors are full."""
    k = counts[PIVOTS]
    at = counts[INDICES]
    value_at = counts[FACTORS]
    if at + count > capacity or value_at + count > capacity:
        return 0
    reciprocal = 1.0 / d
    own = indices[at:]
    column = factors[value_at:]
    for e in range(count):
        own[e] = owner[listed[e]]
        column[e] = first[e] * reciprocal
    clear(slot[p], count, listed, stride, window)
    subtract_one(count, listed, first, column, stride, spread, window)
    pivots[2 * k] = p
    pivots[2 * k + 1] = -1
    inverse[3 * k] = reciprocal
    starts[2 * k + 2] = at + count
    starts[2 * k + 3] = value_at + count
    counts[PIVOTS] = k + 1
    counts[INDICES] = at + count
    counts[FACTORS] = value_at + count
    slot[p] = -1
    return 1


@native
def _take_two(
    p: i64, q: i64, a: f64, b: f64, c: f64, count: i64, listed: i32s, first: f64s, second: f64s, capacity: i64,
    slot: i32s, owner: i32s, stride: i64, window: f64s, spread_1: f64s, spread_2: f64s, pivots: i32s,
    starts: i64s, indices: i32s, factors: f64s, inverse: f64s, counts: i64s,
) -> i64:  # fmt: skip
    """Eliminate a 2x2 pivot; 0 when the factors are full."""
    k = counts[PIVOTS]
    at = counts[INDICES]
    value_at = counts[FACTORS]
    if at + count > capacity or value_at + 2 * count > capacity:
        return 0
    # Divided by b first: a c / b may be tiny or large, b^2 must not overflow nor vanish.
    ratio = 1.0 / (a * (c / b) - b) if b != 0.0 else 0.0
    inverse_pp = (c / b) * ratio
    inverse_pq = -ratio
    inverse_qq = (a / b) * ratio
    own = indices[at:]
    column = factors[value_at:]
    for e in range(count):
        own[e] = owner[listed[e]]
        column[2 * e] = inverse_pp * first[e] + inverse_pq * second[e]
        column[2 * e + 1] = inverse_pq * first[e] + inverse_qq * second[e]
    row_p = slot[p]
    row_q = slot[q]
    clear(row_p, count, listed, stride, window)
    clear(row_q, count, listed, stride, window)
    window[max(row_p, row_q) * stride + min(row_p, row_q)] = 0.0
    subtract_two(count, listed, first, second, column, stride, spread_1, spread_2, window)
    pivots[2 * k] = p
    pivots[2 * k + 1] = q
    inverse[3 * k] = inverse_pp
    inverse[3 * k + 1] = inverse_pq
    inverse[3 * k + 2] = inverse_qq
    starts[2 * k + 2] = at + count
    starts[2 * k + 3] = value_at + 2 * count
    counts[PIVOTS] = k + 1
    counts[INDICES] = at + count
    counts[FACTORS] = value_at + 2 * count
    slot[p] = -1
    slot[q] = -1
    return 1


@native
def _count_sign(d: f64, counts: i64s) -> None:
    if d > 0.0:
        counts[POSITIVE] += 1
    else:
        counts[NEGATIVE] += 1


@native
def _hold(
    p: i64, top: i64, low: i64, high: i64, stride: i64, slot: i32s, owner: i32s, window: f64s, found: i32s,
    values: f64s,
) -> i64:  # fmt: skip
    """Move a delayed unknown out of the planned slots to the first free one from ``low``; new end, or -1."""
    old = slot[p]
    if old >= low:
        return high
    new = low
    while new < high and owner[new] >= 0 and slot[owner[new]] == new:
        new += 1
    if new >= stride:
        return -1
    d = window[old * stride + old]
    count = gather(old, top, low, high, stride, window, found, values)
    clear(old, count, found, stride, window)
    for k in range(count):
        other = found[k]
        window[max(other, new) * stride + min(other, new)] = values[k]
    window[new * stride + new] = d
    slot[p] = new
    owner[new] = p
    return max(high, new + 1)


@native
def _only_expected(top: i64, count: i64, rows: i32s, others: i32s, stride: i64, window: f64s) -> i64:
    """Whether all nonzeros among the slots below ``top`` are at the expected places."""
    found = 0
    for i in range(top):
        row = window[i * stride :]
        for j in range(i + 1):
            found += row[j] != 0.0
    for k in range(count):
        found -= window[rows[k] * stride + others[k]] != 0.0
    return found == 0


@native
def factorize(
    size: i64,
    stages: i64,
    variables: i64,
    threshold: f64,
    tiny: f64,
    replacement: f64,
    delay_limit: i64,
    capacity: i64,
    stride: i64,
    held_from: i64,
    planned: i64,
    stage_pointers: i32s,
    pointers: i32s,
    columns: i32s,
    values: f64s,
    order: i32s,
    planned_slot: i32s,
    top: i32s,
    plan_kind: i32s,
    plan_start: i32s,
    plan_count: i32s,
    plan_slots: i32s,
    state: i32s,
    state_starts: i32s,
    state_rows: i32s,
    state_columns: i32s,
    window: f64s,
    spread_1: f64s,
    spread_2: f64s,
    slot: i32s,
    owner: i32s,
    queue: i32s,
    found_1: i32s,
    found_2: i32s,
    found_12: i32s,
    values_1: f64s,
    values_2: f64s,
    first_12: f64s,
    second_12: f64s,
    pivots: i32s,
    starts: i64s,
    indices: i32s,
    factors: f64s,
    inverse: f64s,
    counts: i64s,
) -> i64:
    """Factorise; the window must be zero and is left so when the result is 0.

    Args:
        size, stages, variables: N, number of stages, how many of the N unknowns are variables of the problem.
        threshold: u above.
        tiny: columns no larger than this are zero pivots.
        replacement: magnitude of what replaces them: plus for variables, minus for rows.
        delay_limit: with more unknowns delayed than this, lower thresholds are accepted.
        capacity: room in ``indices`` and in ``factors``.
        stride: slots of the window.
        held_from: first slot for delayed unknowns.
        planned: whether the plan's patterns hold for this matrix.
        stage_pointers: positions of each stage, (stages + 1,).
        pointers, columns, values: the matrix (see stc.solver.kkt.values).
        order: unknown at each position, (N,).
        planned_slot: slot at each position, (N,).
        top: slots in use at each stage.
        plan_kind: 1 or 2 where a planned pivot begins, 0 for the second of a pair, -1 without plan, (N,).
        plan_start, plan_count, plan_slots: the slots of a planned pivot's column.
        state, state_starts, state_rows, state_columns: what the plan expects in the window before each stage.
        counts: results, (COUNTS,).

    Returns:
        0, 1 when the factors are full, 2 when the window is full.
    """
    for k in range(COUNTS):
        counts[k] = 0
    for k in range(stride):
        owner[k] = -1
    for k in range(size):
        slot[k] = planned_slot[k]
    starts[0] = 0
    starts[1] = 0
    held = 0
    high = held_from
    exact = planned != 0
    for stage in range(stages):
        begin = stage_pointers[stage]
        if not exact and planned != 0 and held == 0:
            # The column lists hold again as soon as nothing is in the window but what the plan expects.
            expected = state_starts[state[stage]]
            exact = 0 != _only_expected(
                top[max(stage - 1, 0)],
                state_starts[state[stage] + 1] - expected,
                state_rows[expected:],
                state_columns[expected:],
                stride,
                window,
            )
        end = stage_pointers[stage + 1]
        _assemble(begin, end, size, pointers, columns, values, slot, owner, stride, window)
        waiting = held
        for position in range(begin, end):
            queue[waiting] = position
            waiting += 1
        slots_top = top[stage]
        needed = threshold
        forced = -1
        forced_kind = 0
        while waiting > 0:
            kept = 0
            progress = False
            for place in range(waiting):
                p = queue[place]
                row_p = slot[p]
                if row_p < 0:
                    continue
                a = window[row_p * stride + row_p]
                b = 0.0
                c = 0.0
                q = -1
                kind = 0
                count = 0
                listed = found_1[0:]
                first = values_1[0:]
                second = values_2[0:]
                if exact:
                    count = plan_count[p]
                    listed = plan_slots[plan_start[p] :]
                    gather_listed(row_p, count, listed, stride, window, values_1)
                    most = largest(count, values_1)
                    if plan_kind[p] == 1:
                        if fabs(a) >= threshold * most and fabs(a) > tiny:
                            kind = 1
                    elif plan_kind[p] == 2:
                        q = p + 1
                        row_q = slot[q]
                        b = _entry(row_p, row_q, stride, window)
                        c = window[row_q * stride + row_q]
                        gather_listed(row_q, count, listed, stride, window, values_2)
                        if _pair_accepted(a, b, c, most, largest(count, values_2), threshold, tiny) != 0:
                            kind = 2
                    if kind == 0:
                        exact = False
                        counts[SCANNED] += 1
                if kind == 0:
                    listed = found_1[0:]
                    count = gather(row_p, slots_top, held_from, high, stride, window, found_1, values_1)
                    most = largest(count, values_1)
                    accepted = needed
                    if p == forced:
                        accepted = 0.0
                    if max(most, fabs(a)) <= tiny:
                        kind = 3
                    elif fabs(a) >= accepted * most and not (p == forced and forced_kind == 2):
                        kind = 1
                    else:
                        best = _partner(count, found_1, values_1, owner, end)
                        if best >= 0:
                            row_q = found_1[best]
                            q = owner[row_q]
                            b = values_1[best]
                            c = window[row_q * stride + row_q]
                            others = gather(
                                row_q, slots_top, held_from, high, stride, window, found_2, values_2
                            )
                            # The second of a pair is the one without diagonal: its zeros are kept.
                            if a == 0.0 and c != 0.0:
                                p, q = q, p
                                a, c = c, a
                                count = merge(
                                    others, found_2, values_2, row_p, count, found_1, values_1, row_q,
                                    found_12, first_12, second_12,
                                )  # fmt: skip
                            else:
                                count = merge(
                                    count, found_1, values_1, row_q, others, found_2, values_2, row_p,
                                    found_12, first_12, second_12,
                                )  # fmt: skip
                            listed = found_12[0:]
                            first = first_12[0:]
                            second = second_12[0:]
                            most = largest(count, first)
                            if _pair_accepted(a, b, c, most, largest(count, second), accepted, tiny) != 0:
                                kind = 2
                if kind == 0:
                    counts[REJECTED] += 1
                    queue[kept] = queue[place]
                    kept += 1
                    continue
                progress = True
                room = 1
                if kind == 2:
                    if a * c < b * b:
                        counts[POSITIVE] += 1
                        counts[NEGATIVE] += 1
                    else:
                        _count_sign(a, counts)
                        _count_sign(a, counts)
                    room = _take_two(
                        p, q, a, b, c, count, listed, first, second, capacity, slot, owner, stride, window,
                        spread_1, spread_2, pivots, starts, indices, factors, inverse, counts,
                    )  # fmt: skip
                else:
                    if kind == 3:
                        counts[ZERO] += 1
                        clear(row_p, count, listed, stride, window)
                        count = 0
                        a = replacement if order[p] < variables else -replacement
                    else:
                        _count_sign(a, counts)
                    room = _take_one(
                        p, a, count, listed, first, capacity, slot, owner, stride, window,
                        spread_1, pivots, starts, indices, factors, inverse, counts,
                    )  # fmt: skip
                if room == 0:
                    return FACTORS_FULL
            waiting = kept
            forced = -1
            if not progress:
                if stage == stages - 1:
                    forced = _strongest(waiting, queue, slots_top, held_from, high, stride, slot, window,
                                        found_1, values_1)  # fmt: skip
                    forced_kind = 1
                    if forced < 0:
                        forced = -1 - forced
                        forced_kind = 2
                    exact = False
                elif waiting > delay_limit and needed > LOWEST_THRESHOLD:
                    needed *= 0.1
                else:
                    break
        held = 0
        for place in range(waiting):
            p = queue[place]
            if slot[p] < 0:
                continue
            queue[held] = p
            held += 1
            if slot[p] < held_from:
                counts[DELAYED] += 1
                high = _hold(p, slots_top, held_from, high, stride, slot, owner, window, found_1, values_1)
                if high < 0:
                    return WINDOW_FULL
        if held == 0:
            high = held_from
        else:
            exact = False
    return DONE


@native
def _strongest(
    waiting: i64, queue: i32s, top: i64, low: i64, high: i64, stride: i64, slot: i32s, window: f64s,
    found: i32s, values: f64s,
) -> i64:  # fmt: skip
    """What to eliminate when all thresholds fail and nothing can be delayed (Bunch and Parlett 1971).

    Returns the position p with the largest diagonal entry, or -1 - p for a p in the row of the largest other
    entry when that is larger by far.
    """
    diagonal = -1.0
    other = -1.0
    p = queue[0]
    pair = queue[0]
    for place in range(waiting):
        row = slot[queue[place]]
        if row < 0:
            continue
        value = fabs(window[row * stride + row])
        if value > diagonal:
            diagonal = value
            p = queue[place]
        count = gather(row, top, low, high, stride, window, found, values)
        value = largest(count, values)
        if value > other:
            other = value
            pair = queue[place]
    return p if diagonal >= 0.64 * other else -1 - pair
