"""Substitutions with the factors of stc.solver.kkt.lanes, eight segments at once.

Both work on one vector of all unknowns: what is left when the segments are done concerns the others alone.
"""

from __future__ import annotations

from stc.codegen.native import f64s, i32s, i64, i64s, native
from stc.codegen.native_vector import gather8, load8, scatter8, store8
from stc.solver.kkt.lanes import (
    BORDER,
    ENDS,
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
    SEGMENTS,
    STEPS,
    UNKNOWNS,
)

__all__ = ["backward", "forward"]


@native(fast=True, inline=True)
def _forward_panel(
    members: i64, count: i64, kinds: i32s, who: i32s, rows: i32s, factors: f64s, part: f64s
) -> None:  # fmt: skip
    """Forward substitution and division by D for one panel."""
    length = members + count
    for p in range(members):
        y = load8(part, 8 * who[p])
        row = 8 * p * length
        for q in range(p + 1, members):
            to = 8 * who[q]
            store8(part, to, load8(part, to) - y * load8(factors, row + 8 * q))
    p = 0
    far = 8 * length
    if members == 4:
        y0 = load8(part, 8 * who[0])
        y1 = load8(part, 8 * who[1])
        y2 = load8(part, 8 * who[2])
        y3 = load8(part, 8 * who[3])
        for e in range(count):
            to = 8 * rows[e]
            at = 8 * (4 + e)
            value = load8(part, to) - y0 * load8(factors, at) - y1 * load8(factors, at + far)
            value = value - y2 * load8(factors, at + 2 * far) - y3 * load8(factors, at + 3 * far)
            store8(part, to, value)
        p = 4
    while p < members:
        y = load8(part, 8 * who[p])
        row = 8 * (p * length + members)
        for e in range(count):
            to = 8 * rows[e]
            store8(part, to, load8(part, to) - y * load8(factors, row + 8 * e))
        p += 1
    p = 0
    while p < members:
        own = 8 * (p * length + p)
        y = load8(part, 8 * who[p])
        if kinds[p] == 2:
            z = load8(part, 8 * who[p + 1])
            mixed = load8(factors, own + far)
            store8(part, 8 * who[p], y * load8(factors, own) + z * mixed)
            store8(part, 8 * who[p + 1], y * mixed + z * load8(factors, own + far + 8))
            p += 2
        else:
            store8(part, 8 * who[p], y * load8(factors, own))
            p += 1


@native(fast=True, inline=True)
def _backward_panel(members: i64, count: i64, who: i32s, rows: i32s, factors: f64s, part: f64s) -> None:
    """Back substitution for one panel."""
    length = members + count
    far = 8 * length
    done = 0
    if members == 4:
        y0 = load8(part, 8 * who[0])
        y1 = load8(part, 8 * who[1])
        y2 = load8(part, 8 * who[2])
        y3 = load8(part, 8 * who[3])
        for e in range(count):
            value = load8(part, 8 * rows[e])
            at = 8 * (4 + e)
            y0 -= value * load8(factors, at)
            y1 -= value * load8(factors, at + far)
            y2 -= value * load8(factors, at + 2 * far)
            y3 -= value * load8(factors, at + 3 * far)
        store8(part, 8 * who[0], y0)
        store8(part, 8 * who[1], y1)
        store8(part, 8 * who[2], y2)
        store8(part, 8 * who[3], y3)
        done = 4
    while done < members:
        y = load8(part, 8 * who[done])
        row = 8 * (done * length + members)
        for e in range(count):
            y -= load8(part, 8 * rows[e]) * load8(factors, row + 8 * e)
        store8(part, 8 * who[done], y)
        done += 1
    for back in range(members):
        p = members - 1 - back
        y = load8(part, 8 * who[p])
        row = 8 * p * length
        for q in range(p + 1, members):
            y -= load8(part, 8 * who[q]) * load8(factors, row + 8 * q)
        store8(part, 8 * who[p], y)


@native(fast=True)
def forward(groups: i64, table: i64s, index: i32s, code: i32s, factors: f64s, x: f64s, part: f64s) -> None:
    """Forward substitution and division by D in ``x`` (N,), whose entries outside the segments change accordingly.

    The other arguments are those of ``eliminate``; ``part`` is work space.
    """
    for g in range(groups):
        group = table[g * FIELDS :]
        own = group[OWN]
        near = own + group[NEXT]
        ends = group[LEFT] + group[BORDER]
        at = 8 * group[FACTORS]
        for k in range(own, near + ends):
            store8(part, 8 * k, 0.0)
        following = code[group[FOLLOWING] :]
        for step in range(group[STEPS]):
            unknowns = index[group[UNKNOWNS] + 8 * step * near :]
            for k in range(own):
                store8(part, 8 * k, gather8(x, unknowns, 8 * k))
            if step > 0:
                for k in range(group[NEXT]):
                    to = 8 * following[k]
                    store8(part, to, load8(part, to) + load8(part, 8 * (own + k)))
                    store8(part, 8 * (own + k), 0.0)
            panel = code[group[PANEL_CODE] :]
            for _panel in range(group[PANELS]):
                members = panel[0]
                count = panel[1]
                size = members * (members + count)
                rows = panel[2 + 2 * members :]
                _forward_panel(members, count, panel[2:], panel[2 + members :], rows, factors[at:], part)
                panel = rows[count + size :]
                at += 8 * size
            for k in range(own):
                scatter8(x, unknowns, 8 * k, load8(part, 8 * k))
        last = index[group[UNKNOWNS] + 8 * ((group[STEPS] - 1) * near + own) :]
        outer = index[group[ENDS] :]
        for lane in range(group[SEGMENTS]):
            for k in range(group[NEXT]):
                x[last[8 * k + lane]] += part[8 * (own + k) + lane]
            for k in range(ends):
                x[outer[8 * k + lane]] += part[8 * (near + k) + lane]


@native(fast=True)
def backward(groups: i64, table: i64s, index: i32s, code: i32s, factors: f64s, x: f64s, part: f64s) -> None:
    """Back substitution in ``x``, in which the solution outside the segments is known."""
    for g in range(groups):
        group = table[g * FIELDS :]
        own = group[OWN]
        near = own + group[NEXT]
        ends = group[LEFT] + group[BORDER]
        outer = index[group[ENDS] :]
        for k in range(ends):
            store8(part, 8 * (near + k), gather8(x, outer, 8 * k))
        starts = code[group[PANEL_STARTS] :]
        at = 8 * (group[FACTORS] + group[STEPS] * group[FACTOR_STEP])
        for back in range(group[STEPS]):
            step = group[STEPS] - 1 - back
            unknowns = index[group[UNKNOWNS] + 8 * step * near :]
            for k in range(near):
                store8(part, 8 * k, gather8(x, unknowns, 8 * k))
            for last in range(group[PANELS]):
                panel = code[starts[group[PANELS] - 1 - last] :]
                members = panel[0]
                count = panel[1]
                at -= 8 * members * (members + count)
                _backward_panel(
                    members, count, panel[2 + members :], panel[2 + 2 * members :], factors[at:], part
                )
            for k in range(own):
                scatter8(x, unknowns, 8 * k, load8(part, 8 * k))
