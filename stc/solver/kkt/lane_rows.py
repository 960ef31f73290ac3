"""Passes over the entries of the matrix, eight segments at once: largest entries of its rows, products with a vector.

Both leave to the caller what is outside the segments, entries and diagonal.
"""

from __future__ import annotations

from stc.codegen.native import f64s, i32s, i64, i64s, native
from stc.codegen.native_vector import abs8, gather8, load8, max8, scatter8, store8
from stc.solver.kkt.lanes import (
    BORDER,
    ENDS,
    ENTRIES,
    ENTRY_CODE,
    ENTRY_INDEX,
    FIELDS,
    FIRST,
    FIRST_CODE,
    FIRST_INDEX,
    FOLLOWING,
    LEFT,
    NEXT,
    OWN,
    SEGMENTS,
    STEPS,
    UNKNOWNS,
)

__all__ = ["largest_in_segments", "subtract_segments"]


@native(fast=True, inline=True)
def _largest(
    count: i64, sources: i32s, places: i32s, given: f64s, scales: f64s, most: f64s
) -> None:  # fmt: skip
    """Note the magnitudes of entries in both of their rows."""
    for k in range(count):
        i = 8 * places[3 * k + 1]
        j = 8 * places[3 * k + 2]
        value = abs8(gather8(given, sources, 8 * k)) * load8(scales, i) * load8(scales, j)
        store8(most, i, max8(value, load8(most, i)))
        store8(most, j, max8(value, load8(most, j)))


@native(fast=True)
def largest_in_segments(
    groups: i64,
    table: i64s,
    index: i32s,
    code: i32s,
    given: f64s,
    diagonal: f64s,
    scale: f64s,
    most: f64s,
    scales: f64s,
    part: f64s,
) -> None:
    """Largest entry of each row of S K S in the segments; ``most`` (N,) has those outside as far as they are known.

    Args:
        groups, table, index, code: see ``eliminate``.
        diagonal: that of the matrix, (N,).
        scales, part: work space.
    """
    for g in range(groups):
        group = table[g * FIELDS :]
        own = group[OWN]
        near = own + group[NEXT]
        ends = group[LEFT] + group[BORDER]
        following = code[group[FOLLOWING] :]
        outer = index[group[ENDS] :]
        for k in range(ends):
            store8(scales, 8 * (near + k), gather8(scale, outer, 8 * k))
        for k in range(own, near + ends):
            store8(part, 8 * k, 0.0)
        for step in range(group[STEPS]):
            unknowns = index[group[UNKNOWNS] + 8 * step * near :]
            for k in range(near):
                store8(scales, 8 * k, gather8(scale, unknowns, 8 * k))
            for k in range(own):
                s = load8(scales, 8 * k)
                store8(part, 8 * k, abs8(gather8(diagonal, unknowns, 8 * k)) * s * s)
            if step > 0:
                for k in range(group[NEXT]):
                    to = 8 * following[k]
                    store8(part, to, max8(load8(part, to), load8(part, 8 * (own + k))))
                    store8(part, 8 * (own + k), 0.0)
            else:
                _largest(
                    group[FIRST], index[group[FIRST_INDEX] :], code[group[FIRST_CODE] :], given, scales, part
                )
            count = group[ENTRIES]
            sources = index[group[ENTRY_INDEX] + 8 * step * count :]
            _largest(count, sources, code[group[ENTRY_CODE] :], given, scales, part)
            for k in range(own):
                scatter8(most, unknowns, 8 * k, load8(part, 8 * k))
        last = index[group[UNKNOWNS] + 8 * ((group[STEPS] - 1) * near + own) :]
        for lane in range(group[SEGMENTS]):
            for k in range(group[NEXT]):
                most[last[8 * k + lane]] = max(most[last[8 * k + lane]], part[8 * (own + k) + lane])
            for k in range(ends):
                most[outer[8 * k + lane]] = max(most[outer[8 * k + lane]], part[8 * (near + k) + lane])


@native(fast=True, inline=True)
def _subtract(
    count: i64, sources: i32s, places: i32s, given: f64s, factors: f64s, part: f64s
) -> None:  # fmt: skip
    """Subtract the products of entries from both of their rows."""
    for k in range(count):
        i = 8 * places[3 * k + 1]
        j = 8 * places[3 * k + 2]
        value = gather8(given, sources, 8 * k)
        store8(part, i, load8(part, i) - value * load8(factors, j))
        store8(part, j, load8(part, j) - value * load8(factors, i))


@native(fast=True)
def subtract_segments(
    groups: i64,
    table: i64s,
    index: i32s,
    code: i32s,
    given: f64s,
    diagonal: f64s,
    x: f64s,
    y: f64s,
    factors: f64s,
    part: f64s,
) -> None:
    """``y -= K x`` for the rows of segments; from the other rows, their entries' part is subtracted.

    Arguments as in ``largest_in_segments``; ``factors`` and ``part`` are work space.
    """
    for g in range(groups):
        group = table[g * FIELDS :]
        own = group[OWN]
        near = own + group[NEXT]
        ends = group[LEFT] + group[BORDER]
        following = code[group[FOLLOWING] :]
        outer = index[group[ENDS] :]
        for k in range(ends):
            store8(factors, 8 * (near + k), gather8(x, outer, 8 * k))
        for k in range(own, near + ends):
            store8(part, 8 * k, 0.0)
        for step in range(group[STEPS]):
            unknowns = index[group[UNKNOWNS] + 8 * step * near :]
            for k in range(near):
                store8(factors, 8 * k, gather8(x, unknowns, 8 * k))
            for k in range(own):
                change = gather8(diagonal, unknowns, 8 * k) * load8(factors, 8 * k)
                store8(part, 8 * k, gather8(y, unknowns, 8 * k) - change)
            if step > 0:
                for k in range(group[NEXT]):
                    to = 8 * following[k]
                    store8(part, to, load8(part, to) + load8(part, 8 * (own + k)))
                    store8(part, 8 * (own + k), 0.0)
            else:
                _subtract(
                    group[FIRST], index[group[FIRST_INDEX] :], code[group[FIRST_CODE] :], given, factors, part
                )
            count = group[ENTRIES]
            sources = index[group[ENTRY_INDEX] + 8 * step * count :]
            _subtract(count, sources, code[group[ENTRY_CODE] :], given, factors, part)
            for k in range(own):
                scatter8(y, unknowns, 8 * k, load8(part, 8 * k))
        last = index[group[UNKNOWNS] + 8 * ((group[STEPS] - 1) * near + own) :]
        for lane in range(group[SEGMENTS]):
            for k in range(group[NEXT]):
                y[last[8 * k + lane]] += part[8 * (own + k) + lane]
            for k in range(ends):
                y[outer[8 * k + lane]] += part[8 * (near + k) + lane]
