"""Panels of one, two or four unknowns, taken out of the window of a stage (see stc.solver.kkt.chain_elimination).

D has blocks of one and, for the first or last two members of a panel, of two unknowns.  A panel is a list of numbers:

    members; 2 where the first two make one pivot; the same of the last two; row of the first member (the others are
    above); blocks; rows
    for each block: its column, and how many rows have it to the left of their diagonal or on it
    for each row, decreasing: where it begins in the window, and where its factor is, behind those of the corner

Its factors are D^-1 and L of the corner, where its members meet, then D^-1 C, block by block, C being the members' rows
once they have been eliminated from each other.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, fabs, i32s, i64, native, sqrt
from stc.codegen.native_vector import largest8, load8, max8, splat8, store8
from stc.solver.kkt.lane_memory import ask_ahead
from stc.solver.kkt.lane_state import LARGEST

__all__ = ["NEGATIVE", "begin_tests", "invert_corner", "take_panel", "worst_test"]

#: Places in ``state``: the largest entries on the diagonal of D^-1 so far, in groups of eight; the largest products due
#: to these, the same; a sum that is finite if all pivots are; negative pivots; the largest entry of D^-1 beside the
#: diagonal; the square of the largest product due to one. Others are as in lane_state.
INVERSE, PRODUCT, CHECK, NEGATIVE, BESIDE, MIXED = 0, 8, 19, 20, 21, 22
#: Of a panel's factors, behind those of the corner: the first terms of the largest products.
FIRST_PRODUCTS = 12


@native(inline=True)
def begin_tests(state: f64s) -> None:
    """Forget what pivots have been so far."""
    for k in range(LARGEST):
        state[k] = 0.0
    state[CHECK] = 0.0
    state[NEGATIVE] = 0.0
    state[BESIDE] = 0.0
    state[MIXED] = 0.0


@native(fast=True, inline=True)
def worst_test(growth: f64, suspect: f64, state: f64s) -> f64:
    """What the test of all pivots so far is; nan where one of them is not finite."""
    product = largest8(load8(state, PRODUCT)) + sqrt(state[MIXED])
    worst = max(growth * product, suspect * max(largest8(load8(state, INVERSE)), state[BESIDE]))
    return worst + 0.0 * state[CHECK]


@native(fast=True, inline=True)
def _note_pair(e: f64, square: f64, other_square: f64, state: f64s) -> None:
    """Note the entry beside the diagonal of an inverse, and what it adds, by the largest squares of two rows of C."""
    state[BESIDE] = max(state[BESIDE], fabs(e))
    state[MIXED] = max(state[MIXED], 4.0 * e * e * square * other_square)
    state[CHECK] += e


@native(fast=True)
def _invert_four(panel: i32s, stride: i64, window: f64s, factors: f64s, state: f64s) -> None:
    """L and D^-1 of the corner where four unknowns meet."""
    high = panel[3]
    place = high * (stride + 1)
    a00 = window[place]
    a01 = window[place - 1]
    a02 = window[place - 2]
    a03 = window[place - 3]
    a11 = window[place - stride - 1]
    a12 = window[place - stride - 2]
    a13 = window[place - stride - 3]
    a22 = window[place - 2 * stride - 2]
    a23 = window[place - 2 * stride - 3]
    a33 = window[place - 3 * stride - 3]
    negative = 0.0
    e01 = 0.0
    e23 = 0.0
    l01 = 0.0
    l23 = 0.0
    if panel[1] == 2:
        determinant = a00 * a11 - a01 * a01
        reciprocal = 1.0 / determinant
        d0 = a11 * reciprocal
        d1 = a00 * reciprocal
        e01 = -(a01 * reciprocal)
        l02 = d0 * a02 + e01 * a12
        l03 = d0 * a03 + e01 * a13
        l12 = d1 * a12 + e01 * a02
        l13 = d1 * a13 + e01 * a03
        negative += 1.0 if determinant < 0.0 else (2.0 if a00 < 0.0 else 0.0)
    else:
        # The second pivot is the quotient of two determinants, so that neither division waits for the other.
        d0 = 1.0 / a00
        d1 = a00 / (a00 * a11 - a01 * a01)
        l01 = d0 * a01
        l02 = d0 * a02
        l03 = d0 * a03
        a12 -= l01 * a02
        a13 -= l01 * a03
        l12 = d1 * a12
        l13 = d1 * a13
        negative += (1.0 if d0 < 0.0 else 0.0) + (1.0 if d1 < 0.0 else 0.0)
    a22 -= l02 * a02 + l12 * a12
    a23 -= l02 * a03 + l12 * a13
    a33 -= l03 * a03 + l13 * a13
    if panel[2] == 2:
        determinant = a22 * a33 - a23 * a23
        reciprocal = 1.0 / determinant
        d2 = a33 * reciprocal
        d3 = a22 * reciprocal
        e23 = -(a23 * reciprocal)
        negative += 1.0 if determinant < 0.0 else (2.0 if a22 < 0.0 else 0.0)
    else:
        d2 = 1.0 / a22
        d3 = a22 / (a22 * a33 - a23 * a23)
        l23 = d2 * a23
        negative += (1.0 if d2 < 0.0 else 0.0) + (1.0 if d3 < 0.0 else 0.0)
    factors[0] = d0
    factors[1] = d1
    factors[2] = d2
    factors[3] = d3
    factors[4] = e01
    factors[5] = e23
    factors[6] = l01
    factors[7] = l02
    factors[8] = l03
    factors[9] = l12
    factors[10] = l13
    factors[11] = l23
    factors[FIRST_PRODUCTS] = a01 * a01 + a02 * a02 + a03 * a03
    factors[FIRST_PRODUCTS + 1] = a12 * a12 + a13 * a13
    factors[FIRST_PRODUCTS + 2] = a23 * a23
    state[NEGATIVE] += negative


@native(fused=True)
def _take_four(
    distance: i64, panel: i32s, stride: i64, masks: f64s, window: f64s, factors: f64s, state: f64s
) -> None:  # fmt: skip
    """Take four unknowns out of the window, whose corner is done."""
    high = panel[3]
    d0 = factors[0]
    d1 = factors[1]
    d2 = factors[2]
    d3 = factors[3]
    e01 = factors[4]
    e23 = factors[5]
    l01 = factors[6]
    l02 = factors[7]
    l03 = factors[8]
    l12 = factors[9]
    l13 = factors[10]
    l23 = factors[11]
    blocks = panel[4]
    columns = panel[6:]
    rows = columns[2 * blocks :]
    m0 = splat8(factors[FIRST_PRODUCTS])
    m1 = splat8(factors[FIRST_PRODUCTS + 1])
    m2 = splat8(factors[FIRST_PRODUCTS + 2])
    m3 = splat8(0.0)
    first = columns[0]
    at = high * stride
    # In the first block there may be columns of the panel itself.
    mask = load8(masks, 8 * min(max(high - 3 - first, 0), 8))
    b = 0
    if blocks % 2 == 1:
        c0 = load8(window, at + first) * mask
        c1 = load8(window, at - stride + first) * mask - l01 * c0
        c2 = load8(window, at - 2 * stride + first) * mask - l02 * c0 - l12 * c1
        c3 = load8(window, at - 3 * stride + first) * mask - l03 * c0 - l13 * c1 - l23 * c2
        ask_ahead(distance, 4, 8, 16, factors)
        store8(factors, 16, d0 * c0 + e01 * c1)
        store8(factors, 24, d1 * c1 + e01 * c0)
        store8(factors, 32, d2 * c2 + e23 * c3)
        store8(factors, 40, d3 * c3 + e23 * c2)
        m0 = max8(c0 * c0, m0)
        m1 = max8(c1 * c1, m1)
        m2 = max8(c2 * c2, m2)
        m3 = max8(c3 * c3, m3)
        for r in range(columns[1]):
            to = rows[2 * r] + first
            k = rows[2 * r + 1]
            value = load8(window, to) - factors[k] * c0 - factors[k + 8] * c1
            store8(window, to, value - factors[k + 16] * c2 - factors[k + 24] * c3)
        b = 1
        mask = splat8(1.0)
    while b < blocks:
        # Two blocks at a time: rows have the same factors for both.
        column = columns[2 * b]
        other = columns[2 * b + 2]
        c0 = load8(window, at + column) * mask
        c1 = load8(window, at - stride + column) * mask - l01 * c0
        c2 = load8(window, at - 2 * stride + column) * mask - l02 * c0 - l12 * c1
        c3 = load8(window, at - 3 * stride + column) * mask - l03 * c0 - l13 * c1 - l23 * c2
        o0 = load8(window, at + other)
        o1 = load8(window, at - stride + other) - l01 * o0
        o2 = load8(window, at - 2 * stride + other) - l02 * o0 - l12 * o1
        o3 = load8(window, at - 3 * stride + other) - l03 * o0 - l13 * o1 - l23 * o2
        own = 16 + 32 * b
        ask_ahead(distance, 8, 8, own, factors)
        store8(factors, own, d0 * c0 + e01 * c1)
        store8(factors, own + 8, d1 * c1 + e01 * c0)
        store8(factors, own + 16, d2 * c2 + e23 * c3)
        store8(factors, own + 24, d3 * c3 + e23 * c2)
        store8(factors, own + 32, d0 * o0 + e01 * o1)
        store8(factors, own + 40, d1 * o1 + e01 * o0)
        store8(factors, own + 48, d2 * o2 + e23 * o3)
        store8(factors, own + 56, d3 * o3 + e23 * o2)
        m0 = max8(o0 * o0, max8(c0 * c0, m0))
        m1 = max8(o1 * o1, max8(c1 * c1, m1))
        m2 = max8(o2 * o2, max8(c2 * c2, m2))
        m3 = max8(o3 * o3, max8(c3 * c3, m3))
        both = columns[2 * b + 1]
        for r in range(both):
            to = rows[2 * r]
            k = rows[2 * r + 1]
            f0 = factors[k]
            f1 = factors[k + 8]
            f2 = factors[k + 16]
            f3 = factors[k + 24]
            value = load8(window, to + column) - f0 * c0 - f1 * c1
            beside = load8(window, to + other) - f0 * o0 - f1 * o1
            store8(window, to + column, value - f2 * c2 - f3 * c3)
            store8(window, to + other, beside - f2 * o2 - f3 * o3)
        for r in range(both, columns[2 * b + 3]):
            to = rows[2 * r] + other
            k = rows[2 * r + 1]
            value = load8(window, to) - factors[k] * o0 - factors[k + 8] * o1
            store8(window, to, value - factors[k + 16] * o2 - factors[k + 24] * o3)
        b += 2
        mask = splat8(1.0)
    s0 = fabs(d0)
    s1 = fabs(d1)
    s2 = fabs(d2)
    s3 = fabs(d3)
    if panel[1] == 2:
        _note_pair(e01, largest8(m0), largest8(m1), state)
    if panel[2] == 2:
        _note_pair(e23, largest8(m2), largest8(m3), state)
    inverse = max8(max8(splat8(s0), splat8(s1)), max8(splat8(s2), splat8(s3)))
    store8(state, INVERSE, max8(inverse, load8(state, INVERSE)))
    product = max8(max8(m0 * s0, m1 * s1), max8(m2 * s2, m3 * s3))
    store8(state, PRODUCT, max8(product, load8(state, PRODUCT)))
    state[CHECK] += s0 + s1 + s2 + s3


@native(fast=True)
def _invert_two(panel: i32s, stride: i64, window: f64s, factors: f64s, state: f64s) -> None:
    """The same as ``_invert_four`` for two."""
    high = panel[3]
    place = high * (stride + 1)
    a00 = window[place]
    a01 = window[place - 1]
    a11 = window[place - stride - 1]
    e01 = 0.0
    l01 = 0.0
    if panel[1] == 2:
        determinant = a00 * a11 - a01 * a01
        reciprocal = 1.0 / determinant
        d0 = a11 * reciprocal
        d1 = a00 * reciprocal
        e01 = -(a01 * reciprocal)
        negative = 1.0 if determinant < 0.0 else (2.0 if a00 < 0.0 else 0.0)
    else:
        d0 = 1.0 / a00
        d1 = a00 / (a00 * a11 - a01 * a01)
        l01 = d0 * a01
        negative = (1.0 if d0 < 0.0 else 0.0) + (1.0 if d1 < 0.0 else 0.0)
    factors[0] = d0
    factors[1] = d1
    factors[2] = e01
    factors[3] = l01
    factors[4] = a01 * a01
    state[NEGATIVE] += negative


@native(fused=True)
def _take_two(
    distance: i64, panel: i32s, stride: i64, masks: f64s, window: f64s, factors: f64s, state: f64s
) -> None:  # fmt: skip
    """The same as ``_take_four`` for two."""
    high = panel[3]
    d0 = factors[0]
    d1 = factors[1]
    e01 = factors[2]
    l01 = factors[3]
    blocks = panel[4]
    columns = panel[6:]
    rows = columns[2 * blocks :]
    m0 = splat8(factors[4])
    m1 = splat8(0.0)
    for b in range(blocks):
        column = columns[2 * b]
        at = high * stride + column
        mask = load8(masks, 8 * min(max(high - 1 - column, 0), 8))
        c0 = load8(window, at) * mask
        c1 = load8(window, at - stride) * mask - l01 * c0
        own = 8 + 16 * b
        ask_ahead(distance, 2, 8, own, factors)
        store8(factors, own, d0 * c0 + e01 * c1)
        store8(factors, own + 8, d1 * c1 + e01 * c0)
        m0 = max8(c0 * c0, m0)
        m1 = max8(c1 * c1, m1)
        for r in range(columns[2 * b + 1]):
            to = rows[2 * r] + column
            k = rows[2 * r + 1]
            store8(window, to, load8(window, to) - factors[k] * c0 - factors[k + 8] * c1)
    s0 = fabs(d0)
    s1 = fabs(d1)
    if panel[1] == 2:
        _note_pair(e01, largest8(m0), largest8(m1), state)
    store8(state, INVERSE, max8(max8(splat8(s0), splat8(s1)), load8(state, INVERSE)))
    store8(state, PRODUCT, max8(max8(m0 * s0, m1 * s1), load8(state, PRODUCT)))
    state[CHECK] += s0 + s1


@native(fused=True)
def _take_one(
    distance: i64, panel: i32s, stride: i64, masks: f64s, window: f64s, factors: f64s, state: f64s
) -> None:  # fmt: skip
    """The same for one."""
    high = panel[3]
    d0 = factors[0]
    blocks = panel[4]
    columns = panel[6:]
    rows = columns[2 * blocks :]
    most = splat8(0.0)
    for b in range(blocks):
        column = columns[2 * b]
        c0 = load8(window, high * stride + column) * load8(masks, 8 * min(max(high - column, 0), 8))
        f0 = d0 * c0
        ask_ahead(distance, 1, 0, 8 + 8 * b, factors)
        store8(factors, 8 + 8 * b, f0)
        most = max8(c0 * c0, most)
        for r in range(columns[2 * b + 1]):
            to = rows[2 * r] + column
            store8(window, to, load8(window, to) - factors[rows[2 * r + 1]] * c0)
    store8(state, INVERSE, max8(splat8(fabs(d0)), load8(state, INVERSE)))
    store8(state, PRODUCT, max8(most * fabs(d0), load8(state, PRODUCT)))
    state[NEGATIVE] += 1.0 if d0 < 0.0 else 0.0
    state[CHECK] += fabs(d0)


@native(fast=True, inline=True)
def invert_corner(panel: i32s, stride: i64, window: f64s, factors: f64s, state: f64s) -> None:
    """L and D^-1 of the corner of a panel."""
    if panel[0] == 4:
        _invert_four(panel, stride, window, factors, state)
    elif panel[0] == 2:
        _invert_two(panel, stride, window, factors, state)
    else:
        factors[0] = 1.0 / window[panel[3] * (stride + 1)]


@native(fast=True, inline=True)
def take_panel(
    distance: i64, panel: i32s, stride: i64, masks: f64s, window: f64s, factors: f64s, state: f64s
) -> None:  # fmt: skip
    """Take a panel out of the window, whose corner is done.

    Args:
        distance: how far ahead memory is asked for, 0 where it is near.
        masks: k ones and 8 - k zeros, for k from 0 to 8.
        factors: those of the panel; state: see above.
    """
    if panel[0] == 4:
        _take_four(distance, panel, stride, masks, window, factors, state)
    elif panel[0] == 2:
        _take_two(distance, panel, stride, masks, window, factors, state)
    else:
        _take_one(distance, panel, stride, masks, window, factors, state)
