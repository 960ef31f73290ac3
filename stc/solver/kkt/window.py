"""The dense window of the elimination: reading a column, taking a pivot out.

The window is a symmetric matrix of which only the lower triangle is kept, row after row:

    entry of slots (i, j)  ->  window[max(i, j) * stride + min(i, j)]

Slots that hold no unknown are zero throughout, so that loops may run over them without looking.
A column is gathered as a list of slots, in increasing order, and their values.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, fabs, i32s, i64, native

__all__ = [
    "LANES",
    "clear",
    "entry",
    "gather",
    "gather_listed",
    "largest",
    "merge",
    "subtract_one",
    "subtract_two",
]

#: Larger than any slot.
NO_SLOT = 1099511627776
#: Rows are padded to whole vectors.
LANES = 8
#: A row is updated as a whole rather than entry by entry when it has at most this many entries per listed one.
DENSE_RATIO = 6


@native(inline=True)
def entry(i: i64, j: i64, stride: i64, window: f64s) -> f64:
    """Entry at two slots."""
    return window[max(i, j) * stride + min(i, j)]


@native(small=True)
def gather(
    slot: i64, top: i64, low: i64, high: i64, stride: i64, window: f64s, found: i32s, values: f64s
) -> i64:
    """List the nonzeros of a column among the slots below ``top`` and from ``low`` to ``high``; their number."""
    count = 0
    row = window[slot * stride :]
    for k in range(min(slot, top)):
        value = row[k]
        found[count] = k
        values[count] = value
        count += value != 0.0
    for k in range(slot + 1, top):
        value = window[k * stride + slot]
        found[count] = k
        values[count] = value
        count += value != 0.0
    for k in range(low, min(slot, high)):
        value = row[k]
        found[count] = k
        values[count] = value
        count += value != 0.0
    for k in range(max(slot + 1, low), high):
        value = window[k * stride + slot]
        found[count] = k
        values[count] = value
        count += value != 0.0
    return count


@native(small=True)
def gather_listed(slot: i64, count: i64, listed: i32s, stride: i64, window: f64s, values: f64s) -> None:
    """Values of a column at the listed slots (the column's own is not among them)."""
    below = 0
    row = window[slot * stride :]
    while below < count and listed[below] < slot:
        values[below] = row[listed[below]]
        below += 1
    for k in range(below, count):
        values[k] = window[listed[k] * stride + slot]


@native(small=True)
def largest(count: i64, values: f64s) -> f64:
    """Largest magnitude of a column."""
    most = 0.0
    for k in range(count):
        most = max(most, fabs(values[k]))
    return most


@native(small=True)
def clear(slot: i64, count: i64, listed: i32s, stride: i64, window: f64s) -> None:
    """Set a column to zero at the listed slots and on the diagonal."""
    row = slot * stride
    window[row + slot] = 0.0
    for k in range(count):
        other = listed[k]
        if other < slot:
            window[row + other] = 0.0
        else:
            window[other * stride + slot] = 0.0


@native(small=True)
def merge(
    count_1: i64,
    found_1: i32s,
    values_1: f64s,
    skip_1: i64,
    count_2: i64,
    found_2: i32s,
    values_2: f64s,
    skip_2: i64,
    found: i32s,
    first: f64s,
    second: f64s,
) -> i64:
    """Bring two columns to their common list of slots, leaving out one slot of each; its length."""
    count = 0
    i = 0
    j = 0
    while i < count_1 or j < count_2:
        a = found_1[i] if i < count_1 else NO_SLOT
        b = found_2[j] if j < count_2 else NO_SLOT
        if a == skip_1 and i < count_1:
            i += 1
            continue
        if b == skip_2 and j < count_2:
            j += 1
            continue
        found[count] = min(a, b)
        first[count] = 0.0
        second[count] = 0.0
        if a <= b:
            first[count] = values_1[i]
            i += 1
        if b <= a:
            second[count] = values_2[j]
            j += 1
        count += 1
    return count


@native(fast=True, small=True)
def _subtract_row(blocks: i64, factor: f64, column: f64s, row: f64s) -> None:
    for k in range(blocks * LANES):
        row[k] -= factor * column[k]


@native(fast=True, small=True)
def subtract_one(
    count: i64, listed: i32s, values: f64s, factors: f64s, stride: i64, spread: f64s, window: f64s
) -> None:
    """``window -= factors values^T`` on the listed slots; ``spread`` (stride,) is zero before and after."""
    if listed[max(count - 1, 0)] >= count * DENSE_RATIO:
        for k in range(count):
            factor = factors[k]
            row = window[listed[k] * stride :]
            for other in range(k + 1):
                row[listed[other]] -= factor * values[other]
        return
    for k in range(count):
        spread[listed[k]] = values[k]
    for k in range(count):
        slot = listed[k]
        _subtract_row(slot // LANES + 1, factors[k], spread, window[slot * stride :])
    for k in range(count):
        spread[listed[k]] = 0.0


@native(fast=True, small=True)
def _subtract_row_two(
    blocks: i64, factor_1: f64, column_1: f64s, factor_2: f64, column_2: f64s, row: f64s
) -> None:
    for k in range(blocks * LANES):
        row[k] -= factor_1 * column_1[k] + factor_2 * column_2[k]


@native(fast=True, small=True)
def subtract_two(
    count: i64,
    listed: i32s,
    first: f64s,
    second: f64s,
    factors_1: f64s,
    factors_2: f64s,
    stride: i64,
    spread_1: f64s,
    spread_2: f64s,
    window: f64s,
) -> None:
    """``window -= factors_1 first^T + factors_2 second^T`` on the listed slots.

    Where the first of a pair is zero its product is left out, which keeps zeros exact.
    """
    if listed[max(count - 1, 0)] >= count * DENSE_RATIO:
        for k in range(count):
            factor_1 = factors_1[k]
            factor_2 = factors_2[k]
            row = window[listed[k] * stride :]
            if factor_1 == 0.0:
                for other in range(k + 1):
                    row[listed[other]] -= factor_2 * second[other]
            else:
                for other in range(k + 1):
                    row[listed[other]] -= factor_1 * first[other] + factor_2 * second[other]
        return
    for k in range(count):
        spread_1[listed[k]] = first[k]
        spread_2[listed[k]] = second[k]
    for k in range(count):
        slot = listed[k]
        row = window[slot * stride :]
        if factors_1[k] == 0.0:
            _subtract_row(slot // LANES + 1, factors_2[k], spread_2, row)
        else:
            _subtract_row_two(slot // LANES + 1, factors_1[k], spread_1, factors_2[k], spread_2, row)
    for k in range(count):
        spread_1[listed[k]] = 0.0
        spread_2[listed[k]] = 0.0
