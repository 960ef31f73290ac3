"""A panel: the columns of several pivots out of the window at once, and one update of the window by all of them.

    group       k1 k2 k3 | rows r1 r2 r3 ...         row t of ``panel`` is the column of pivot t: what is left of it
                                                     when the pivots before have been taken out; row t of
                ( d . .  |  .  .  .  )               ``lower`` is the same times D^-1, the factors.
                ( . d .  |  .  .  .  )
                ( . . d  |  .  .  .  )               window[rows, rows] -= lower[:, rows]^T panel[:, rows]

Inside the group, pivots that fail the threshold test are tried again after the others and with other partners: where
the plan has all of rows x rows filled, the order inside a group is free.  Rows are padded to whole vectors.
"""

from __future__ import annotations

import numpy as np

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native
from stc.codegen.native_vector import abs8, largest8, load8, max8, splat8, store8, wide
from stc.solver.kkt.pivots import (
    FACTORS,
    INDICES,
    NEGATIVE,
    PIVOTS,
    POSITIVE,
    pair_accepted,
    reciprocal_determinant,
)

__all__ = ["CHANGED", "LARGEST_GROUP", "MASKS", "VECTOR", "take_group"]

#: Numbers of a vector.
VECTOR = 8
#: Row k of these, eight numbers each, keeps the entries of a vector after k; the last one keeps all.
MASKS = np.vstack([np.triu(np.ones((VECTOR, VECTOR)), 1), np.ones(VECTOR)]).reshape(-1)
#: Added to the number of those eliminated when the order was not as planned.
CHANGED = 1000
#: Room for members of a group.
LARGEST_GROUP = 32


@native(small=True)
def _gather(
    members: i64, slots: i32s, count: i64, rows: i32s, length: i64, stride: i64, window: f64s, panel: f64s,
) -> None:  # fmt: skip
    """Move the members' columns to the panel, leaving zeros."""
    for k in range(members):
        own = slots[k]
        store8(panel, (k + 1) * length - VECTOR, splat8(0.0))
        for j in range(k + 1):
            other = slots[j]
            at = max(own, other) * stride + min(own, other)
            value = window[at]
            window[at] = 0.0
            panel[k * length + j] = value
            panel[j * length + k] = value
        out = panel[k * length + members :]
        row = window[own * stride :]
        column = window[own:]
        below = 0
        while below < count and rows[below] < own:
            other = rows[below]
            out[below] = row[other]
            row[other] = 0.0
            below += 1
        for e in range(below, count):
            other = rows[e] * stride
            out[e] = column[other]
            column[other] = 0.0


@native(small=True)
def _put_back(
    first: i64, members: i64, slots: i32s, count: i64, rows: i32s, length: i64, stride: i64, window: f64s,
    panel: f64s,
) -> None:  # fmt: skip
    """Return the columns of the members from ``first`` to the window."""
    for k in range(first, members):
        own = slots[k]
        out = panel[k * length :]
        for j in range(first, k + 1):
            other = slots[j]
            window[max(own, other) * stride + min(own, other)] = out[j]
        for e in range(count):
            other = rows[e]
            window[max(own, other) * stride + min(own, other)] = out[members + e]


@native
def _largest(begin: i64, end: i64, mask: f64s, row: f64s) -> f64:
    """Largest magnitude in some vectors of a row, of which the first is multiplied with ``mask``."""
    first = load8(row, begin) * load8(mask, 0)
    store8(row, begin, first)
    most = abs8(first)
    for at in range(begin + VECTOR, end, VECTOR):
        most = max8(most, abs8(load8(row, at)))
    return largest8(most)


@native(fast=True)
def _bring(taken: i64, place: i64, begin: i64, length: i64, lower: f64s, panel: f64s, row: f64s) -> None:
    """Subtract from the row at ``place`` what the pivots taken leave there; from column ``begin`` on."""
    for at in range(begin, length, VECTOR):
        total = load8(row, at)
        other = splat8(0.0)
        for t in range(0, (taken - 1) * length, 2 * length):
            total -= lower[t + place] * load8(panel, t + at)
            other -= lower[t + length + place] * load8(panel, t + length + at)
        if taken % 2 != 0:
            t = (taken - 1) * length
            total -= lower[t + place] * load8(panel, t + at)
        store8(row, at, total + other)


@native(fast=True)
def _subtract(begin: i64, end: i64, factor: f64, column: f64s, row: f64s) -> None:
    for at in range(begin, end, VECTOR):
        store8(row, at, load8(row, at) - factor * load8(column, at))


