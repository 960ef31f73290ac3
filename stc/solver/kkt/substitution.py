"""Solving with the factors of stc.solver.kkt.elimination, and refining against the matrix itself."""

from __future__ import annotations

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native
from stc.codegen.native_vector import load8, splat8, store8, sum8
from stc.solver.kkt.values import residual

__all__ = ["REPORT", "improves", "norm", "solve", "substitute"]

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


@native(small=True)
def _return(k: i64, pivots: i32s, starts: i32s, indices: i32s, part: f64s, x: f64s) -> None:
    """Copy what belongs to pivot k and its rows back."""
    size = 1
    x[pivots[2 * k]] = part[0]
    if pivots[2 * k + 1] >= 0:
        size = 2
        x[pivots[2 * k + 1]] = part[1]
    own = indices[starts[2 * k] :]
    rows = part[size:]
    for e in range(starts[2 * k + 1]):
        x[own[e]] = rows[e]


@native(fast=True, inline=True)
def _divide(k: i64, p: i64, q: i64, inverse: f64s, x: f64s) -> None:
    """Divide what is at ``p``, and at ``q`` when that is no less than 0, by pivot k."""
    value_p = x[p]
    if q < 0:
        x[p] = inverse[3 * k] * value_p
    else:
        value_q = x[q]
        x[p] = inverse[3 * k] * value_p + inverse[3 * k + 1] * value_q
        x[q] = inverse[3 * k + 1] * value_p + inverse[3 * k + 2] * value_q


@native(fast=True, inline=True)
def _substitute(
    both: i64, count: i64, columns: i32s, upper: f64s, pivots: i32s, starts: i32s, indices: i32s, factors: f64s,
    inverse: f64s, x: f64s, other_x: f64s, part: f64s, other_part: f64s,
) -> None:  # fmt: skip
    """See ``substitute``; ``both`` is a constant here."""
    value_at = 0
    k = 0
    while k < count:
        length = starts[2 * k + 1]
        if length < 0:
            own = columns[starts[2 * k] :]
            column = upper[starts[2 * k] :]
            p = pivots[2 * k]
            scaled = x[p] * inverse[3 * k]
            other_scaled = 0.0
            if both != 0:
                other_scaled = other_x[p] * inverse[3 * k]
            for e in range(-1 - length):
                x[own[e]] -= column[e] * scaled
                if both != 0:
                    other_x[own[e]] -= column[e] * other_scaled
            x[p] = scaled
            if both != 0:
                other_x[p] = other_scaled
            k += 1
            continue
        if length < LONG:
            own = indices[starts[2 * k] :]
            column = factors[value_at:]
            p = pivots[2 * k]
            q = pivots[2 * k + 1]
            value_p = x[p]
            other_p = other_x[p]
            value_at += length
            if q < 0:
                for e in range(length):
                    x[own[e]] -= column[e] * value_p
                    if both != 0:
                        other_x[own[e]] -= column[e] * other_p
            else:
                value_at += length
                value_q = x[q]
                other_q = other_x[q]
                second = column[length:]
                for e in range(length):
                    x[own[e]] -= column[e] * value_p + second[e] * value_q
                    if both != 0:
                        other_x[own[e]] -= column[e] * other_p + second[e] * other_q
            _divide(k, p, q, inverse, x)
            if both != 0:
                _divide(k, p, q, inverse, other_x)
            k += 1
            continue
        first = k
        _collect(k, pivots, starts, indices, x, part)
        if both != 0:
            _collect(k, pivots, starts, indices, other_x, other_part)
        at = 0
        while k < count and (k == first or _linked(k, pivots, starts, indices) != 0):
            length = starts[2 * k + 1]
            value_p = part[at]
            other_p = other_part[at]
            size = 1
            if pivots[2 * k + 1] < 0:
                at += 1
                for e in range(0, length, 8):
                    f = load8(factors, value_at + e)
                    store8(part, at + e, load8(part, at + e) - value_p * f)
                    if both != 0:
                        store8(other_part, at + e, load8(other_part, at + e) - other_p * f)
            else:
                size = 2
                value_q = part[at + 1]
                other_q = other_part[at + 1]
                at += 2
                second = factors[value_at + length :]
                for e in range(0, length, 8):
                    f = load8(factors, value_at + e)
                    g = load8(second, e)
                    store8(part, at + e, load8(part, at + e) - (value_p * f + value_q * g))
                    if both != 0:
                        store8(other_part, at + e, load8(other_part, at + e) - (other_p * f + other_q * g))
                value_at += length
            _divide(k, at - size, at - 1 if size == 2 else -1, inverse, part)
            if both != 0:
                _divide(k, at - size, at - 1 if size == 2 else -1, inverse, other_part)
            value_at += length
            k += 1
        _return(first, pivots, starts, indices, part, x)
        if both != 0:
            _return(first, pivots, starts, indices, other_part, other_x)
    store8(factors, value_at, 0.0)
    k = count - 1
    while k >= 0:
        length = starts[2 * k + 1]
        if length < 0:
            own = columns[starts[2 * k] :]
            column = upper[starts[2 * k] :]
            total = 0.0
            other_total = 0.0
            for e in range(-1 - length):
                total += column[e] * x[own[e]]
                if both != 0:
                    other_total += column[e] * other_x[own[e]]
            x[pivots[2 * k]] -= inverse[3 * k] * total
            if both != 0:
                other_x[pivots[2 * k]] -= inverse[3 * k] * other_total
            k -= 1
            continue
        if length < LONG:
            own = indices[starts[2 * k] :]
            members = 1 if pivots[2 * k + 1] < 0 else 2
            for member in range(members):
                p = pivots[2 * k + members - 1 - member]
                value_at -= length
                total = x[p]
                other_total = other_x[p]
                column = factors[value_at:]
                for e in range(length):
                    total -= column[e] * x[own[e]]
                    if both != 0:
                        other_total -= column[e] * other_x[own[e]]
                x[p] = total
                if both != 0:
                    other_x[p] = other_total
            k -= 1
            continue
        first = k
        while first > 0 and starts[2 * first - 1] >= 0 and _linked(first, pivots, starts, indices) != 0:
            first -= 1
        end = _collect(first, pivots, starts, indices, x, part)
        store8(part, end, 0.0)
        if both != 0:
            _collect(first, pivots, starts, indices, other_x, other_part)
            store8(other_part, end, 0.0)
        while k >= first:
            length = starts[2 * k + 1]
            at = end - length
            place = at - 1
            for member in range(1 if pivots[2 * k + 1] < 0 else 2):
                value_at -= length
                sums = splat8(0.0)
                other_sums = splat8(0.0)
                for e in range(0, length, 8):
                    f = load8(factors, value_at + e)
                    sums += load8(part, at + e) * f
                    if both != 0:
                        other_sums += load8(other_part, at + e) * f
                place = at - 1 - member
                part[place] -= sum8(sums)
                if both != 0:
                    other_part[place] -= sum8(other_sums)
            x[pivots[2 * k]] = part[place]
            if both != 0:
                other_x[pivots[2 * k]] = other_part[place]
            if pivots[2 * k + 1] >= 0:
                x[pivots[2 * k + 1]] = part[at - 1]
                if both != 0:
                    other_x[pivots[2 * k + 1]] = other_part[at - 1]
            k -= 1


