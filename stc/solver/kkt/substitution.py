"""Solving with the factors of stc.solver.kkt.elimination, and refining against the matrix itself."""

from __future__ import annotations

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native
from stc.codegen.native_vector import load8, splat8, store8, sum8
from stc.solver.kkt.values import residual

__all__ = ["REPORT", "solve", "substitute"]

#: Columns of fewer entries are gone through one by one.
LONG = 20
#: Length of ``report``: relative residual, refinements made, and of the scaled system, solution over right-hand side.
REPORT = 3
#: Residuals are relative to the right-hand side plus the solution, or this much of the right-hand side.
LARGEST_GAIN = 1e6


@native(small=True)
def _linked(k: i64, pivots: i32s, starts: i32s, indices: i32s) -> i64:
    """Whether pivot k's rows are those of the one before less k's own unknowns, which come first among these."""
    begin = starts[2 * k - 2]
    size = 2 if pivots[2 * k + 1] >= 0 else 1
    length = starts[2 * k + 1]
    if length < 0 or starts[2 * k] != begin + size or length != starts[2 * k - 1] - size:
        return 0
    return indices[begin] == pivots[2 * k] and (size == 1 or indices[begin + 1] == pivots[2 * k + 1])


@native(small=True)
def _collect(k: i64, pivots: i32s, starts: i32s, indices: i32s, x: f64s, part: f64s) -> i64:
    """Copy what belongs to pivot k and its rows to ``part``; how many numbers that is."""
    size = 1
    part[0] = x[pivots[2 * k]]
    if pivots[2 * k + 1] >= 0:
        size = 2
        part[1] = x[pivots[2 * k + 1]]
    length = starts[2 * k + 1]
    own = indices[starts[2 * k] :]
    rows = part[size:]
    for e in range(length):
        rows[e] = x[own[e]]
    return size + length


@native(fast=True, small=True)
def substitute(
    count: i64, columns: i32s, upper: f64s, pivots: i32s, starts: i32s, indices: i32s, factors: f64s,
    inverse: f64s, x: f64s, part: f64s,
) -> None:  # fmt: skip
    """Overwrite ``x`` with the solution of L D L^T x = x; ``upper`` are the entries at ``columns``.

    Pivots of a panel share their rows: where these are many, what belongs to them is copied to ``part`` and back once.
    There is room for a vector more in ``factors`` and ``part``.
    """
    value_at = 0
    k = 0
    while k < count:
        length = starts[2 * k + 1]
        if length < 0:
            own = columns[starts[2 * k] :]
            column = upper[starts[2 * k] :]
            scaled = x[pivots[2 * k]] * inverse[3 * k]
            for e in range(-1 - length):
                x[own[e]] -= column[e] * scaled
            x[pivots[2 * k]] = scaled
            k += 1
            continue
        if length < LONG:
            own = indices[starts[2 * k] :]
            column = factors[value_at:]
            p = pivots[2 * k]
            q = pivots[2 * k + 1]
            value_p = x[p]
            value_at += length
            if q < 0:
                for e in range(length):
                    x[own[e]] -= column[e] * value_p
                x[p] = inverse[3 * k] * value_p
            else:
                value_at += length
                value_q = x[q]
                other = column[length:]
                for e in range(length):
                    x[own[e]] -= column[e] * value_p + other[e] * value_q
                x[p] = inverse[3 * k] * value_p + inverse[3 * k + 1] * value_q
                x[q] = inverse[3 * k + 1] * value_p + inverse[3 * k + 2] * value_q
            k += 1
            continue
        first = k
        _collect(k, pivots, starts, indices, x, part)
        at = 0
        while k < count and (k == first or _linked(k, pivots, starts, indices) != 0):
            length = starts[2 * k + 1]
            value_p = part[at]
            if pivots[2 * k + 1] < 0:
                at += 1
                for e in range(0, length, 8):
                    store8(part, at + e, load8(part, at + e) - value_p * load8(factors, value_at + e))
                part[at - 1] = inverse[3 * k] * value_p
            else:
                value_q = part[at + 1]
                at += 2
                other = factors[value_at + length :]
                for e in range(0, length, 8):
                    change = value_p * load8(factors, value_at + e) + value_q * load8(other, e)
                    store8(part, at + e, load8(part, at + e) - change)
                part[at - 2] = inverse[3 * k] * value_p + inverse[3 * k + 1] * value_q
                part[at - 1] = inverse[3 * k + 1] * value_p + inverse[3 * k + 2] * value_q
                value_at += length
            value_at += length
            k += 1
        own = indices[starts[2 * first] :]
        x[pivots[2 * first]] = part[0]
        rows = part[1:]
        if pivots[2 * first + 1] >= 0:
            x[pivots[2 * first + 1]] = part[1]
            rows = part[2:]
        for e in range(starts[2 * first + 1]):
            x[own[e]] = rows[e]
    store8(factors, value_at, 0.0)
    k = count - 1
    while k >= 0:
        length = starts[2 * k + 1]
        if length < 0:
            own = columns[starts[2 * k] :]
            column = upper[starts[2 * k] :]
            total = 0.0
            for e in range(-1 - length):
                total += column[e] * x[own[e]]
            x[pivots[2 * k]] -= inverse[3 * k] * total
            k -= 1
            continue
        if length < LONG:
            own = indices[starts[2 * k] :]
            value_at -= length
            q = pivots[2 * k + 1]
            if q >= 0:
                total = x[q]
                column = factors[value_at:]
                for e in range(length):
                    total -= column[e] * x[own[e]]
                x[q] = total
                value_at -= length
            total = x[pivots[2 * k]]
            column = factors[value_at:]
            for e in range(length):
                total -= column[e] * x[own[e]]
            x[pivots[2 * k]] = total
            k -= 1
            continue
        first = k
        while first > 0 and starts[2 * first - 1] >= 0 and _linked(first, pivots, starts, indices) != 0:
            first -= 1
        end = _collect(first, pivots, starts, indices, x, part)
        store8(part, end, 0.0)
        while k >= first:
            length = starts[2 * k + 1]
            at = end - length
            value_at -= length
            sums = splat8(0.0)
            for e in range(0, length, 8):
                sums += load8(part, at + e) * load8(factors, value_at + e)
            if pivots[2 * k + 1] >= 0:
                part[at - 1] -= sum8(sums)
                value_at -= length
                sums = splat8(0.0)
                for e in range(0, length, 8):
                    sums += load8(part, at + e) * load8(factors, value_at + e)
                at -= 1
            part[at - 1] -= sum8(sums)
            x[pivots[2 * k]] = part[at - 1]
            if pivots[2 * k + 1] >= 0:
                x[pivots[2 * k + 1]] = part[at]
            k -= 1