@native(fast=True)
def _subtract_pair(
    begin: i64, end: i64, factor_1: f64, column_1: f64s, factor_2: f64, column_2: f64s, row: f64s
) -> None:
    for at in range(begin, end, VECTOR):
        store8(row, at, load8(row, at) - factor_1 * load8(column_1, at) - factor_2 * load8(column_2, at))


@native(fast=True)
def _scale(
    begin: i64, end: i64, reciprocal: f64, most: f64, column: f64s, factors: f64s, growth: f64s
) -> None:
    for at in range(begin, end, VECTOR):
        factor = reciprocal * load8(column, at)
        store8(factors, at, factor)
        store8(growth, at, max8(load8(growth, at), most * abs8(factor)))


@native(fast=True)
def _scale_pair(
    begin: i64, end: i64, inverse_pp: f64, inverse_pq: f64, inverse_qq: f64, most_p: f64, most_q: f64,
    column_1: f64s, column_2: f64s, factors_1: f64s, factors_2: f64s, growth: f64s,
) -> None:  # fmt: skip
    for at in range(begin, end, VECTOR):
        one = load8(column_1, at)
        other = load8(column_2, at)
        factor_1 = inverse_pp * one + inverse_pq * other
        factor_2 = inverse_pq * one + inverse_qq * other
        store8(factors_1, at, factor_1)
        store8(factors_2, at, factor_2)
        store8(growth, at, max8(load8(growth, at), most_p * abs8(factor_1) + most_q * abs8(factor_2)))


@native(small=True)
def _swap(
    i: i64, j: i64, members: i64, length: i64, slots: i32s, growth: f64s, panel: f64s, lower: f64s
) -> None:
    """Exchange two members that are not taken yet, also in the factors of those that are."""
    if i == j:
        return
    slot = slots[i]
    slots[i] = slots[j]
    slots[j] = slot
    value = growth[i]
    growth[i] = growth[j]
    growth[j] = value
    for k in range(length):
        value = panel[i * length + k]
        panel[i * length + k] = panel[j * length + k]
        panel[j * length + k] = value
    for k in range(members):
        value = panel[k * length + i]
        panel[k * length + i] = panel[k * length + j]
        panel[k * length + j] = value
    for k in range(i):
        value = lower[k * length + i]
        lower[k * length + i] = lower[k * length + j]
        lower[k * length + j] = value


@native(small=True)
def _most_but(first: i64, last: i64, p: i64, q: i64, row: f64s) -> f64:
    """Largest magnitude of a row from ``first``, without two places."""
    most = 0.0
    for k in range(first, last):
        if k != p and k != q:
            most = max(most, fabs(row[k]))
    return most


@native(small=True)
def _search(
    done: i64, members: i64, last: i64, length: i64, threshold: f64, tiny: f64, slots: i32s, growth: f64s,
    panel: f64s, lower: f64s,
) -> i64:  # fmt: skip
    """Bring a pivot of one or two unknowns that passes the test to place ``done``; its size, or 0."""
    for p in range(done, members):
        row = panel[p * length :]
        most = _most_but(done, last, p, p, row)
        if fabs(row[p]) >= threshold * most and fabs(row[p]) > tiny * growth[p]:
            _swap(done, p, members, length, slots, growth, panel, lower)
            return 1
    for p in range(done, members):
        row = panel[p * length :]
        q = -1
        most = 0.0
        for k in range(done, members):
            if k != p and fabs(row[k]) > most:
                most = fabs(row[k])
                q = k
        if q >= 0:
            other = panel[q * length :]
            most_p = _most_but(done, last, p, q, row)
            most_q = _most_but(done, last, p, q, other)
            noise = tiny * max(growth[p], growth[q])
            if pair_accepted(row[p], row[q], other[q], most_p, most_q, threshold, noise) != 0:
                # The one without diagonal comes second: its zeros stay zeros.
                second = q
                first = p
                if row[p] == 0.0 and other[q] != 0.0:
                    second = p
                    first = q
                _swap(done, first, members, length, slots, growth, panel, lower)
                if second == done:
                    second = first
                _swap(done + 1, second, members, length, slots, growth, panel, lower)
                return 2
    return 0


