"""Passes over the entries of the matrix, eight segments at once: largest entries of its rows, products with vectors.

Both leave to the caller what is outside the segments, entries and diagonal.  Vectors are in the order of the segments.
"""

from __future__ import annotations

from stc.codegen.native import f64s, i32s, i64, i64s, native
from stc.codegen.native_vector import abs8, gather8, largest8, load8, max8, splat8, store8, stream8, sum8
from stc.solver.kkt.lane_memory import ask_ahead
from stc.solver.kkt.lanes import (
    BORDER,
    ENTRIES,
    ENTRY_CODE,
    ENTRY_INDEX,
    FIELDS,
    FIRST,
    FIRST_CODE,
    FIRST_INDEX,
    FOLLOWING,
    LASTS,
    LEFT,
    MATRIX,
    NEXT,
    OWN,
    SEGMENTS,
    STEPS,
    UNKNOWNS,
    ask_for_step,
    collect_ends,
    collect_following,
    collect_own,
    note_outside,
)

__all__ = ["largest_in_segments", "subtract_segments"]


@native(fast=True, inline=True)
def add_following(group: i64s, code: i32s, part: f64s) -> None:
    """Move what a step has left for F to the next step's U."""
    own = group[OWN]
    following = code[group[FOLLOWING] :]
    for k in range(group[NEXT]):
        to = 8 * following[k]
        store8(part, to, load8(part, to) + load8(part, 8 * (own + k)))
        store8(part, 8 * (own + k), 0.0)


@native(fast=True, inline=True)
def add_outside(group: i64s, index: i32s, part: f64s, x: f64s) -> None:
    """Add what the segments have left for the last F, L and B to a vector."""
    own = group[OWN]
    outside = index[group[LASTS] :]
    for lane in range(group[SEGMENTS]):
        for k in range(group[NEXT] + group[LEFT] + group[BORDER]):
            x[outside[8 * k + lane]] += part[8 * (own + k) + lane]


@native(fast=True, inline=True)
def _largest(
    count: i64, sources: i32s, places: i32s, given: f64s, scales: f64s, most: f64s
) -> None:  # fmt: skip
    """Note the magnitudes of entries in both of their rows."""
    i = 0
    scale_i = load8(scales, 0)
    most_i = load8(most, 0)
    for k in range(count):
        if 8 * places[3 * k + 1] != i:
            store8(most, i, most_i)
            i = 8 * places[3 * k + 1]
            scale_i = load8(scales, i)
            most_i = load8(most, i)
        j = 8 * places[3 * k + 2]
        value = abs8(gather8(given, sources, 8 * k)) * scale_i * load8(scales, j)
        most_i = max8(value, most_i)
        store8(most, j, max8(value, load8(most, j)))
    store8(most, i, most_i)


