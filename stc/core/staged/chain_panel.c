/* Panels of one, two or four unknowns, taken out of the window of a stage (see chain_elimination.h).
 *
 * D has blocks of one and, for the first or last two members of a panel, of two unknowns.  A panel is a list of numbers:
 *
 *     members; 2 where the first two make one pivot; the same of the last two; row of the first member (the others are
 *     above); blocks; rows
 *     for each block: its column, and how many rows have it to the left of their diagonal or on it
 *     for each row, decreasing: where it begins in the window, and where its factor is, behind those of the corner
 *
 * Its factors are D^-1 and L of the corner, where its members meet, then D^-1 C, block by block, C being the members' rows
 * once they have been eliminated from each other. */
#include "../native.h"
#include "../vec8.h"
#include "chain_panel.h"
#include "lane_state.h"

/* Of a panel's factors, behind those of the corner: the first terms of the largest products. */
enum {
    FIRST_PRODUCTS = 12,
};

/* Note the entry beside the diagonal of an inverse, and what it adds, by the largest squares of two rows of C. */
ALWAYS_INLINE void note_pair(double e, double square, double other_square, double *restrict state) {
    state[CHAIN_PANEL_BESIDE] = nanmax(state[CHAIN_PANEL_BESIDE], fabs(e));
    state[MIXED] = nanmax(state[MIXED], 4.0 * e * e * square * other_square);
    state[CHAIN_PANEL_CHECK] += e;
}

void chain_panel_invert_four(const int32_t *restrict panel, int64_t stride, const double *restrict window,
                             double *restrict factors, double *restrict state) {
    int64_t high = panel[3];
    int64_t place = high * (stride + 1);
    double a00 = window[place];
    double a01 = window[place - 1];
    double a02 = window[place - 2];
    double a03 = window[place - 3];
    double a11 = window[place - stride - 1];
    double a12 = window[place - stride - 2];
    double a13 = window[place - stride - 3];
    double a22 = window[place - 2 * stride - 2];
    double a23 = window[place - 2 * stride - 3];
    double a33 = window[place - 3 * stride - 3];
    double negative = 0.0;
    double e01 = 0.0;
    double e23 = 0.0;
    double l01 = 0.0;
    double l23 = 0.0;
    double d0, d1, l02, l03, l12, l13;
    if (panel[1] == 2) {
        double determinant = a00 * a11 - a01 * a01;
        double reciprocal = 1.0 / determinant;
        d0 = a11 * reciprocal;
        d1 = a00 * reciprocal;
        e01 = -(a01 * reciprocal);
        l02 = d0 * a02 + e01 * a12;
        l03 = d0 * a03 + e01 * a13;
        l12 = d1 * a12 + e01 * a02;
        l13 = d1 * a13 + e01 * a03;
        negative += determinant < 0.0 ? 1.0 : a00 < 0.0 ? 2.0 : 0.0;
    } else {
        /* The second pivot is the quotient of two determinants, so that neither division waits for the other. */
        d0 = 1.0 / a00;
        d1 = a00 / (a00 * a11 - a01 * a01);
        l01 = d0 * a01;
        l02 = d0 * a02;
        l03 = d0 * a03;
        a12 -= l01 * a02;
        a13 -= l01 * a03;
        l12 = d1 * a12;
        l13 = d1 * a13;
        negative += (d0 < 0.0 ? 1.0 : 0.0) + (d1 < 0.0 ? 1.0 : 0.0);
    }
    a22 -= l02 * a02 + l12 * a12;
    a23 -= l02 * a03 + l12 * a13;
    a33 -= l03 * a03 + l13 * a13;
    double d2, d3;
    if (panel[2] == 2) {
        double determinant = a22 * a33 - a23 * a23;
        double reciprocal = 1.0 / determinant;
        d2 = a33 * reciprocal;
        d3 = a22 * reciprocal;
        e23 = -(a23 * reciprocal);
        negative += determinant < 0.0 ? 1.0 : a22 < 0.0 ? 2.0 : 0.0;
    } else {
        d2 = 1.0 / a22;
        d3 = a22 / (a22 * a33 - a23 * a23);
        l23 = d2 * a23;
        negative += (d2 < 0.0 ? 1.0 : 0.0) + (d3 < 0.0 ? 1.0 : 0.0);
    }
    factors[0] = d0;
    factors[1] = d1;
    factors[2] = d2;
    factors[3] = d3;
    factors[4] = e01;
    factors[5] = e23;
    factors[6] = l01;
    factors[7] = l02;
    factors[8] = l03;
    factors[9] = l12;
    factors[10] = l13;
    factors[11] = l23;
    factors[FIRST_PRODUCTS] = a01 * a01 + a02 * a02 + a03 * a03;
    factors[FIRST_PRODUCTS + 1] = a12 * a12 + a13 * a13;
    factors[FIRST_PRODUCTS + 2] = a23 * a23;
    state[CHAIN_PANEL_NEGATIVE] += negative;
}

