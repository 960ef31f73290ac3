"""Substitutions with the factors of stc.solver.kkt.lanes, eight segments at once, for one vector or for two.

Both work on vectors of all unknowns, in the order of the segments: what is left when these are done concerns the others
alone.  Two vectors share the reading of the factors, which takes longer than the arithmetic.
"""

from __future__ import annotations

from stc.codegen.native import f64s, i32s, i64, i64s, native
from stc.codegen.native_vector import load8, store8
from stc.solver.kkt.lane_memory import ask_ahead, ask_behind, put_vectors
from stc.solver.kkt.lane_panel import panel_vectors
from stc.solver.kkt.lane_rows import add_following, add_outside
from stc.solver.kkt.lanes import (
    BORDER,
    FACTOR_STEP,
    FACTORS,
    FIELDS,
    FOLLOWING,
    LEFT,
    NEXT,
    OWN,
    PANEL_CODE,
    PANEL_STARTS,
    PANELS,
    STEPS,
    UNKNOWNS,
    collect_ends,
    collect_following,
    collect_own,
)

__all__ = ["backward", "forward"]


@native(fast=True, inline=True)
def _forward_corner(members: i64, kinds: i32s, who: i32s, factors: f64s, part: f64s) -> None:
    """Forward substitution inside a panel."""
    row = 0
    for p in range(members):
        y = load8(part, 8 * who[p])
        for q in range(p + max(kinds[p], 1), members):
            to = 8 * who[q]
            store8(part, to, load8(part, to) - y * load8(factors, row + 8 * (q - p)))
        row += 8 * (members - p)


@native(fast=True, inline=True)
def _backward_corner(members: i64, kinds: i32s, who: i32s, factors: f64s, part: f64s) -> None:
    """Back substitution inside a panel."""
    row = 4 * members * (members + 1)
    for back in range(members):
        p = members - 1 - back
        row -= 8 * (members - p)
        y = load8(part, 8 * who[p])
        for q in range(p + max(kinds[p], 1), members):
            y -= load8(part, 8 * who[q]) * load8(factors, row + 8 * (q - p))
        store8(part, 8 * who[p], y)


@native(fast=True, inline=True)
def _divide(members: i64, kinds: i32s, who: i32s, factors: f64s, part: f64s) -> None:
    """Divide by D."""
    p = 0
    row = 0
    while p < members:
        y = load8(part, 8 * who[p])
        next_row = row + 8 * (members - p)
        if kinds[p] == 2:
            z = load8(part, 8 * who[p + 1])
            mixed = load8(factors, row + 8)
            store8(part, 8 * who[p], y * load8(factors, row) + z * mixed)
            store8(part, 8 * who[p + 1], y * mixed + z * load8(factors, next_row))
            row = next_row + 8 * (members - p - 1)
            p += 2
        else:
            store8(part, 8 * who[p], y * load8(factors, row))
            row = next_row
            p += 1


@native(fast=True, inline=True)
def _forward_panel(
    both: i64, members: i64, count: i64, kinds: i32s, who: i32s, rows: i32s, factors: f64s, part: f64s, other: f64s
) -> None:  # fmt: skip
    """Forward substitution and division by D for one panel."""
    _forward_corner(members, kinds, who, factors, part)
    if both != 0:
        _forward_corner(members, kinds, who, factors, other)
    own = factors[4 * members * (members + 1) :]
    p = 0
    far = 8 * members
    if members == 4:
        y0 = load8(part, 8 * who[0])
        y1 = load8(part, 8 * who[1])
        y2 = load8(part, 8 * who[2])
        y3 = load8(part, 8 * who[3])
        z0 = load8(other, 8 * who[0])
        z1 = load8(other, 8 * who[1])
        z2 = load8(other, 8 * who[2])
        z3 = load8(other, 8 * who[3])
        for e in range(count):
            to = 8 * rows[e]
            at = 32 * e
            f0 = load8(own, at)
            f1 = load8(own, at + 8)
            f2 = load8(own, at + 16)
            f3 = load8(own, at + 24)
            store8(part, to, load8(part, to) - y0 * f0 - y1 * f1 - y2 * f2 - y3 * f3)
            if both != 0:
                store8(other, to, load8(other, to) - z0 * f0 - z1 * f1 - z2 * f2 - z3 * f3)
        p = 4
    while p < members:
        y = load8(part, 8 * who[p])
        z = load8(other, 8 * who[p])
        for e in range(count):
            to = 8 * rows[e]
            f = load8(own, e * far + 8 * p)
            store8(part, to, load8(part, to) - y * f)
            if both != 0:
                store8(other, to, load8(other, to) - z * f)
        p += 1
    _divide(members, kinds, who, factors, part)
    if both != 0:
        _divide(members, kinds, who, factors, other)