@native(fast=True)
def largest_in_segments(
    fetched: i64,
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
    """Largest entry of each row of S K S in the segments; ``most`` has those outside as far as they are known.

    Args:
        fetched: 1 where entries are asked for ahead.
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
        collect_ends(group, index, scale, scales)
        for k in range(own, near + ends):
            store8(part, 8 * k, 0.0)
        for step in range(group[STEPS]):
            here = group[UNKNOWNS] + 8 * step * own
            if fetched != 0:
                ask_for_step(step, group, index, diagonal, given)
            collect_own(step, group, scale, scales)
            collect_following(step, group, index, code, scale, scales)
            for k in range(own):
                s = load8(scales, 8 * k)
                store8(part, 8 * k, abs8(gather8(diagonal, index, here + 8 * k)) * s * s)
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
                store8(most, here + 8 * k, load8(part, 8 * k))
        note_outside(group, index, part, most)


@native(fast=True, inline=True)
def _subtract(
    both: i64, distance: i64, count: i64, places: i32s, matrix: f64s, x: f64s, y: f64s, other_x: f64s, other_y: f64s
) -> None:  # fmt: skip
    """Subtract the products of entries from both of their rows."""
    i = 0
    x_i = load8(x, 0)
    y_i = load8(y, 0)
    other_x_i = load8(other_x, 0)
    other_y_i = load8(other_y, 0)
    for k in range(count):
        if 8 * places[3 * k + 1] != i:
            store8(y, i, y_i)
            if both != 0:
                store8(other_y, i, other_y_i)
            i = 8 * places[3 * k + 1]
            x_i = load8(x, i)
            y_i = load8(y, i)
            if both != 0:
                other_x_i = load8(other_x, i)
                other_y_i = load8(other_y, i)
        j = 8 * places[3 * k + 2]
        value = load8(matrix, 8 * k)
        ask_ahead(distance, 1, 0, 8 * k, matrix)
        y_i -= value * load8(x, j)
        store8(y, j, load8(y, j) - value * x_i)
        if both != 0:
            other_y_i -= value * load8(other_x, j)
            store8(other_y, j, load8(other_y, j) - value * other_x_i)
    store8(y, i, y_i)
    if both != 0:
        store8(other_y, i, other_y_i)


@native(fast=True, inline=True)
def subtract_segments(
    both: i64,
    distance: i64,
    groups: i64,
    table: i64s,
    index: i32s,
    code: i32s,
    matrix: f64s,
    x: f64s,
    y: f64s,
    z: f64s,
    left: f64s,
    other_x: f64s,
    other_y: f64s,
    other_z: f64s,
    other_left: f64s,
    work: f64s,
    part: f64s,
    norms: f64s,
) -> None:
    """``z = y - K x`` for the rows of segments; from other rows, those of ``left``, their entries' part is subtracted.

    Args:
        both: 1 to do the same with ``other_x``, ``other_y``, ``other_z`` in the same pass; a constant.
        distance: how far ahead memory is asked for, which is written past the caches then; 0 where it is near.
        groups, table, index, code, matrix: see ``eliminate``.
        work, part: work space, for two vectors each when ``both``.
        norms: largest magnitudes in segments of x, z, other_x, other_z; of the z nan when not all are finite.
    """
    high_x = splat8(0.0)
    high_z = splat8(0.0)
    high_other_x = splat8(0.0)
    high_other_z = splat8(0.0)
    check = splat8(0.0)
    other_check = splat8(0.0)
    for g in range(groups):
        group = table[g * FIELDS :]
        own = group[OWN]
        near = own + group[NEXT]
        size = near + group[LEFT] + group[BORDER]
        other_work = work[8 * size :]
        other_part = part[8 * size :]
        values = matrix[8 * group[MATRIX] :]
        collect_ends(group, index, x, work)
        for k in range(own, size):
            store8(part, 8 * k, 0.0)
        if both != 0:
            collect_ends(group, index, other_x, other_work)
            for k in range(own, size):
                store8(other_part, 8 * k, 0.0)
        for step in range(group[STEPS]):
            here = group[UNKNOWNS] + 8 * step * own
            ask_ahead(distance, own, 8, here, x)
            ask_ahead(distance, own, 8, here, y)
            collect_following(step, group, index, code, x, work)
            diagonal = values[0:]
            if step == 0:
                diagonal = values[8 * group[FIRST] :]
            for k in range(own):
                value = load8(x, here + 8 * k)
                high_x = max8(high_x, abs8(value))
                store8(work, 8 * k, value)
                store8(part, 8 * k, load8(y, here + 8 * k) - load8(diagonal, 8 * k) * value)
            if both != 0:
                ask_ahead(distance, own, 8, here, other_x)
                ask_ahead(distance, own, 8, here, other_y)
                collect_following(step, group, index, code, other_x, other_work)
                for k in range(own):
                    value = load8(other_x, here + 8 * k)
                    high_other_x = max8(high_other_x, abs8(value))
                    store8(other_work, 8 * k, value)
                    store8(other_part, 8 * k, load8(other_y, here + 8 * k) - load8(diagonal, 8 * k) * value)
            if step > 0:
                add_following(group, code, part)
                if both != 0:
                    add_following(group, code, other_part)
            else:
                _subtract(
                    both,
                    distance,
                    group[FIRST],
                    code[group[FIRST_CODE] :],
                    values,
                    work,
                    part,
                    other_work,
                    other_part,
                )
            values = diagonal[8 * own :]
            _subtract(
                both,
                distance,
                group[ENTRIES],
                code[group[ENTRY_CODE] :],
                values,
                work,
                part,
                other_work,
                other_part,
            )
            values = values[8 * group[ENTRIES] :]
            for k in range(own):
                value = load8(part, 8 * k)
                high_z = max8(high_z, abs8(value))
                check += value * 0.0
                if distance > 0:
                    stream8(z, here + 8 * k, value)
                else:
                    store8(z, here + 8 * k, value)
                if both != 0:
                    value = load8(other_part, 8 * k)
                    high_other_z = max8(high_other_z, abs8(value))
                    other_check += value * 0.0
                    if distance > 0:
                        stream8(other_z, here + 8 * k, value)
                    else:
                        store8(other_z, here + 8 * k, value)
        add_outside(group, index, part, left)
        if both != 0:
            add_outside(group, index, other_part, other_left)
    norms[0] = largest8(high_x)
    norms[1] = largest8(high_z) + sum8(check)
    norms[2] = largest8(high_other_x)
    norms[3] = largest8(high_other_z) + sum8(other_check)