@native(fast=True, small=True)
def substitute(
    both: i64, count: i64, columns: i32s, upper: f64s, pivots: i32s, starts: i32s, indices: i32s, factors: f64s,
    inverse: f64s, x: f64s, other_x: f64s, part: f64s, other_part: f64s,
) -> None:  # fmt: skip
    """Overwrite ``x`` with the solution of L D L^T x = x; ``upper`` are the entries at ``columns``.

    The same for ``other_x``, in one pass over the factors, when ``both`` is not 0. Pivots of a panel share their rows:
    where these are many, what belongs to them is copied to ``part`` and back once. There is room for a vector more in
    ``factors`` and the parts.
    """
    if both != 0:
        _substitute(
            1, count, columns, upper, pivots, starts, indices, factors, inverse, x, other_x, part, other_part
        )
    else:
        _substitute(
            0, count, columns, upper, pivots, starts, indices, factors, inverse, x, other_x, part, other_part
        )


@native(fast=True, inline=True)
def norm(size: i64, x: f64s) -> f64:
    """Largest magnitude."""
    most = 0.0
    for k in range(size):
        most = max(most, fabs(x[k]))
    return most


@native(fast=True, inline=True)
def improves(
    size: i64, steps: i64, refinements: i64, accuracy: f64, remaining: f64, length: f64, highest: f64, report: f64s,
    change: f64s, solution: f64s,
) -> i64:  # fmt: skip
    """Whether to refine a solution once more, after it was changed; it is changed back where that made it worse.

    Args:
        steps: refinements so far, of ``refinements``.
        accuracy: relative residual to reach.
        remaining, length, highest: largest magnitudes of the residual, of the right-hand side, of the solution.
        report: its first number is the relative residual before and afterwards, 1 at first.
        change, solution: (size,).
    """
    now = remaining / (length + min(highest, LARGEST_GAIN * length))
    before = report[0]
    if not (now < before):
        if steps > 0:
            for k in range(size):
                solution[k] -= change[k]
        else:
            report[0] = now
        return 0
    report[0] = now
    return 0 if now > 0.5 * before or now <= accuracy or steps >= refinements else 1


