/* Forward and back substitution through the stages of a chain (see chain_elimination.h).
 *
 * For one vector or for two, which share the reading of the factors.  Panels are of one, two or four pivots. */
#include "../native.h"
#include "chain_substitution.h"

void chain_substitution_backward_both(int64_t checked, int64_t distance, int64_t stages,
                                      const int64_t *restrict table, const int32_t *restrict code, int64_t stride,
                                      const double *restrict units, const double *restrict factors,
                                      const double *restrict matrix, double *restrict work, double *restrict x,
                                      double *restrict other_x, double *restrict z, double *restrict other_z) {
    chain_substitution_backward(1, checked, distance, stages, table, code, stride, units, factors, matrix, work, x,
                                other_x, z, other_z);
}
