/* Panels of one, two or four unknowns, taken out of the window of a stage (see chain_elimination.h). */
#ifndef STC_CHAIN_PANEL_H
#define STC_CHAIN_PANEL_H

#include "../native.h"
#include "../vec8.h"
#include "lane_state.h"

/* Places in state: the largest entries on the diagonal of D^-1 so far, in groups of eight; the largest products due
 * to these, the same; a sum that is finite if all pivots are; negative pivots; the largest entry of D^-1 beside the
 * diagonal; the square of the largest product due to one. Others are as in lane_state. */
enum {
    INVERSE = 0,
    PRODUCT = 8,
    CHAIN_PANEL_CHECK = 19,
    CHAIN_PANEL_NEGATIVE = 20,
    CHAIN_PANEL_BESIDE = 21,
    MIXED = 22,
};

/* L and D^-1 of the corner where four unknowns meet. */
void chain_panel_invert_four(const int32_t *restrict panel, int64_t stride, const double *restrict window,
                             double *restrict factors, double *restrict state);

/* Take four unknowns out of the window, whose corner is done. */
void chain_panel_take_four(int64_t distance, const int32_t *restrict panel, int64_t stride,
                           const double *restrict masks, double *restrict window, double *restrict factors,
                           double *restrict state);

/* The same as _invert_four for two. */
void chain_panel_invert_two(const int32_t *restrict panel, int64_t stride, const double *restrict window,
                            double *restrict factors, double *restrict state);

/* The same as _take_four for two. */
void chain_panel_take_two(int64_t distance, const int32_t *restrict panel, int64_t stride,
                          const double *restrict masks, double *restrict window, double *restrict factors,
                          double *restrict state);

/* The same for one. */
void chain_panel_take_one(int64_t distance, const int32_t *restrict panel, int64_t stride,
                          const double *restrict masks, double *restrict window, double *restrict factors,
                          double *restrict state);

/* Forget what pivots have been so far. */
ALWAYS_INLINE void chain_panel_begin_tests(double *restrict state) {
    for (int64_t k = 0; k < LANE_STATE_LARGEST; k++) state[k] = 0.0;
    state[CHAIN_PANEL_CHECK] = 0.0;
    state[CHAIN_PANEL_NEGATIVE] = 0.0;
    state[CHAIN_PANEL_BESIDE] = 0.0;
    state[MIXED] = 0.0;
}

/* What the test of all pivots so far is; nan where one of them is not finite. */
ALWAYS_INLINE double chain_panel_worst_test(double growth, double suspect, const double *restrict state) {
    double product = largest8(load8(state, PRODUCT)) + sqrt(state[MIXED]);
    double worst =
        nanmax(growth * product, suspect * nanmax(largest8(load8(state, INVERSE)), state[CHAIN_PANEL_BESIDE]));
    return worst + 0.0 * state[CHAIN_PANEL_CHECK];
}

/* L and D^-1 of the corner of a panel. */
ALWAYS_INLINE void chain_panel_invert_corner(const int32_t *restrict panel, int64_t stride,
                                             const double *restrict window, double *restrict factors,
                                             double *restrict state) {
    if (panel[0] == 4)
        chain_panel_invert_four(panel, stride, window, factors, state);
    else if (panel[0] == 2)
        chain_panel_invert_two(panel, stride, window, factors, state);
    else
        factors[0] = 1.0 / window[panel[3] * (stride + 1)];
}

/* Take a panel out of the window, whose corner is done.
 *
 * distance: how far ahead memory is asked for, 0 where it is near.
 * masks: k ones and 8 - k zeros, for k from 0 to 8.
 * factors: those of the panel; state: see above. */
ALWAYS_INLINE void chain_panel_take_panel(int64_t distance, const int32_t *restrict panel, int64_t stride,
                                          const double *restrict masks, double *restrict window,
                                          double *restrict factors, double *restrict state) {
    if (panel[0] == 4)
        chain_panel_take_four(distance, panel, stride, masks, window, factors, state);
    else if (panel[0] == 2)
        chain_panel_take_two(distance, panel, stride, masks, window, factors, state);
    else
        chain_panel_take_one(distance, panel, stride, masks, window, factors, state);
}

#endif