@native(fast=True, inline=True)
def _begin(
    size: i64, order: i32s, scale: f64s, rhs: f64s, scaled_rhs: f64s, change: f64s, solution: f64s
) -> f64:  # fmt: skip
    """Scale a right-hand side; its largest magnitude then."""
    for k in range(size):
        value = rhs[order[k]] * scale[k]
        scaled_rhs[k] = value
        change[k] = value
        solution[k] = 0.0
    return norm(size, scaled_rhs)


@native(inline=True)
def _solve(
    both: i64, size: i64, refinements: i64, accuracy: f64s, pointers: i32s, columns: i32s, values: f64s, scale: f64s,
    order: i32s, pivot_count: i64s, pivots: i32s, starts: i32s, indices: i32s, factors: f64s, inverse: f64s,
    rhs: f64s, scaled_rhs: f64s, solution: f64s, change: f64s, result: f64s, part: f64s, other_rhs: f64s,
    other_scaled_rhs: f64s, other_solution: f64s, other_change: f64s, other_result: f64s, other_part: f64s,
    report: f64s, other_report: f64s,
) -> None:  # fmt: skip
    """See ``solve``; ``both`` is a constant here."""
    count = pivot_count[0]
    length = _begin(size, order, scale, rhs, scaled_rhs, change, solution)
    other_length = 0.0
    if both != 0:
        other_length = _begin(size, order, scale, other_rhs, other_scaled_rhs, other_change, other_solution)
    active = 1 if length > 0.0 else 0
    other_active = 1 if other_length > 0.0 else 0
    report[0] = 1.0 * active
    report[1] = 0.0
    other_report[0] = 1.0 * other_active
    steps = 0
    while active + other_active > 0:
        substitute(
            both, count, columns, values[size:], pivots, starts, indices, factors, inverse, change, other_change, part,
            other_part,
        )  # fmt: skip
        report[1] = 1.0 * steps
        if active != 0:
            for k in range(size):
                solution[k] += change[k]
            remaining = residual(size, pointers, columns, values, scaled_rhs, solution, result)
            active = improves(
                size, steps, refinements, accuracy[0], remaining, length, norm(size, solution), report, change,
                solution,
            )  # fmt: skip
            if active != 0:
                for k in range(size):
                    change[k] = result[k]
        if other_active != 0:
            for k in range(size):
                other_solution[k] += other_change[k]
            remaining = residual(
                size, pointers, columns, values, other_scaled_rhs, other_solution, other_result
            )
            other_active = improves(
                size, steps, refinements, accuracy[0], remaining, other_length, norm(size, other_solution),
                other_report, other_change, other_solution,
            )  # fmt: skip
            if other_active != 0:
                for k in range(size):
                    other_change[k] = other_result[k]
        steps += 1
    for k in range(size):
        result[order[k]] = solution[k] * scale[k]
    if both != 0:
        for k in range(size):
            other_result[order[k]] = other_solution[k] * scale[k]
        report[0] = max(report[0], other_report[0])


@native
def solve(
    both: i64,
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
    other_rhs: f64s,
    other_scaled_rhs: f64s,
    other_solution: f64s,
    other_change: f64s,
    other_result: f64s,
    other_part: f64s,
    report: f64s,
    other_report: f64s,
) -> None:
    """Solve K x = rhs with the factors of S K S; ``rhs`` and ``result`` (N,) in the unknowns' own order.

    The same for ``other_rhs``, in common passes over the factors, when ``both`` is not 0: ``report`` then tells of the
    one that is less accurate. Refinement stops at the relative residual ``accuracy[0]``, when it no longer falls by
    half, or after ``refinements`` steps; the best solution is kept.
    """
    if both != 0:
        _solve(
            1, size, refinements, accuracy, pointers, columns, values, scale, order, pivot_count, pivots, starts,
            indices, factors, inverse, rhs, scaled_rhs, solution, change, result, part, other_rhs, other_scaled_rhs,
            other_solution, other_change, other_result, other_part, report, other_report,
        )  # fmt: skip
    else:
        _solve(
            0, size, refinements, accuracy, pointers, columns, values, scale, order, pivot_count, pivots, starts,
            indices, factors, inverse, rhs, scaled_rhs, solution, change, result, part, other_rhs, other_scaled_rhs,
            other_solution, other_change, other_result, other_part, report, other_report,
        )  # fmt: skip
