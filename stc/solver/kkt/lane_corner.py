"""The members of a panel eliminated from each other, in eight segments at once (see stc.solver.kkt.lane_panel).

All of it is done in registers and without a loop: there are formulas for every way to divide up to four members into
pivots of one and two unknowns.
"""

from __future__ import annotations

from stc.codegen.native import f64, f64s, i32s, i64, native
from stc.codegen.native_vector import absw, loadw, maxw, negativew, splatw, storew
from stc.solver.kkt.lane_state import NEGATIVE, WORST

__all__ = ["BESIDE", "CORNER", "KNOWN", "MOST", "take_corner"]

#: Makes any number nothing, but not infinity.
NO_SHARE = 1e-200
#: Places in what is known of the members of a panel, eight numbers each: D^-1 on its diagonal, L in the corner (01, 02,
#: 03, 12, 13, 23), D^-1 beside its diagonal, and the largest entries of C; numbers of all.
CORNER = 32
BESIDE = 80
MOST = 104
KNOWN = 136


@native(fused=True, inline=True)
def take_corner(
    part: i64, members: i64, length: i64, kinds: i32s, sources: i32s, suspect: f64, work: f64s, known: f64s,
    factors: f64s, state: f64s,
) -> None:  # fmt: skip
    """Eliminate the members from each other; that is the corner of C.

    Args:
        part: lane at which to begin, of as many as a register holds.
        members: one to four; a constant.
        length: of C's rows.
    """
    nothing = splatw(0.0)
    negative = loadw(state, NEGATIVE + part)
    a00 = loadw(work, 8 * sources[0] + part)
    a01 = nothing
    a02 = nothing
    a03 = nothing
    a11 = nothing
    a12 = nothing
    a13 = nothing
    a22 = nothing
    a23 = nothing
    a33 = nothing
    if members > 1:
        a01 = loadw(work, 8 * sources[1] + part)
        a11 = loadw(work, 8 * sources[length + 1] + part)
    if members > 2:
        a02 = loadw(work, 8 * sources[2] + part)
        a12 = loadw(work, 8 * sources[length + 2] + part)
        a22 = loadw(work, 8 * sources[2 * length + 2] + part)
    if members > 3:
        a03 = loadw(work, 8 * sources[3] + part)
        a13 = loadw(work, 8 * sources[length + 3] + part)
        a23 = loadw(work, 8 * sources[2 * length + 3] + part)
        a33 = loadw(work, 8 * sources[3 * length + 3] + part)
    d0 = nothing
    d1 = nothing
    d2 = nothing
    d3 = nothing
    l01 = nothing
    l02 = nothing
    l03 = nothing
    l12 = nothing
    l13 = nothing
    l23 = nothing
    # Entries of D^-1 beside the diagonal; one of both is zero where the other is not.
    e01 = nothing
    e12 = nothing
    e23 = nothing
    most0 = nothing
    most1 = nothing
    most2 = nothing
    # All of D^-1 may be undefined (0 times infinity): the reciprocal is infinite then.
    undefined = nothing
    if members > 1 and kinds[0] == 2:
        determinant = a00 * a11 - a01 * a01
        reciprocal = 1.0 / determinant
        d0 = a11 * reciprocal
        d1 = a00 * reciprocal
        e01 = -(a01 * reciprocal)
        undefined = absw(reciprocal)
        mixed = negativew(determinant)
        negative += mixed + 2.0 * (1.0 - mixed) * negativew(a00)
        if members > 2:
            l02 = d0 * a02 + e01 * a12
            l12 = d1 * a12 + e01 * a02
            a22 = a22 - l02 * a02 - l12 * a12
            most0 = absw(a02)
            most1 = absw(a12)
        if members > 3:
            l03 = d0 * a03 + e01 * a13
            l13 = d1 * a13 + e01 * a03
            a23 = a23 - l02 * a03 - l12 * a13
            a33 = a33 - l03 * a03 - l13 * a13
            most0 = maxw(absw(a03), most0)
            most1 = maxw(absw(a13), most1)
    else:
        d0 = 1.0 / a00
        negative += negativew(a00)
        if members > 1:
            l01 = d0 * a01
            a11 = a11 - l01 * a01
            most0 = absw(a01)
        if members > 2:
            l02 = d0 * a02
            a12 = a12 - l01 * a02
            a22 = a22 - l02 * a02
            most0 = maxw(absw(a02), most0)
        if members > 3:
            l03 = d0 * a03
            a13 = a13 - l01 * a03
            a23 = a23 - l02 * a03
            a33 = a33 - l03 * a03
            most0 = maxw(absw(a03), most0)
        if members > 2 and kinds[1] == 2:
            determinant = a11 * a22 - a12 * a12
            reciprocal = 1.0 / determinant
            d1 = a22 * reciprocal
            d2 = a11 * reciprocal
            e12 = -(a12 * reciprocal)
            undefined = absw(reciprocal)
            mixed = negativew(determinant)
            negative += mixed + 2.0 * (1.0 - mixed) * negativew(a11)
            if members > 3:
                l13 = d1 * a13 + e12 * a23
                l23 = d2 * a23 + e12 * a13
                a33 = a33 - l13 * a13 - l23 * a23
                most1 = absw(a13)
                most2 = absw(a23)
        elif members > 1:
            d1 = 1.0 / a11
            negative += negativew(a11)
            if members > 2:
                l12 = d1 * a12
                a22 = a22 - l12 * a12
                most1 = absw(a12)
            if members > 3:
                l13 = d1 * a13
                a23 = a23 - l12 * a13
                a33 = a33 - l13 * a13
                most1 = maxw(absw(a13), most1)
    if members > 3 and kinds[2] == 2:
        determinant = a22 * a33 - a23 * a23
        reciprocal = 1.0 / determinant
        d2 = a33 * reciprocal
        d3 = a22 * reciprocal
        e23 = -(a23 * reciprocal)
        undefined = maxw(absw(reciprocal), undefined)
        mixed = negativew(determinant)
        negative += mixed + 2.0 * (1.0 - mixed) * negativew(a22)
    elif members > 2 and kinds[2] == 1:
        d2 = 1.0 / a22
        negative += negativew(a22)
        if members > 3:
            l23 = d2 * a23
            a33 = a33 - l23 * a23
            most2 = absw(a23)
    if members > 3 and kinds[3] == 1:
        d3 = 1.0 / a33
        negative += negativew(a33)
    storew(state, NEGATIVE + part, negative)
    storew(state, WORST + part, maxw(undefined * (NO_SHARE * suspect), loadw(state, WORST + part)))
    storew(known, part, d0)
    storew(known, MOST + part, most0)
    storew(factors, part, d0)
    if members > 1:
        storew(known, 8 + part, d1)
        storew(known, CORNER + part, l01)
        storew(known, BESIDE + part, e01)
        storew(known, MOST + 8 + part, most1)
        storew(factors, 8 + part, l01 + e01)
        storew(factors, 8 * members + part, d1)
    if members > 2:
        storew(known, 16 + part, d2)
        storew(known, CORNER + 8 + part, l02)
        storew(known, CORNER + 24 + part, l12)
        storew(known, BESIDE + 8 + part, e12)
        storew(known, MOST + 16 + part, most2)
        storew(factors, 16 + part, l02)
        storew(factors, 8 * members + 8 + part, l12 + e12)
        storew(factors, 16 * members - 8 + part, d2)
    if members > 3:
        storew(known, 24 + part, d3)
        storew(known, CORNER + 16 + part, l03)
        storew(known, CORNER + 32 + part, l13)
        storew(known, CORNER + 40 + part, l23)
        storew(known, BESIDE + 16 + part, e23)
        storew(known, MOST + 24 + part, nothing)
        storew(factors, 24 + part, l03)
        storew(factors, 48 + part, l13)
        storew(factors, 64 + part, l23 + e23)
        storew(factors, 72 + part, d3)
