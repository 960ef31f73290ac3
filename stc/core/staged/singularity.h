/* Small pivots under suspicion: is the matrix singular there? */
#ifndef STC_SINGULARITY_H
#define STC_SINGULARITY_H

#include "../native.h"

/* Count pivots as zero, and replace them, where the matrix is singular to working precision.
 *
 * Not those that are certain[0] times as large as the noise in them. The other arguments are those of
 * factorize in elimination.h and what it left; zeros (N,) is zero, z and image (N,) are
 * work space. */
API void singularity_confirm_zeros(int64_t size, int64_t variables, double replacement,
                                   const double *restrict certain, const int32_t *restrict order,
                                   const int32_t *restrict pointers, const int32_t *restrict columns,
                                   const double *restrict values, const int32_t *restrict pivots,
                                   const int32_t *restrict starts, const int32_t *restrict indices,
                                   const double *restrict factors, double *restrict inverse,
                                   const double *restrict zeros, double *restrict z, double *restrict image,
                                   int64_t *restrict counts);

#endif