void chain_panel_take_four(int64_t distance, const int32_t *restrict panel, int64_t stride,
                           const double *restrict masks, double *restrict window, double *restrict factors,
                           double *restrict state) {
    int64_t high = panel[3];
    double d0 = factors[0];
    double d1 = factors[1];
    double d2 = factors[2];
    double d3 = factors[3];
    double e01 = factors[4];
    double e23 = factors[5];
    double l01 = factors[6];
    double l02 = factors[7];
    double l03 = factors[8];
    double l12 = factors[9];
    double l13 = factors[10];
    double l23 = factors[11];
    int64_t blocks = panel[4];
    const int32_t *columns = panel + 6;
    const int32_t *rows = columns + 2 * blocks;
    vec8 m0 = splat8(factors[FIRST_PRODUCTS]);
    vec8 m1 = splat8(factors[FIRST_PRODUCTS + 1]);
    vec8 m2 = splat8(factors[FIRST_PRODUCTS + 2]);
    vec8 m3 = splat8(0.0);
    int64_t first = columns[0];
    int64_t at = high * stride;
    /* In the first block there may be columns of the panel itself. */
    vec8 mask = load8(masks, 8 * imin(imax(high - 3 - first, 0), 8));
    int64_t b = 0;
    if ((blocks & 1) == 1) {
        vec8 c0 = mul8(load8(window, at + first), mask);
        vec8 c1 = sub_scaled8(mul8(load8(window, at - stride + first), mask), l01, c0);
        vec8 c2 = sub_scaled8(sub_scaled8(mul8(load8(window, at - 2 * stride + first), mask), l02, c0), l12, c1);
        vec8 c3 = sub_scaled8(
            sub_scaled8(sub_scaled8(mul8(load8(window, at - 3 * stride + first), mask), l03, c0), l13, c1), l23,
            c2);
        lane_state_ask_ahead(distance, 4, 8, 16, factors);
        store8(factors, 16, add_scaled8(scaled8(d0, c0), e01, c1));
        store8(factors, 24, add_scaled8(scaled8(d1, c1), e01, c0));
        store8(factors, 32, add_scaled8(scaled8(d2, c2), e23, c3));
        store8(factors, 40, add_scaled8(scaled8(d3, c3), e23, c2));
        m0 = max8(mul8(c0, c0), m0);
        m1 = max8(mul8(c1, c1), m1);
        m2 = max8(mul8(c2, c2), m2);
        m3 = max8(mul8(c3, c3), m3);
        for (int64_t r = 0; r < columns[1]; r++) {
            int64_t to = rows[2 * r] + first;
            int64_t k = rows[2 * r + 1];
            vec8 value = sub_scaled8(sub_scaled8(load8(window, to), factors[k], c0), factors[k + 8], c1);
            store8(window, to, sub_scaled8(sub_scaled8(value, factors[k + 16], c2), factors[k + 24], c3));
        }
        b = 1;
        mask = splat8(1.0);
    }
    while (b < blocks) {
        /* Two blocks at a time: rows have the same factors for both. */
        int64_t column = columns[2 * b];
        int64_t other = columns[2 * b + 2];
        vec8 c0 = mul8(load8(window, at + column), mask);
        vec8 c1 = sub_scaled8(mul8(load8(window, at - stride + column), mask), l01, c0);
        vec8 c2 = sub_scaled8(sub_scaled8(mul8(load8(window, at - 2 * stride + column), mask), l02, c0), l12, c1);
        vec8 c3 = sub_scaled8(
            sub_scaled8(sub_scaled8(mul8(load8(window, at - 3 * stride + column), mask), l03, c0), l13, c1), l23,
            c2);
        vec8 o0 = load8(window, at + other);
        vec8 o1 = sub_scaled8(load8(window, at - stride + other), l01, o0);
        vec8 o2 = sub_scaled8(sub_scaled8(load8(window, at - 2 * stride + other), l02, o0), l12, o1);
        vec8 o3 = sub_scaled8(sub_scaled8(sub_scaled8(load8(window, at - 3 * stride + other), l03, o0), l13, o1),
                              l23, o2);
        int64_t own = 16 + 32 * b;
        lane_state_ask_ahead(distance, 8, 8, own, factors);
        store8(factors, own, add_scaled8(scaled8(d0, c0), e01, c1));
        store8(factors, own + 8, add_scaled8(scaled8(d1, c1), e01, c0));
        store8(factors, own + 16, add_scaled8(scaled8(d2, c2), e23, c3));
        store8(factors, own + 24, add_scaled8(scaled8(d3, c3), e23, c2));
        store8(factors, own + 32, add_scaled8(scaled8(d0, o0), e01, o1));
        store8(factors, own + 40, add_scaled8(scaled8(d1, o1), e01, o0));
        store8(factors, own + 48, add_scaled8(scaled8(d2, o2), e23, o3));
        store8(factors, own + 56, add_scaled8(scaled8(d3, o3), e23, o2));
        m0 = max8(mul8(o0, o0), max8(mul8(c0, c0), m0));
        m1 = max8(mul8(o1, o1), max8(mul8(c1, c1), m1));
        m2 = max8(mul8(o2, o2), max8(mul8(c2, c2), m2));
        m3 = max8(mul8(o3, o3), max8(mul8(c3, c3), m3));
        int64_t both = columns[2 * b + 1];
        for (int64_t r = 0; r < both; r++) {
            int64_t to = rows[2 * r];
            int64_t k = rows[2 * r + 1];
            double f0 = factors[k];
            double f1 = factors[k + 8];
            double f2 = factors[k + 16];
            double f3 = factors[k + 24];
            vec8 value = sub_scaled8(sub_scaled8(load8(window, to + column), f0, c0), f1, c1);
            vec8 beside = sub_scaled8(sub_scaled8(load8(window, to + other), f0, o0), f1, o1);
            store8(window, to + column, sub_scaled8(sub_scaled8(value, f2, c2), f3, c3));
            store8(window, to + other, sub_scaled8(sub_scaled8(beside, f2, o2), f3, o3));
        }
        for (int64_t r = both; r < columns[2 * b + 3]; r++) {
            int64_t to = rows[2 * r] + other;
            int64_t k = rows[2 * r + 1];
            vec8 value = sub_scaled8(sub_scaled8(load8(window, to), factors[k], o0), factors[k + 8], o1);
            store8(window, to, sub_scaled8(sub_scaled8(value, factors[k + 16], o2), factors[k + 24], o3));
        }
        b += 2;
        mask = splat8(1.0);
    }
    double s0 = fabs(d0);
    double s1 = fabs(d1);
    double s2 = fabs(d2);
    double s3 = fabs(d3);
    if (panel[1] == 2) note_pair(e01, largest8(m0), largest8(m1), state);
    if (panel[2] == 2) note_pair(e23, largest8(m2), largest8(m3), state);
    vec8 inverse = max8(max8(splat8(s0), splat8(s1)), max8(splat8(s2), splat8(s3)));
    store8(state, INVERSE, max8(inverse, load8(state, INVERSE)));
    vec8 product = max8(max8(scaled8(s0, m0), scaled8(s1, m1)), max8(scaled8(s2, m2), scaled8(s3, m3)));
    store8(state, PRODUCT, max8(product, load8(state, PRODUCT)));
    state[CHAIN_PANEL_CHECK] += s0 + s1 + s2 + s3;
}

