"""Solving with the factors of stc.solver.kkt.elimination, and refining against the matrix itself."""

from __future__ import annotations

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native
from stc.solver.kkt.values import residual

__all__ = ["REPORT", "solve", "substitute"]

#: Length of ``report``: relative residual, refinements made.
REPORT = 2
#: Residuals are relative to the right-hand side plus the solution, or this much of the right-hand side.
LARGEST_GAIN = 1e6


@native(fast=True)
def substitute(
    count: i64, columns: i32s, upper: f64s, pivots: i32s, starts: i32s, indices: i32s, factors: f64s,
    inverse: f64s, x: f64s,
) -> None:  # fmt: skip
    """Overwrite ``x`` with the solution of L D L^T x = x; ``upper`` are the entries at ``columns``."""
    value_at = 0
    for k in range(count):
        length = starts[2 * k + 1]
        if length < 0:
            own = columns[starts[2 * k] :]
            column = upper[starts[2 * k] :]
            scaled = x[pivots[2 * k]] * inverse[3 * k]
            for e in range(-1 - length):
                x[own[e]] -= column[e] * scaled
            x[pivots[2 * k]] = scaled
            continue
        p = pivots[2 * k]
        q = pivots[2 * k + 1]
        own = indices[starts[2 * k] :]
        column = factors[value_at:]
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
    for back in range(count):
        k = count - 1 - back
        p = pivots[2 * k]
        q = pivots[2 * k + 1]
        length = starts[2 * k + 1]
        total_p = x[p]
        if length < 0:
            own = columns[starts[2 * k] :]
            column = upper[starts[2 * k] :]
            total = 0.0
            for e in range(-1 - length):
                total += column[e] * x[own[e]]
            x[p] = total_p - inverse[3 * k] * total
            continue
        value_at -= length
        if q >= 0:
            value_at -= length
        own = indices[starts[2 * k] :]
        column = factors[value_at:]
        if q < 0:
            for e in range(length):
                total_p -= column[e] * x[own[e]]
            x[p] = total_p
        else:
            total_q = x[q]
            other = column[length:]
            for e in range(length):
                value = x[own[e]]
                total_p -= column[e] * value
                total_q -= other[e] * value
            x[p] = total_p
            x[q] = total_q


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
    tolerance: f64,
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
    report: f64s,
) -> None:
    """Solve K x = rhs with the factors of S K S; ``rhs`` and ``result`` (N,) in the unknowns' own order.

    Refinement stops at the relative residual ``tolerance``, when it no longer falls by half, or after
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
        substitute(count, columns, values[size:], pivots, starts, indices, factors, inverse, change)
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
        if stagnant or relative <= tolerance or steps >= refinements:
            break
        steps += 1
        for k in range(size):
            change[k] = result[k]
    report[0] = relative if norm > 0.0 else 0.0
    report[1] = 1.0 * steps
    for k in range(size):
        result[order[k]] = solution[k] * scale[k]