@native(fast=True)
def _norm(size: i64, x: f64s) -> f64:
    most = 0.0
    for k in range(size):
        most = max(most, fabs(x[k]))
    return most


@native
def solve(
    size: i64,
    refinements: i64,
    accuracy: f64s,
    pointers: i32s,
    columns: i32s,
    values: f64s,
    scale: f64s,
    order: i32s,
    pivot_count: i64s,
    pivots: i32s,
    starts: i32s,
    indices: i32s,
    factors: f64s,
    inverse: f64s,
    rhs: f64s,
    scaled_rhs: f64s,
    solution: f64s,
    change: f64s,
    result: f64s,
    part: f64s,
    report: f64s,
) -> None:
    """Solve K x = rhs with the factors of S K S; ``rhs`` and ``result`` (N,) in the unknowns' own order.

    Refinement stops at the relative residual ``accuracy[0]``, when it no longer falls by half, or after
    ``refinements`` steps; the best solution is kept.
    """
    count = pivot_count[0]
    for k in range(size):
        value = rhs[order[k]] * scale[k]
        scaled_rhs[k] = value
        change[k] = value
        solution[k] = 0.0
    norm = _norm(size, scaled_rhs)
    relative = 1.0
    steps = 0
    while norm > 0.0:
        substitute(count, columns, values[size:], pivots, starts, indices, factors, inverse, change, part)
        for k in range(size):
            solution[k] += change[k]
        remaining = residual(size, pointers, columns, values, scaled_rhs, solution, result)
        now = remaining / (norm + min(_norm(size, solution), LARGEST_GAIN * norm))
        if not (now < relative):
            if steps > 0:
                for k in range(size):
                    solution[k] -= change[k]
            else:
                relative = now
            break
        stagnant = now > 0.5 * relative
        relative = now
        if stagnant or relative <= accuracy[0] or steps >= refinements:
            break
        steps += 1
        for k in range(size):
            change[k] = result[k]
    report[0] = relative if norm > 0.0 else 0.0
    report[1] = 1.0 * steps
    for k in range(size):
        result[order[k]] = solution[k] * scale[k]