@native(fast=True, inline=True)
def _backward_panel(
    both: i64, members: i64, count: i64, kinds: i32s, who: i32s, rows: i32s, factors: f64s, part: f64s, other: f64s
) -> None:  # fmt: skip
    """Back substitution for one panel."""
    own = factors[4 * members * (members + 1) :]
    far = 8 * members
    done = 0
    if members == 4:
        y0 = load8(part, 8 * who[0])
        y1 = load8(part, 8 * who[1])
        y2 = load8(part, 8 * who[2])
        y3 = load8(part, 8 * who[3])
        z0 = load8(other, 8 * who[0])
        z1 = load8(other, 8 * who[1])
        z2 = load8(other, 8 * who[2])
        z3 = load8(other, 8 * who[3])
        for e in range(count):
            at = 32 * e
            f0 = load8(own, at)
            f1 = load8(own, at + 8)
            f2 = load8(own, at + 16)
            f3 = load8(own, at + 24)
            value = load8(part, 8 * rows[e])
            y0 -= value * f0
            y1 -= value * f1
            y2 -= value * f2
            y3 -= value * f3
            if both != 0:
                value = load8(other, 8 * rows[e])
                z0 -= value * f0
                z1 -= value * f1
                z2 -= value * f2
                z3 -= value * f3
        store8(part, 8 * who[0], y0)
        store8(part, 8 * who[1], y1)
        store8(part, 8 * who[2], y2)
        store8(part, 8 * who[3], y3)
        if both != 0:
            store8(other, 8 * who[0], z0)
            store8(other, 8 * who[1], z1)
            store8(other, 8 * who[2], z2)
            store8(other, 8 * who[3], z3)
        done = 4
    while done < members:
        y = load8(part, 8 * who[done])
        z = load8(other, 8 * who[done])
        for e in range(count):
            f = load8(own, e * far + 8 * done)
            y -= load8(part, 8 * rows[e]) * f
            if both != 0:
                z -= load8(other, 8 * rows[e]) * f
        store8(part, 8 * who[done], y)
        if both != 0:
            store8(other, 8 * who[done], z)
        done += 1
    _backward_corner(members, kinds, who, factors, part)
    if both != 0:
        _backward_corner(members, kinds, who, factors, other)


@native(fast=True, inline=True)
def _carry_back(back: i64, step: i64, group: i64s, index: i32s, code: i32s, y: f64s, part: f64s) -> None:
    """Move the solution for a step's F, which is what has just been found for the next step's U, to its place."""
    if back > 0:
        own = group[OWN]
        following = code[group[FOLLOWING] :]
        for k in range(group[NEXT]):
            store8(part, 8 * (own + k), load8(part, 8 * following[k]))
    else:
        collect_following(step, group, index, code, y, part)


@native(fast=True, inline=True)
def forward(
    both: i64, distance: i64, groups: i64, table: i64s, index: i32s, code: i32s, factors: f64s, x: f64s, y: f64s,
    left: f64s, other_x: f64s, other_y: f64s, other_left: f64s, part: f64s,
) -> None:  # fmt: skip
    """Forward substitution and division by D from ``x`` to ``y``; what is left for others is added to ``left``.

    Args:
        both: 1 to do the same from ``other_x`` to ``other_y`` and ``other_left`` in the same pass; a constant.
        distance: how far ahead memory is asked for, which is written past the caches then; 0 where it is near.
        groups, table, index, code, factors: see ``eliminate``.
        part: work space, for two vectors when ``both``.
    """
    for g in range(groups):
        group = table[g * FIELDS :]
        own = group[OWN]
        size = own + group[NEXT] + group[LEFT] + group[BORDER]
        other = part[8 * size :]
        at = 8 * group[FACTORS]
        for k in range(own, size):
            store8(part, 8 * k, 0.0)
            if both != 0:
                store8(other, 8 * k, 0.0)
        for step in range(group[STEPS]):
            here = group[UNKNOWNS] + 8 * step * own
            ask_ahead(distance, own, 8, here, x)
            collect_own(step, group, x, part)
            if both != 0:
                ask_ahead(distance, own, 8, here, other_x)
                collect_own(step, group, other_x, other)
            if step > 0:
                add_following(group, code, part)
                if both != 0:
                    add_following(group, code, other)
            panel = code[group[PANEL_CODE] :]
            for _panel in range(group[PANELS]):
                members = panel[0]
                count = panel[1]
                rows = panel[2 + 2 * members :]
                ask_ahead(distance, panel_vectors(members, count), 8, at, factors)
                _forward_panel(
                    both, members, count, panel[2:], panel[2 + members :], rows, factors[at:], part, other
                )
                panel = rows[count + members * (members + count) :]
                at += 8 * panel_vectors(members, count)
            put_vectors(distance, own, part, here, y)
            if both != 0:
                put_vectors(distance, own, other, here, other_y)
        add_outside(group, index, part, left)
        if both != 0:
            add_outside(group, index, other, other_left)


@native(fast=True, inline=True)
def backward(
    both: i64, distance: i64, groups: i64, table: i64s, index: i32s, code: i32s, factors: f64s, x: f64s, y: f64s,
    other_x: f64s, other_y: f64s, part: f64s,
) -> None:  # fmt: skip
    """Back substitution from ``x`` to ``y``, in which the solution outside the segments is; arguments as above."""
    for g in range(groups):
        group = table[g * FIELDS :]
        own = group[OWN]
        other = part[8 * (own + group[NEXT] + group[LEFT] + group[BORDER]) :]
        collect_ends(group, index, y, part)
        if both != 0:
            collect_ends(group, index, other_y, other)
        starts = code[group[PANEL_STARTS] :]
        at = 8 * (group[FACTORS] + group[STEPS] * group[FACTOR_STEP])
        for back in range(group[STEPS]):
            step = group[STEPS] - 1 - back
            here = group[UNKNOWNS] + 8 * step * own
            ask_behind(distance, own, here, x)
            _carry_back(back, step, group, index, code, y, part)
            collect_own(step, group, x, part)
            if both != 0:
                ask_behind(distance, own, here, other_x)
                _carry_back(back, step, group, index, code, other_y, other)
                collect_own(step, group, other_x, other)
            for last in range(group[PANELS]):
                panel = code[starts[group[PANELS] - 1 - last] :]
                members = panel[0]
                count = panel[1]
                at -= 8 * panel_vectors(members, count)
                ask_behind(distance, panel_vectors(members, count), at, factors)
                _backward_panel(
                    both, members, count, panel[2:], panel[2 + members :], panel[2 + 2 * members :], factors[at:], part,
                    other,
                )  # fmt: skip
            put_vectors(distance, own, part, here, y)
            if both != 0:
                put_vectors(distance, own, other, here, other_y)
