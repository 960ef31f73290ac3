/* One panel of pivots taken out of eight segments at once (see lanes.h).
 *
 *     C   members x (members + rows), what is left of their columns
 *     L   D^-1 C, the factors, which are kept             work[rows, rows] -= C^T L
 *
 * The triangle's entry (i, j), i >= j, of all eight lanes is at work[8 (i (i + 1) / 2 + j)].  All that is kept of a
 * panel are the corner, members x members of L, and then the rest of L, the factors of one row after those of another.  Of
 * the corner there is the upper triangle, row by row: D^-1 on the diagonal, and beside it the other entry of D^-1 where a
 * pivot has two unknowns, which have no factor there.
 *
 * The corner comes first (lane_corner).  The rest of C is made in registers, of two rows at a time, and so are their
 * factors; both rows are updated at once, each up to its diagonal, while their C is there.  So nothing but the triangle
 * and the factors goes through memory.  Where a register holds four numbers, four lanes take their turn with two rows,
 * then the other four: the vectors of eight would not fit. */
#include "../native.h"
#include "../vec8.h"
#include "lane_corner.h"
#include "lane_panel.h"
#include "lane_state.h"

int64_t lane_panel_panel_vectors(int64_t members, int64_t count) {
    return ((members * (members + 1)) >> 1) + members * count;
}

/* Make the factors of rows i and i + 1, and take the members out of these up to their diagonal.
 *
 * part: lane at which to begin, of as many as a register holds.
 * members: one to four; a constant, as are the next two.
 * singles, pairs: 1 where all pivots have one unknown, or two.
 * length: of C's rows.
 * known: what take_corner has left, where the largest entries of C are raised.
 * factors: those of the panel, without the corner. */
