"""Small pivots under suspicion: is the matrix singular there?

Rounding errors pass from pivot to pivot, so what is zero in exact arithmetic may be left as a number far above the
rounding unit.  The vector z with L^T z = e_k has

    K z = L D e_k        z^T K z = d_k

so a small pivot with a long z belongs to a tiny eigenvalue: d_k / |z|^2 estimates it, and |K z| / |z|, formed with K
itself and not with what elimination left of it, bounds it.

A matrix may be singular to working precision, and its small pivots right in their leading digits all the same: what
elimination leaves is exact for entries that are off by some rounding units of |L| |D| |L|^T (N. J. Higham, Accuracy and
Stability of Numerical Algorithms, 2002, section 11.1), which moves d_k by as many units of |z|^T |L| |D| |L|^T |z|.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = ["confirm_zeros"]


#: Count pivots as zero, and replace them, where the matrix is singular to working precision.
confirm_zeros = function("singularity_confirm_zeros")