@native(fast=True, inline=True)
def _tile(taken: i64, length: i64, lower: f64s, panel: f64s, sums: f64s) -> None:
    """Eight by eight of the products: ``sums[k * length:]`` for rows k of ``lower`` at the given columns."""
    sum_0 = splat8(0.0)
    sum_1 = splat8(0.0)
    sum_2 = splat8(0.0)
    sum_3 = splat8(0.0)
    sum_4 = splat8(0.0)
    sum_5 = splat8(0.0)
    sum_6 = splat8(0.0)
    sum_7 = splat8(0.0)
    for at in range(0, taken * length, length):
        row = load8(panel, at)
        sum_0 += lower[at] * row
        sum_1 += lower[at + 1] * row
        sum_2 += lower[at + 2] * row
        sum_3 += lower[at + 3] * row
        sum_4 += lower[at + 4] * row
        sum_5 += lower[at + 5] * row
        sum_6 += lower[at + 6] * row
        sum_7 += lower[at + 7] * row
    store8(sums, 0, sum_0)
    store8(sums, length, sum_1)
    store8(sums, 2 * length, sum_2)
    store8(sums, 3 * length, sum_3)
    store8(sums, 4 * length, sum_4)
    store8(sums, 5 * length, sum_5)
    store8(sums, 6 * length, sum_6)
    store8(sums, 7 * length, sum_7)


@native(fast=True, inline=True)
def _half_tile(taken: i64, length: i64, lower: f64s, panel: f64s, sums: f64s) -> None:
    """Four by eight of the products."""
    sum_0 = splat8(0.0)
    sum_1 = splat8(0.0)
    sum_2 = splat8(0.0)
    sum_3 = splat8(0.0)
    for at in range(0, taken * length, length):
        row = load8(panel, at)
        sum_0 += lower[at] * row
        sum_1 += lower[at + 1] * row
        sum_2 += lower[at + 2] * row
        sum_3 += lower[at + 3] * row
    store8(sums, 0, sum_0)
    store8(sums, length, sum_1)
    store8(sums, 2 * length, sum_2)
    store8(sums, 3 * length, sum_3)


@native(fast=True)
def _update(
    taken: i64, members: i64, count: i64, rows: i32s, length: i64, stride: i64, panel: f64s, lower: f64s,
    sums: f64s, window: f64s,
) -> None:  # fmt: skip
    """``window[rows, rows] -= lower^T panel``, the first ``taken`` rows of these."""
    first = members // VECTOR * VECTOR
    for begin in range(first, members + count, VECTOR):
        for at in range(first, begin + VECTOR, VECTOR):
            if wide() == VECTOR:
                _tile(taken, length, lower[begin:], panel[at:], sums[at:])
            else:  # all of a tile would not fit the registers
                _half_tile(taken, length, lower[begin:], panel[at:], sums[at:])
                _half_tile(taken, length, lower[begin + 4 :], panel[at:], sums[at + 4 * length :])
        for k in range(max(begin, members), min(begin + VECTOR, members + count)):
            row = window[rows[k - members] * stride :]
            own = sums[(k - begin) * length + members :]
            for j in range(k - members + 1):
                row[rows[j]] -= own[j]


