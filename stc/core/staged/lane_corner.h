/* The members of a panel eliminated from each other, in eight segments at once (see lane_panel.h). */
#ifndef STC_LANE_CORNER_H
#define STC_LANE_CORNER_H

#include "../native.h"
#include "../vec8.h"
#include "lane_state.h"

/* Makes any number nothing, but not infinity. */
#define NO_SHARE 1e-200
/* Places in what is known of the members of a panel, eight numbers each: D^-1 on its diagonal, L in the corner (01, 02,
 * 03, 12, 13, 23), D^-1 beside its diagonal, and the largest entries of C; numbers of all. */
enum {
    CORNER = 32,
    LANE_CORNER_BESIDE = 80,
    LANE_CORNER_MOST = 104,
};

/* Eliminate the members from each other; that is the corner of C.
 *
 * part: lane at which to begin, of as many as a register holds.
 * members: one to four; a constant.
 * length: of C's rows. */
ALWAYS_INLINE void lane_corner_take_corner(int64_t part, int64_t members, int64_t length,
                                           const int32_t *restrict kinds, const int32_t *restrict sources,
                                           double suspect, const double *restrict work, double *restrict known,
                                           double *restrict factors, double *restrict state) {
    lanes nothing = splatw(0.0);
    lanes negative = loadw(state, LANE_STATE_NEGATIVE + part);
    lanes a00 = loadw(work, 8 * (int64_t)sources[0] + part);
    lanes a01 = nothing;
    lanes a02 = nothing;
    lanes a03 = nothing;
    lanes a11 = nothing;
    lanes a12 = nothing;
    lanes a13 = nothing;
    lanes a22 = nothing;
    lanes a23 = nothing;
    lanes a33 = nothing;
    if (members > 1) {
        a01 = loadw(work, 8 * (int64_t)sources[1] + part);
        a11 = loadw(work, 8 * (int64_t)sources[length + 1] + part);
    }
    if (members > 2) {
        a02 = loadw(work, 8 * (int64_t)sources[2] + part);
        a12 = loadw(work, 8 * (int64_t)sources[length + 2] + part);
        a22 = loadw(work, 8 * (int64_t)sources[2 * length + 2] + part);
    }
    if (members > 3) {
        a03 = loadw(work, 8 * (int64_t)sources[3] + part);
        a13 = loadw(work, 8 * (int64_t)sources[length + 3] + part);
        a23 = loadw(work, 8 * (int64_t)sources[2 * length + 3] + part);
        a33 = loadw(work, 8 * (int64_t)sources[3 * length + 3] + part);
    }
    lanes d0 = nothing;
    lanes d1 = nothing;
    lanes d2 = nothing;
    lanes d3 = nothing;
    lanes l01 = nothing;
    lanes l02 = nothing;
    lanes l03 = nothing;
    lanes l12 = nothing;
    lanes l13 = nothing;
    lanes l23 = nothing;
    /* Entries of D^-1 beside the diagonal; one of both is zero where the other is not. */
    lanes e01 = nothing;
    lanes e12 = nothing;
    lanes e23 = nothing;
    lanes most0 = nothing;
    lanes most1 = nothing;
    lanes most2 = nothing;
    /* All of D^-1 may be undefined (0 times infinity): the reciprocal is infinite then. */
    lanes undefined = nothing;
    if (members > 1 && kinds[0] == 2) {
        lanes determinant = a00 * a11 - a01 * a01;
        lanes reciprocal = 1.0 / determinant;
        d0 = a11 * reciprocal;
        d1 = a00 * reciprocal;
        e01 = -(a01 * reciprocal);
        undefined = absw(reciprocal);
        lanes mixed = negativew(determinant);
        negative += mixed + 2.0 * (1.0 - mixed) * negativew(a00);
        if (members > 2) {
            l02 = d0 * a02 + e01 * a12;
            l12 = d1 * a12 + e01 * a02;
            a22 = a22 - l02 * a02 - l12 * a12;
            most0 = absw(a02);
            most1 = absw(a12);
        }
        if (members > 3) {
            l03 = d0 * a03 + e01 * a13;
            l13 = d1 * a13 + e01 * a03;
            a23 = a23 - l02 * a03 - l12 * a13;
            a33 = a33 - l03 * a03 - l13 * a13;
            most0 = maxw(absw(a03), most0);
            most1 = maxw(absw(a13), most1);
        }
    } else {
        d0 = 1.0 / a00;
        negative += negativew(a00);
        if (members > 1) {
            l01 = d0 * a01;
            a11 = a11 - l01 * a01;
            most0 = absw(a01);
        }
        if (members > 2) {
            l02 = d0 * a02;
            a12 = a12 - l01 * a02;
            a22 = a22 - l02 * a02;
            most0 = maxw(absw(a02), most0);
        }
        if (members > 3) {
            l03 = d0 * a03;
            a13 = a13 - l01 * a03;
            a23 = a23 - l02 * a03;
            a33 = a33 - l03 * a03;
            most0 = maxw(absw(a03), most0);
        }
        if (members > 2 && kinds[1] == 2) {
            lanes determinant = a11 * a22 - a12 * a12;
            lanes reciprocal = 1.0 / determinant;
            d1 = a22 * reciprocal;
            d2 = a11 * reciprocal;
            e12 = -(a12 * reciprocal);
            undefined = absw(reciprocal);
            lanes mixed = negativew(determinant);
            negative += mixed + 2.0 * (1.0 - mixed) * negativew(a11);
            if (members > 3) {
                l13 = d1 * a13 + e12 * a23;
                l23 = d2 * a23 + e12 * a13;
                a33 = a33 - l13 * a13 - l23 * a23;
                most1 = absw(a13);
                most2 = absw(a23);
            }
        } else if (members > 1) {
            d1 = 1.0 / a11;
            negative += negativew(a11);
            if (members > 2) {
                l12 = d1 * a12;
                a22 = a22 - l12 * a12;
                most1 = absw(a12);
            }
            if (members > 3) {
                l13 = d1 * a13;
                a23 = a23 - l12 * a13;
                a33 = a33 - l13 * a13;
                most1 = maxw(absw(a13), most1);
            }
        }
    }
    if (members > 3 && kinds[2] == 2) {
        lanes determinant = a22 * a33 - a23 * a23;
        lanes reciprocal = 1.0 / determinant;
        d2 = a33 * reciprocal;
        d3 = a22 * reciprocal;
        e23 = -(a23 * reciprocal);
        undefined = maxw(absw(reciprocal), undefined);
        lanes mixed = negativew(determinant);
        negative += mixed + 2.0 * (1.0 - mixed) * negativew(a22);
    } else if (members > 2 && kinds[2] == 1) {
        d2 = 1.0 / a22;
        negative += negativew(a22);
        if (members > 3) {
            l23 = d2 * a23;
            a33 = a33 - l23 * a23;
            most2 = absw(a23);
        }
    }
    if (members > 3 && kinds[3] == 1) {
        d3 = 1.0 / a33;
        negative += negativew(a33);
    }
    storew(state, LANE_STATE_NEGATIVE + part, negative);
    storew(state, WORST + part, maxw(undefined * (NO_SHARE * suspect), loadw(state, WORST + part)));
    storew(known, part, d0);
    storew(known, LANE_CORNER_MOST + part, most0);
    storew(factors, part, d0);
    if (members > 1) {
        storew(known, 8 + part, d1);
        storew(known, CORNER + part, l01);
        storew(known, LANE_CORNER_BESIDE + part, e01);
        storew(known, LANE_CORNER_MOST + 8 + part, most1);
        storew(factors, 8 + part, l01 + e01);
        storew(factors, 8 * members + part, d1);
    }
    if (members > 2) {
        storew(known, 16 + part, d2);
        storew(known, CORNER + 8 + part, l02);
        storew(known, CORNER + 24 + part, l12);
        storew(known, LANE_CORNER_BESIDE + 8 + part, e12);
        storew(known, LANE_CORNER_MOST + 16 + part, most2);
        storew(factors, 16 + part, l02);
        storew(factors, 8 * members + 8 + part, l12 + e12);
        storew(factors, 16 * members - 8 + part, d2);
    }
    if (members > 3) {
        storew(known, 24 + part, d3);
        storew(known, CORNER + 16 + part, l03);
        storew(known, CORNER + 32 + part, l13);
        storew(known, CORNER + 40 + part, l23);
        storew(known, LANE_CORNER_BESIDE + 16 + part, e23);
        storew(known, LANE_CORNER_MOST + 24 + part, nothing);
        storew(factors, 24 + part, l03);
        storew(factors, 48 + part, l13);
        storew(factors, 64 + part, l23 + e23);
        storew(factors, 72 + part, d3);
    }
}

#endif
