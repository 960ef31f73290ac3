"""Entries of K in elimination order: loading, equilibration, products.

``values`` (N + E,) holds the N diagonal entries, then those above the diagonal row by row: row i has the columns
``columns[pointers[i]:pointers[i + 1]]``, all larger than i, at ``values[N + e]``.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, fabs, i32s, i64, i64s, native, sqrt

__all__ = [
    "add_to",
    "bring_scaled",
    "choose_plan",
    "count_nonzero",
    "equilibrate",
    "find_scale",
    "load",
    "raise_to",
    "residual",
    "return_scaled",
    "spread_of",
]

#: A scale is good when the largest entries of all rows are within this factor of 1.
GOOD = 2.0
#: Scales stay between these.
SMALLEST_SCALE = 1e-100
LARGEST_SCALE = 1e100


@native(fast=True)
def load(
    n: i64,
    m: i64,
    hess_count: i64,
    jac_count: i64,
    hess: f64s,
    jac: f64s,
    primal: f64s,
    dual: f64s,
    position: i32s,
    hess_target: i32s,
    jac_target: i32s,
    values: f64s,
) -> i64:
    """Put the values of H, J, p and d at their places; returns 0, or 1 when a value is not finite."""
    check = 0.0
    for k in range(n):
        value = primal[k]
        check += value * 0.0
        values[position[k]] = value
    for k in range(m):
        value = dual[k]
        check += value * 0.0
        values[position[n + k]] = -value
    for k in range(hess_count):
        value = hess[k]
        check += value * 0.0
        target = hess_target[k]
        if target < n + m:
            values[target] += value
        else:
            values[target] = value
    for k in range(jac_count):
        value = jac[k]
        check += value * 0.0
        values[jac_target[k]] = value
    return 0 if check == 0.0 else 1


@native
def count_nonzero(count: i64, places: i32s, values: f64s) -> i64:
    """How many of some values differ from zero."""
    found = 0
    for k in range(count):
        found += values[places[k]] != 0.0
    return found


@native
def choose_plan(count: i64, places: i32s, values: f64s, at: i64, cells: i64s) -> None:
    """Make ``cells[at]`` tell whether all of some values are zero, as a plan takes them to be."""
    cells[at] = 1 if count_nonzero(count, places, values) == 0 else 0


@native(fast=True, inline=True)
def bring_scaled(size: i64, index: i32s, scale: f64s, rhs: f64s, scaled_rhs: f64s) -> f64:
    """Bring a right-hand side to the order of a vector, scaled; its largest magnitude then."""
    most = 0.0
    for k in range(size):
        value = rhs[index[k]] * scale[k]
        scaled_rhs[k] = value
        most = max(most, fabs(value))
    return most


@native(fast=True, inline=True)
def return_scaled(size: i64, index: i32s, scale: f64s, solution: f64s, result: f64s) -> None:
    """The solution in the unknowns' own order."""
    for k in range(size):
        result[index[k]] = solution[k] * scale[k]


@native(fast=True)
def add_to(count: i64, x: f64s, y: f64s) -> None:
    """Add one array to another."""
    for k in range(count):
        y[k] += x[k]


@native(fast=True)
def raise_to(count: i64, x: f64s, y: f64s) -> None:
    """Raise the numbers of one array to those of another."""
    for k in range(count):
        y[k] = max(y[k], x[k])


@native(fast=True)
def spread_of(size: i64, most: f64s) -> f64:
    """How far from 1 the largest entries are; rows of zeros do not count."""
    spread = 1.0
    for k in range(size):
        value = most[k]
        value = value if value > 0.0 else 1.0
        spread = max(spread, max(value, 1.0 / value))
    return spread


@native(fast=True)
def _refine(size: i64, most: f64s, scale: f64s) -> None:
    """Divide each scale by the root of its row's largest entry."""
    for k in range(size):
        value = most[k]
        value = value if value > 0.0 else 1.0
        scale[k] = min(max(scale[k] / sqrt(value), SMALLEST_SCALE), LARGEST_SCALE)


@native(fast=True)
def find_scale(size: i64, most: f64s, scale: f64s) -> i64:
    """Improve the scale by the largest entries of the rows; 0 when it is good, or is now.

    The largest entry m_i of row i is in no row j with a smaller m_j, so that one step leaves ``m_i / sqrt(m_i m_j)``
    of it at least: the largest ones are then between the root of ``min m / max m`` and 1.
    """
    low = LARGEST_SCALE
    high = 0.0
    for k in range(size):
        value = most[k]
        high = max(high, value)
        low = min(low, value if value > 0.0 else 1.0)
    if high < GOOD and low * GOOD > 1.0:
        return 0
    _refine(size, most, scale)
    return 0 if high < GOOD * GOOD * low else 1


@native
def _largest_of_rows(size: i64, pointers: i32s, columns: i32s, values: f64s, scale: f64s, most: f64s) -> None:
    """Largest entry of each row of S K S."""
    upper = values[size:]
    for k in range(size):
        most[k] = fabs(values[k]) * scale[k] * scale[k]
    for k in range(size):
        own = scale[k]
        highest = most[k]
        for e in range(pointers[k], pointers[k + 1]):
            other = columns[e]
            value = fabs(upper[e]) * own * scale[other]
            highest = max(highest, value)
            most[other] = max(most[other], value)
        most[k] = highest


@native
def equilibrate(
    size: i64, sweeps: i64, stale: f64, pointers: i32s, columns: i32s, values: f64s, scale: f64s, most: f64s
) -> None:
    """Scale rows and columns alike until the largest entries of all rows are near 1 (Ruiz 2001).

    ``scale`` comes in as the diagonal of S for a matrix before, or ones; it is kept when it serves this matrix
    too, the largest entries being within the factor ``stale`` of 1, and otherwise found from ones (starting from
    what served another matrix would let rows and columns drift apart).  ``values`` becomes S K S.
    """
    _largest_of_rows(size, pointers, columns, values, scale, most)
    if spread_of(size, most) > stale:
        for k in range(size):
            scale[k] = 1.0
        for _sweep in range(sweeps):
            _largest_of_rows(size, pointers, columns, values, scale, most)
            if find_scale(size, most, scale) == 0:
                break
    upper = values[size:]
    for k in range(size):
        own = scale[k]
        values[k] = values[k] * own * own
        for e in range(pointers[k], pointers[k + 1]):
            upper[e] = upper[e] * own * scale[columns[e]]


@native(fast=True)
def residual(
    size: i64, pointers: i32s, columns: i32s, values: f64s, rhs: f64s, solution: f64s, remainder: f64s
) -> f64:
    """``remainder = rhs - K solution``; returns its largest magnitude, nan when not finite."""
    upper = values[size:]
    for k in range(size):
        remainder[k] = rhs[k] - values[k] * solution[k]
    most = 0.0
    check = 0.0
    for k in range(size):
        own = solution[k]
        total = remainder[k]
        for e in range(pointers[k], pointers[k + 1]):
            other = columns[e]
            value = upper[e]
            total -= value * solution[other]
            remainder[other] -= value * own
        remainder[k] = total
        check += total * 0.0
        most = max(most, fabs(total))
    return most + check