ALWAYS_INLINE void take_two_rows(int64_t part, int64_t members, int64_t singles, int64_t pairs, int64_t i,
                                 int64_t length, const int32_t *restrict rows, const int32_t *restrict sources,
                                 double *restrict work, double *restrict known, double *restrict factors) {
    int64_t own = members + i;
    int64_t at = 8 * members * i + part;
    lanes a0 = loadw(work, 8 * (int64_t)sources[own] + part);
    lanes b0 = loadw(work, 8 * (int64_t)sources[own + 1] + part);
    storew(known, LANE_CORNER_MOST + part, maxw(absw(b0), maxw(absw(a0), loadw(known, LANE_CORNER_MOST + part))));
    lanes d = loadw(known, part);
    lanes f0 = d * a0;
    lanes g0 = d * b0;
    lanes a1 = a0;
    lanes a2 = a0;
    lanes a3 = a0;
    lanes b1 = b0;
    lanes b2 = b0;
    lanes b3 = b0;
    lanes f1 = f0;
    lanes f2 = f0;
    lanes f3 = f0;
    lanes g1 = g0;
    lanes g2 = g0;
    lanes g3 = g0;
    if (members > 1) {
        a1 = loadw(work, 8 * (int64_t)sources[length + own] + part);
        b1 = loadw(work, 8 * (int64_t)sources[length + own + 1] + part);
        if (pairs == 0) {
            lanes factor = loadw(known, CORNER + part);
            a1 = a1 - factor * a0;
            b1 = b1 - factor * b0;
        }
        storew(known, LANE_CORNER_MOST + 8 + part,
               maxw(absw(b1), maxw(absw(a1), loadw(known, LANE_CORNER_MOST + 8 + part))));
        d = loadw(known, 8 + part);
        f1 = d * a1;
        g1 = d * b1;
        if (singles == 0) {
            lanes beside = loadw(known, LANE_CORNER_BESIDE + part);
            f0 = f0 + beside * a1;
            g0 = g0 + beside * b1;
            f1 = f1 + beside * a0;
            g1 = g1 + beside * b0;
        }
    }
    if (members > 2) {
        lanes factor = loadw(known, CORNER + 8 + part);
        a2 = loadw(work, 8 * (int64_t)sources[2 * length + own] + part) - factor * a0;
        b2 = loadw(work, 8 * (int64_t)sources[2 * length + own + 1] + part) - factor * b0;
        factor = loadw(known, CORNER + 24 + part);
        a2 = a2 - factor * a1;
        b2 = b2 - factor * b1;
        storew(known, LANE_CORNER_MOST + 16 + part,
               maxw(absw(b2), maxw(absw(a2), loadw(known, LANE_CORNER_MOST + 16 + part))));
        d = loadw(known, 16 + part);
        f2 = d * a2;
        g2 = d * b2;
        if (singles == 0 && pairs == 0) {
            lanes beside = loadw(known, LANE_CORNER_BESIDE + 8 + part);
            f1 = f1 + beside * a2;
            g1 = g1 + beside * b2;
            f2 = f2 + beside * a1;
            g2 = g2 + beside * b1;
        }
    }
    if (members > 3) {
        lanes factor = loadw(known, CORNER + 16 + part);
        a3 = loadw(work, 8 * (int64_t)sources[3 * length + own] + part) - factor * a0;
        b3 = loadw(work, 8 * (int64_t)sources[3 * length + own + 1] + part) - factor * b0;
        factor = loadw(known, CORNER + 32 + part);
        a3 = a3 - factor * a1;
        b3 = b3 - factor * b1;
        if (pairs == 0) {
            factor = loadw(known, CORNER + 40 + part);
            a3 = a3 - factor * a2;
            b3 = b3 - factor * b2;
        }
        storew(known, LANE_CORNER_MOST + 24 + part,
               maxw(absw(b3), maxw(absw(a3), loadw(known, LANE_CORNER_MOST + 24 + part))));
        d = loadw(known, 24 + part);
        f3 = d * a3;
        g3 = d * b3;
        if (singles == 0) {
            lanes beside = loadw(known, LANE_CORNER_BESIDE + 16 + part);
            f2 = f2 + beside * a3;
            g2 = g2 + beside * b3;
            f3 = f3 + beside * a2;
            g3 = g3 + beside * b2;
        }
    }
    storew(factors, at, f0);
    storew(factors, at + 8 * members, g0);
    if (members > 1) {
        storew(factors, at + 8, f1);
        storew(factors, at + 8 * members + 8, g1);
    }
    if (members > 2) {
        storew(factors, at + 16, f2);
        storew(factors, at + 8 * members + 16, g2);
    }
    if (members > 3) {
        storew(factors, at + 24, f3);
        storew(factors, at + 8 * members + 24, g3);
    }
    int64_t row = rows[i];
    int64_t base = 4 * row * (row + 1) + part;
    int64_t below = rows[i + 1];
    int64_t base_below = 4 * below * (below + 1) + part;
    lanes one = loadw(work, base + 8 * row) - a0 * f0;
    lanes two = loadw(work, base_below + 8 * row) - b0 * f0;
    lanes last = loadw(work, base_below + 8 * below) - b0 * g0;
    if (members > 1) {
        one = one - a1 * f1;
        two = two - b1 * f1;
        last = last - b1 * g1;
    }
    if (members > 2) {
        one = one - a2 * f2;
        two = two - b2 * f2;
        last = last - b2 * g2;
    }
    if (members > 3) {
        one = one - a3 * f3;
        two = two - b3 * f3;
        last = last - b3 * g3;
    }
    storew(work, base + 8 * row, one);
    storew(work, base_below + 8 * row, two);
    storew(work, base_below + 8 * below, last);
    for (int64_t j = 0; j < i; j++) {
        int64_t other = 8 * (int64_t)rows[j];
        int64_t k = 8 * members * j + part;
        lanes f = loadw(factors, k);
        one = loadw(work, base + other) - a0 * f;
        two = loadw(work, base_below + other) - b0 * f;
        if (members > 1) {
            f = loadw(factors, k + 8);
            one = one - a1 * f;
            two = two - b1 * f;
        }
        if (members > 2) {
            f = loadw(factors, k + 16);
            one = one - a2 * f;
            two = two - b2 * f;
        }
        if (members > 3) {
            f = loadw(factors, k + 24);
            one = one - a3 * f;
            two = two - b3 * f;
        }
        storew(work, base + other, one);
        storew(work, base_below + other, two);
    }
}

