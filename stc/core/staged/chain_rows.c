/* Products with the matrix of a chain, as it is kept for them (see chain_elimination.h).
 *
 * For one vector or for two, which share the reading of the matrix. */
#include "../native.h"
#include "chain_elimination.h"
#include "chain_rows.h"

void chain_rows_subtract(int64_t stages, const int64_t *restrict table, const int32_t *restrict code,
                         int64_t stride, const double *restrict matrix, double *restrict work, int64_t size,
                         const double *restrict x, const double *restrict y, double *restrict z) {
    for (int64_t k = 0; k < size; k++) z[k] = y[k];
    for (int64_t s = 0; s < stages; s++) {
        const int64_t *stage = table + s * CHAIN_ELIMINATION_FIELDS;
        const int32_t *program = code + stage[CODE];
        const double *kept = matrix + stage[CHAIN_ELIMINATION_MATRIX];
        chain_elimination_gather_rows(stage, code, x, work);
        chain_rows_begin_products(program, kept, stride, work);
        chain_rows_subtract_rows(0, 0, program[ROWS], program, kept, 0, stride, work);
        chain_rows_end_products(stage, code, kept, stride, work, z);
    }
}