void chain_panel_invert_two(const int32_t *restrict panel, int64_t stride, const double *restrict window,
                            double *restrict factors, double *restrict state) {
    int64_t high = panel[3];
    int64_t place = high * (stride + 1);
    double a00 = window[place];
    double a01 = window[place - 1];
    double a11 = window[place - stride - 1];
    double e01 = 0.0;
    double l01 = 0.0;
    double d0, d1, negative;
    if (panel[1] == 2) {
        double determinant = a00 * a11 - a01 * a01;
        double reciprocal = 1.0 / determinant;
        d0 = a11 * reciprocal;
        d1 = a00 * reciprocal;
        e01 = -(a01 * reciprocal);
        negative = determinant < 0.0 ? 1.0 : a00 < 0.0 ? 2.0 : 0.0;
    } else {
        d0 = 1.0 / a00;
        d1 = a00 / (a00 * a11 - a01 * a01);
        l01 = d0 * a01;
        negative = (d0 < 0.0 ? 1.0 : 0.0) + (d1 < 0.0 ? 1.0 : 0.0);
    }
    factors[0] = d0;
    factors[1] = d1;
    factors[2] = e01;
    factors[3] = l01;
    factors[4] = a01 * a01;
    state[CHAIN_PANEL_NEGATIVE] += negative;
}

