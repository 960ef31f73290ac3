/* From the outputs of kernels to matrix entries, in compiled calls. */
#ifndef STC_GATHER_H
#define STC_GATHER_H

#include "native.h"

API void gather_begin(double *restrict status, int64_t *restrict counter);

API void gather_add_up(double *restrict part, double *restrict into);

API void gather_copy(int64_t count, const double *restrict values, double *restrict into);

API void gather_place(int64_t count, const double *restrict values, const double *restrict scale,
                      double *restrict into);

API int64_t gather_note(int64_t count, const double *restrict values, double *restrict noted,
                        int64_t *restrict same);

API int64_t gather_all_same(int64_t count, const int64_t *restrict same);

API void gather_fold(int64_t count, const int32_t *restrict source, const int32_t *restrict into,
                     double *restrict buffer);

API void gather_fold_long(int64_t sums, const int32_t *restrict into, const int32_t *restrict start,
                          const int32_t *restrict source, double *restrict buffer);

API void gather_copy_runs(int64_t runs, const int32_t *restrict source, const int32_t *restrict into,
                          const int32_t *restrict length, const double *restrict buffer, double *restrict out,
                          double *restrict status);

API void gather_scale_runs(int64_t runs, const int32_t *restrict source, const int32_t *restrict into,
                           const int32_t *restrict length, const int32_t *restrict first,
                           const double *restrict scale, const double *restrict buffer, double *restrict out,
                           double *restrict status);

API void gather_scatter(int64_t count, const int32_t *restrict source, const int32_t *restrict at,
                        const double *restrict scale, const double *restrict buffer, double *restrict out,
                        double *restrict status);

API void gather_total(int64_t count, const int32_t *restrict source, const double *restrict scale,
                      const double *restrict buffer, double *restrict out, double *restrict status);

#endif
