"""Small pivots under suspicion: is the matrix singular there?

The method and its code are in ``stc/core/staged/singularity.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = ["confirm_zeros"]


#: Count pivots as zero, and replace them, where the matrix is singular to working precision.
confirm_zeros = function("singularity_confirm_zeros")