void chain_panel_take_two(int64_t distance, const int32_t *restrict panel, int64_t stride,
                          const double *restrict masks, double *restrict window, double *restrict factors,
                          double *restrict state) {
    int64_t high = panel[3];
    double d0 = factors[0];
    double d1 = factors[1];
    double e01 = factors[2];
    double l01 = factors[3];
    int64_t blocks = panel[4];
    const int32_t *columns = panel + 6;
    const int32_t *rows = columns + 2 * blocks;
    vec8 m0 = splat8(factors[4]);
    vec8 m1 = splat8(0.0);
    for (int64_t b = 0; b < blocks; b++) {
        int64_t column = columns[2 * b];
        int64_t at = high * stride + column;
        vec8 mask = load8(masks, 8 * imin(imax(high - 1 - column, 0), 8));
        vec8 c0 = mul8(load8(window, at), mask);
        vec8 c1 = sub_scaled8(mul8(load8(window, at - stride), mask), l01, c0);
        int64_t own = 8 + 16 * b;
        lane_state_ask_ahead(distance, 2, 8, own, factors);
        store8(factors, own, add_scaled8(scaled8(d0, c0), e01, c1));
        store8(factors, own + 8, add_scaled8(scaled8(d1, c1), e01, c0));
        m0 = max8(mul8(c0, c0), m0);
        m1 = max8(mul8(c1, c1), m1);
        for (int64_t r = 0; r < columns[2 * b + 1]; r++) {
            int64_t to = rows[2 * r] + column;
            int64_t k = rows[2 * r + 1];
            store8(window, to, sub_scaled8(sub_scaled8(load8(window, to), factors[k], c0), factors[k + 8], c1));
        }
    }
    double s0 = fabs(d0);
    double s1 = fabs(d1);
    if (panel[1] == 2) note_pair(e01, largest8(m0), largest8(m1), state);
    store8(state, INVERSE, max8(max8(splat8(s0), splat8(s1)), load8(state, INVERSE)));
    store8(state, PRODUCT, max8(max8(scaled8(s0, m0), scaled8(s1, m1)), load8(state, PRODUCT)));
    state[CHAIN_PANEL_CHECK] += s0 + s1;
}

void chain_panel_take_one(int64_t distance, const int32_t *restrict panel, int64_t stride,
                          const double *restrict masks, double *restrict window, double *restrict factors,
                          double *restrict state) {
    int64_t high = panel[3];
    double d0 = factors[0];
    int64_t blocks = panel[4];
    const int32_t *columns = panel + 6;
    const int32_t *rows = columns + 2 * blocks;
    vec8 most = splat8(0.0);
    for (int64_t b = 0; b < blocks; b++) {
        int64_t column = columns[2 * b];
        vec8 c0 = mul8(load8(window, high * stride + column), load8(masks, 8 * imin(imax(high - column, 0), 8)));
        vec8 f0 = scaled8(d0, c0);
        lane_state_ask_ahead(distance, 1, 0, 8 + 8 * b, factors);
        store8(factors, 8 + 8 * b, f0);
        most = max8(mul8(c0, c0), most);
        for (int64_t r = 0; r < columns[2 * b + 1]; r++) {
            int64_t to = rows[2 * r] + column;
            store8(window, to, sub_scaled8(load8(window, to), factors[rows[2 * r + 1]], c0));
        }
    }
    store8(state, INVERSE, max8(splat8(fabs(d0)), load8(state, INVERSE)));
    store8(state, PRODUCT, max8(scaled8(fabs(d0), most), load8(state, PRODUCT)));
    state[CHAIN_PANEL_NEGATIVE] += d0 < 0.0 ? 1.0 : 0.0;
    state[CHAIN_PANEL_CHECK] += fabs(d0);
}
