/* What every factorisation of the KKT system offers.
 *
 *     K = [ H + diag(p)    J^T     ]     n variables
 *         [ J             -diag(d) ]     m rows
 *
 * The sparsity of H (lower triangle) and J is given once, the values again at every factorisation. */
#ifndef STC_CONTRACT_H
#define STC_CONTRACT_H

#include "../native.h"

#define COARSE 1e-10

#endif