@native(small=True)
def take_group(
    planned: i64, members: i64, who: i32s, count: i64, rows: i32s, kinds: i32s, stage: i64, threshold: f64, tiny: f64,
    capacity: i64, stride: i64, window: f64s, slot: i32s, owner: i32s, growth: f64s, slots: i32s, panel: f64s,
    lower: f64s, rise: f64s, sums: f64s, masks: f64s, pivots: i32s, starts: i32s, indices: i32s, factors: f64s,
    inverse: f64s, counts: i64s,
) -> i64:  # fmt: skip
    """Eliminate the positions ``who`` (members,), whose columns have their entries at ``rows``.

    Args:
        kinds: 1 or 2 where a planned pivot begins, (planned,): of the first of the members.
        slots: work space, (members,); panel, lower: the same, (members * padded length,); rise: the
            same, (padded length,); sums: the same, (8 * padded length,).
        masks: see ``MASKS``.

    Returns:
        How many could be eliminated, CHANGED more when not in the planned order; -1 when the factors are full.
    """
    last = members + count
    length = (last + VECTOR - 1) // VECTOR * VECTOR
    if counts[INDICES] + last > capacity or counts[FACTORS] + members * last + VECTOR > capacity:
        return -1
    for k in range(members):
        slots[k] = slot[who[k]]
        rise[k] = growth[slots[k]]
    for e in range(count):
        rise[members + e] = growth[rows[e]]
    for k in range(last, length):
        rise[k] = 1.0
    _gather(members, slots, count, rows, length, stride, window, panel)
    done = 0
    as_planned = True
    lazy = True
    number = counts[PIVOTS]
    value_at = counts[FACTORS]
    index_at = counts[INDICES]
    while done < members:
        kind = 0
        begin = done // VECTOR * VECTOR
        row = panel[done * length :]
        a = row[done]
        b = 0.0
        c = 0.0
        most = 0.0
        most_q = 0.0
        if done >= planned or kinds[min(done, planned - 1)] < 1:
            as_planned = False
        if as_planned:
            kind = kinds[done]
            _bring(done, done, begin, length, lower, panel, row)
            a = row[done]
            if kind == 1:
                most = _largest(begin, length, masks[(done - begin) * VECTOR :], row)
                if fabs(a) < threshold * most or fabs(a) <= tiny * rise[done]:
                    kind = 0
            else:
                other = panel[(done + 1) * length :]
                _bring(done, done + 1, begin, length, lower, panel, other)
                b = row[done + 1]
                c = other[done + 1]
                if done + 1 == begin + VECTOR:
                    row[done + 1] = 0.0
                    other[done + 1] = 0.0
                mask = masks[min(done + 1 - begin, VECTOR - 1) * VECTOR :]
                most = _largest(begin, length, mask, row)
                most_q = _largest(begin, length, mask, other)
                noise = tiny * max(rise[done], rise[done + 1])
                if pair_accepted(a, b, c, most, most_q, threshold, noise) == 0:
                    kind = 0
                    row[done + 1] = b
                    other[done] = b
                    other[done + 1] = c
            if kind == 0:
                row[done] = a
        if kind == 0 and lazy:
            # From here on all the rows are kept up to date.
            first = done
            if as_planned:
                first = done + max(kinds[done], 1)
            for k in range(first, members):
                _bring(done, k, begin, length, lower, panel, panel[k * length :])
            lazy = False
            as_planned = False
        if kind == 0:
            kind = _search(done, members, last, length, threshold, tiny, slots, rise, panel, lower)
            if kind == 0:
                break
            a = row[done]
            for k in range(begin, done + 1):
                row[k] = 0.0
            if kind == 2:
                other = panel[(done + 1) * length :]
                b = row[done + 1]
                c = other[done + 1]
                row[done + 1] = 0.0
                for k in range(begin, done + 2):
                    other[k] = 0.0
                most_q = _largest(begin, length, masks[VECTOR * VECTOR :], other)
            most = _largest(begin, length, masks[VECTOR * VECTOR :], row)
        factors_1 = lower[done * length :]
        if kind == 1:
            reciprocal = 1.0 / a
            _scale(begin, length, reciprocal, most, row, factors_1, rise)
            for k in range(members if lazy else done + 1, members):
                factor = factors_1[k]
                if factor != 0.0:
                    _subtract(begin, length, factor, row, panel[k * length :])
            inverse[3 * number] = reciprocal
            counts[POSITIVE if a > 0.0 else NEGATIVE] += 1
        else:
            other = panel[(done + 1) * length :]
            factors_2 = lower[(done + 1) * length :]
            ratio = reciprocal_determinant(a, b, c)
            inverse_pp = c * ratio
            inverse_pq = -b * ratio
            inverse_qq = a * ratio
            _scale_pair(
                begin, length, inverse_pp, inverse_pq, inverse_qq, most, most_q, row, other, factors_1, factors_2,
                rise,
            )  # fmt: skip
            for k in range(members if lazy else done + 2, members):
                factor = factors_1[k]
                factor_q = factors_2[k]
                if factor != 0.0 or factor_q != 0.0:
                    _subtract_pair(begin, length, factor, row, factor_q, other, panel[k * length :])
            inverse[3 * number] = inverse_pp
            inverse[3 * number + 1] = inverse_pq
            inverse[3 * number + 2] = inverse_qq
            if a * c < b * b:
                counts[POSITIVE] += 1
                counts[NEGATIVE] += 1
            else:
                counts[POSITIVE if a > 0.0 else NEGATIVE] += 2
        # Whether the pivot has one or two unknowns is kept here until all are known.
        pivots[2 * number + 1] = kind
        number += 1
        done += kind
    if done > 0:
        _update(done, members, count, rows, length, stride, panel, lower, sums, window)
    own = indices[index_at:]
    for k in range(members):
        own[k] = owner[slots[k]]
    for e in range(count):
        own[members + e] = owner[rows[e]]
        growth[rows[e]] = rise[members + e]
    at = 0
    for k in range(counts[PIVOTS], number):
        size = pivots[2 * k + 1]
        rest = last - at - size
        pivots[2 * k] = own[at]
        pivots[2 * k + 1] = own[at + 1] if size == 2 else -1
        starts[2 * k] = index_at + at + size
        starts[2 * k + 1] = rest
        for part in range(size):
            source = (at + part) * length + at + size
            for e in range(0, rest, VECTOR):
                store8(factors, value_at + e, load8(lower, source + e))
            value_at += rest
            slot[own[at + part]] = -1 - stage
        at += size
    if done < members:
        for k in range(done, members):
            growth[slots[k]] = rise[k]
        _put_back(done, members, slots, count, rows, length, stride, window, panel)
    counts[PIVOTS] = number
    counts[INDICES] = index_at + last
    counts[FACTORS] = value_at
    return done if as_planned else CHANGED + done
