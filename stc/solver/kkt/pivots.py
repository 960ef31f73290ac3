"""Pivots of one and two unknowns: which are acceptable, and taking them out of the window.

Factors: pivot k takes out the positions ``pivots[2 k]`` and, when 2x2, ``pivots[2 k + 1]`` (otherwise -1).  Its
rows, ``starts[2 k + 1]`` of them, begin at ``indices[starts[2 k]]``; their factors follow those of the pivot before:
when 2x2 those of the first unknown, then those of the second.  ``inverse[3 k:3 k + 3]`` is D^-1 as (pp, pq, qq).

Leaves are unknowns whose columns are still as in the matrix when they are eliminated.  Nothing is stored for them:
``starts[2 k + 1]`` is -1 less their rows, which are ``columns[starts[2 k]]`` and on, and their factors the values there
times D^-1.

``growth`` of a slot is the largest product subtracted from its column so far, at least 1: what remains of a column
after cancellation is worth no more than rounding errors of that size.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native
from stc.solver.kkt.window import clear, gather, largest, merge, subtract_one, subtract_two

__all__ = [
    "COUNTS",
    "DELAYED",
    "FACTORS",
    "INDICES",
    "NEGATIVE",
    "PIVOTS",
    "POSITIVE",
    "REJECTED",
    "STRAYED",
    "ZERO",
    "best_partner",
    "pair_accepted",
    "pair_up",
    "place_of",
    "reciprocal_determinant",
    "strongest",
    "take_one",
    "take_two",
]

#: Places in ``counts``: pivots taken, entries of indices and of factors used, eigenvalues by sign, unknowns delayed
#: to another stage, candidates rejected, stages that left the plan.
PIVOTS = 0
INDICES = 1
FACTORS = 2
POSITIVE = 3
NEGATIVE = 4
ZERO = 5
DELAYED = 6
REJECTED = 7
STRAYED = 8
COUNTS = 9

#: A 2x2 pivot needs a determinant of at least this much of its larger product.
CANCELLATION = 1e-3
#: The larger share of the diagonal for which Bunch and Parlett prefer a 1x1 pivot.
BUNCH_PARLETT = 0.64


@native(inline=True)
def pair_accepted(a: f64, b: f64, c: f64, most_p: f64, most_q: f64, threshold: f64, tiny: f64) -> i64:
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


@native(inline=True)
def reciprocal_determinant(a: f64, b: f64, c: f64) -> f64:
    """``1 / (a c - b^2)``, divided by the largest entry first: it must not overflow nor vanish on the way."""
    scale = 1.0 / max(max(fabs(a), fabs(c)), fabs(b))
    return scale / ((a * scale) * c - (b * scale) * b)


@native(small=True)
def best_partner(count: i64, found: i32s, values: f64s, owner: i32s, last: i64) -> i64:
    """Place in the list of the largest entry among positions before ``last``, or -1."""
    best = -1
    most = 0.0
    for k in range(count):
        value = fabs(values[k])
        if value > most and owner[found[k]] < last:
            most = value
            best = k
    return best


@native(small=True)
def place_of(slot: i64, count: i64, found: i32s) -> i64:
    """Place of a slot in a list, or -1."""
    place = -1
    for k in range(count):
        if found[k] == slot:
            place = k
    return place


@native(small=True)
def pair_up(
    row_p: i64, row_q: i64, a: f64, b: f64, c: f64, swapped: i64, threshold: f64, noise: f64, count: i64,
    found_1: i32s, values_1: f64s, top: i64, low: i64, high: i64, stride: i64, window: f64s, found_2: i32s,
    values_2: f64s, found: i32s, first: f64s, second: f64s,
) -> i64:  # fmt: skip
    """Bring the columns of two slots to a common list, and judge the pivot; the list's length, or -1.

    The column of ``row_p`` is already in ``found_1`` and ``values_1``. It is the second one when ``swapped``: the
    second of a pair should be the one without diagonal, whose zeros are kept.
    """
    others = gather(row_q, top, low, high, stride, window, found_2, values_2)
    union = 0
    if swapped != 0:
        union = merge(others, found_2, values_2, row_p, count, found_1, values_1, row_q, found, first, second)
    else:
        union = merge(count, found_1, values_1, row_q, others, found_2, values_2, row_p, found, first, second)
    most_p = largest(union, first)
    most_q = largest(union, second)
    good = 0
    if swapped != 0:
        good = pair_accepted(c, b, a, most_p, most_q, threshold, noise)
    else:
        good = pair_accepted(a, b, c, most_p, most_q, threshold, noise)
    return union if good != 0 else -1


@native(small=True)
def take_one(
    p: i64, d: f64, most: f64, count: i64, listed: i32s, first: f64s, capacity: i64, slot: i32s, owner: i32s,
    growth: f64s, stride: i64, window: f64s, spread: f64s, pivots: i32s, starts: i32s, indices: i32s,
    factors: f64s, inverse: f64s, counts: i64s,
) -> i64:  # fmt: skip
    """Eliminate a 1x1 pivot, whose column is ``first`` at the slots ``listed``; 0 when the factors are full."""
    k = counts[PIVOTS]
    at = counts[INDICES]
    value_at = counts[FACTORS]
    if at + count > capacity or value_at + count > capacity:
        return 0
    reciprocal = 1.0 / d
    own = indices[at:]
    column = factors[value_at:]
    for e in range(count):
        other = listed[e]
        factor = first[e] * reciprocal
        own[e] = owner[other]
        column[e] = factor
        growth[other] = max(growth[other], fabs(factor) * most)
    clear(slot[p], count, listed, stride, window)
    subtract_one(count, listed, first, column, stride, spread, window)
    pivots[2 * k] = p
    pivots[2 * k + 1] = -1
    inverse[3 * k] = reciprocal
    starts[2 * k] = at
    starts[2 * k + 1] = count
    counts[POSITIVE if d > 0.0 else NEGATIVE] += 1
    counts[PIVOTS] = k + 1
    counts[INDICES] = at + count
    counts[FACTORS] = value_at + count
    return 1


@native(small=True)
def take_two(
    p: i64, q: i64, a: f64, b: f64, c: f64, count: i64, listed: i32s, first: f64s, second: f64s,
    capacity: i64, slot: i32s, owner: i32s, growth: f64s, stride: i64, window: f64s, spread_1: f64s,
    spread_2: f64s, pivots: i32s, starts: i32s, indices: i32s, factors: f64s, inverse: f64s, counts: i64s,
) -> i64:  # fmt: skip
    """Eliminate the 2x2 pivot [[a, b], [b, c]] with b != 0; 0 when the factors are full."""
    k = counts[PIVOTS]
    at = counts[INDICES]
    value_at = counts[FACTORS]
    if at + count > capacity or value_at + 2 * count > capacity:
        return 0
    ratio = reciprocal_determinant(a, b, c)
    inverse_pp = c * ratio
    inverse_pq = -b * ratio
    inverse_qq = a * ratio
    most_p = largest(count, first)
    most_q = largest(count, second)
    own = indices[at:]
    column = factors[value_at:]
    for e in range(count):
        other = listed[e]
        factor_1 = inverse_pp * first[e] + inverse_pq * second[e]
        factor_2 = inverse_pq * first[e] + inverse_qq * second[e]
        own[e] = owner[other]
        column[e] = factor_1
        column[count + e] = factor_2
        growth[other] = max(growth[other], fabs(factor_1) * most_p + fabs(factor_2) * most_q)
    row_p = slot[p]
    row_q = slot[q]
    clear(row_p, count, listed, stride, window)
    clear(row_q, count, listed, stride, window)
    window[max(row_p, row_q) * stride + min(row_p, row_q)] = 0.0
    subtract_two(count, listed, first, second, column, column[count:], stride, spread_1, spread_2, window)
    pivots[2 * k] = p
    pivots[2 * k + 1] = q
    inverse[3 * k] = inverse_pp
    inverse[3 * k + 1] = inverse_pq
    inverse[3 * k + 2] = inverse_qq
    starts[2 * k] = at
    starts[2 * k + 1] = count
    if a * c < b * b:
        counts[POSITIVE] += 1
        counts[NEGATIVE] += 1
    else:
        counts[POSITIVE if a > 0.0 else NEGATIVE] += 2
    counts[PIVOTS] = k + 1
    counts[INDICES] = at + count
    counts[FACTORS] = value_at + 2 * count
    return 1


@native(small=True)
def strongest(
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
    return p if diagonal >= BUNCH_PARLETT * other else -1 - pair