/* The same for row i alone. */
ALWAYS_INLINE void take_row(int64_t part, int64_t members, int64_t singles, int64_t pairs, int64_t i,
                            int64_t length, const int32_t *restrict rows, const int32_t *restrict sources,
                            double *restrict work, double *restrict known, double *restrict factors) {
    int64_t own = members + i;
    int64_t at = 8 * members * i + part;
    lanes a0 = loadw(work, 8 * (int64_t)sources[own] + part);
    storew(known, LANE_CORNER_MOST + part, maxw(absw(a0), loadw(known, LANE_CORNER_MOST + part)));
    lanes f0 = loadw(known, part) * a0;
    lanes a1 = a0;
    lanes a2 = a0;
    lanes a3 = a0;
    lanes f1 = f0;
    lanes f2 = f0;
    lanes f3 = f0;
    if (members > 1) {
        a1 = loadw(work, 8 * (int64_t)sources[length + own] + part);
        if (pairs == 0) a1 = a1 - loadw(known, CORNER + part) * a0;
        storew(known, LANE_CORNER_MOST + 8 + part, maxw(absw(a1), loadw(known, LANE_CORNER_MOST + 8 + part)));
        f1 = loadw(known, 8 + part) * a1;
        if (singles == 0) {
            lanes beside = loadw(known, LANE_CORNER_BESIDE + part);
            f0 = f0 + beside * a1;
            f1 = f1 + beside * a0;
        }
    }
    if (members > 2) {
        a2 = loadw(work, 8 * (int64_t)sources[2 * length + own] + part);
        a2 = a2 - loadw(known, CORNER + 8 + part) * a0 - loadw(known, CORNER + 24 + part) * a1;
        storew(known, LANE_CORNER_MOST + 16 + part, maxw(absw(a2), loadw(known, LANE_CORNER_MOST + 16 + part)));
        f2 = loadw(known, 16 + part) * a2;
        if (singles == 0 && pairs == 0) {
            lanes beside = loadw(known, LANE_CORNER_BESIDE + 8 + part);
            f1 = f1 + beside * a2;
            f2 = f2 + beside * a1;
        }
    }
    if (members > 3) {
        a3 = loadw(work, 8 * (int64_t)sources[3 * length + own] + part);
        a3 = a3 - loadw(known, CORNER + 16 + part) * a0 - loadw(known, CORNER + 32 + part) * a1;
        if (pairs == 0) a3 = a3 - loadw(known, CORNER + 40 + part) * a2;
        storew(known, LANE_CORNER_MOST + 24 + part, maxw(absw(a3), loadw(known, LANE_CORNER_MOST + 24 + part)));
        f3 = loadw(known, 24 + part) * a3;
        if (singles == 0) {
            lanes beside = loadw(known, LANE_CORNER_BESIDE + 16 + part);
            f2 = f2 + beside * a3;
            f3 = f3 + beside * a2;
        }
    }
    int64_t row = rows[i];
    int64_t base = 4 * row * (row + 1) + part;
    lanes one = loadw(work, base + 8 * row) - a0 * f0;
    storew(factors, at, f0);
    if (members > 1) {
        one = one - a1 * f1;
        storew(factors, at + 8, f1);
    }
    if (members > 2) {
        one = one - a2 * f2;
        storew(factors, at + 16, f2);
    }
    if (members > 3) {
        one = one - a3 * f3;
        storew(factors, at + 24, f3);
    }
    storew(work, base + 8 * row, one);
    for (int64_t j = 0; j < i; j++) {
        int64_t other = 8 * (int64_t)rows[j];
        int64_t k = 8 * members * j + part;
        one = loadw(work, base + other) - a0 * loadw(factors, k);
        if (members > 1) one = one - a1 * loadw(factors, k + 8);
        if (members > 2) one = one - a2 * loadw(factors, k + 16);
        if (members > 3) one = one - a3 * loadw(factors, k + 24);
        storew(work, base + other, one);
    }
}

/* Test the pivots: what D^-1 makes of the largest of C is no less than the largest factor. */
ALWAYS_INLINE void note_growth(int64_t members, double growth, double suspect, const double *restrict known,
                               double *restrict state) {
    vec8 worst = load8(state, WORST);
    for (int64_t p = 0; p < members; p++) {
        vec8 most = load8(known, LANE_CORNER_MOST + 8 * p);
        vec8 size = abs8(load8(known, 8 * p));
        vec8 high = mul8(size, most);
        if (p > 0) {
            high = add_product8(high, abs8(load8(known, LANE_CORNER_BESIDE + 8 * p - 8)),
                                load8(known, LANE_CORNER_MOST + 8 * p - 8));
        }
        if (p + 1 < members) {
            vec8 beside = abs8(load8(known, LANE_CORNER_BESIDE + 8 * p));
            high = add_product8(high, beside, load8(known, LANE_CORNER_MOST + 8 * p + 8));
            size = max8(beside, size);
        }
        worst = max8(scaled8(suspect, size), worst);
        worst = max8(scaled8(growth, mul8(most, high)), worst);
    }
    store8(state, WORST, worst);
}

/* Make the factors of all rows and take the members out of them.
 *
 * Meanwhile the memory of later factors, distance ahead, is asked for: to wait for it then takes longer. */
ALWAYS_INLINE void take_rows(int64_t members, int64_t singles, int64_t pairs, int64_t distance, int64_t streamed,
                             int64_t count, const int32_t *restrict rows, const int32_t *restrict sources,
                             double *restrict work, double *restrict known, double *restrict factors,
                             double *restrict target) {
    int64_t length = members + count;
    int64_t i = 0;
    while (i < count) {
        int64_t at = 8 * members * i;
        int64_t taken = i + 1 < count ? 2 : 1;
        if (streamed == 0) lane_state_ask_ahead(distance, taken * members, 8, at, factors);
        int64_t part = 0;
        while (part < 8) {
            if (taken == 2)
                take_two_rows(part, members, singles, pairs, i, length, rows, sources, work, known, factors);
            else
                take_row(part, members, singles, pairs, i, length, rows, sources, work, known, factors);
            part += LANES;
        }
        if (streamed != 0) lane_state_put_vectors(1, taken * members, factors + at, at, target);
        i += taken;
    }
}

/* The same as take_panel, for a constant number of members, and for constant singles and pairs. */
ALWAYS_INLINE void take(int64_t members, int64_t singles, int64_t pairs, int64_t distance, int64_t streamed,
                        int64_t count, const int32_t *restrict kinds, const int32_t *restrict rows,
                        const int32_t *restrict sources, double growth, double suspect, double *restrict work,
                        double *restrict known, double *restrict factors, double *restrict target,
                        double *restrict state) {
    int64_t corner_vectors = lane_panel_panel_vectors(members, 0);
    int64_t part = 0;
    while (part < 8) {
        lane_corner_take_corner(part, members, members + count, kinds, sources, suspect, work, known, factors,
                                state);
        part += LANES;
    }
    double *rest = factors + 8 * corner_vectors;
    take_rows(members, singles, pairs, distance, streamed, count, rows, sources, work, known, rest,
              target + 8 * corner_vectors);
    note_growth(members, growth, suspect, known, state);
    if (streamed != 0) lane_state_put_vectors(1, corner_vectors, factors, 0, target);
}

void lane_panel_take_panel(int64_t distance, int64_t streamed, int64_t members, int64_t count,
                           const int32_t *restrict kinds, const int32_t *restrict rows,
                           const int32_t *restrict sources, double growth, double suspect, double *restrict work,
                           double *restrict known, double *restrict factors, double *restrict target,
                           double *restrict state) {
    int64_t singles = 1;
    for (int64_t k = 0; k < members; k++)
        if (kinds[k] == 2) singles = 0;
    if (members == 4) {
        if (singles != 0) {
            take(4, 1, 0, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
                 target, state);
        } else if (kinds[0] == 2 && kinds[2] == 2) {
            take(4, 0, 1, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
                 target, state);
        } else {
            take(4, 0, 0, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
                 target, state);
        }
    } else if (members == 3) {
        if (singles != 0) {
            take(3, 1, 0, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
                 target, state);
        } else {
            take(3, 0, 0, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
                 target, state);
        }
    } else if (members == 2) {
        if (singles != 0) {
            take(2, 1, 0, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
                 target, state);
        } else {
            take(2, 0, 1, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
                 target, state);
        }
    } else {
        take(1, 1, 0, distance, streamed, count, kinds, rows, sources, growth, suspect, work, known, factors,
             target, state);
    }
}
