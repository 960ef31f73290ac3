"""LDL^T of a sparse symmetric matrix in a window that slides over the stages, with threshold pivoting.

The method and its code are in ``stc/core/staged/elimination.c``.
"""

from __future__ import annotations

from stc.core.functions import function

__all__ = ["FACTORS_FULL", "HOPELESS", "WINDOW_FULL", "factorize"]

#: Results of ``factorize``.
FACTORS_FULL = 1
WINDOW_FULL = 2
HOPELESS = 3


#: Factorise; the window must be zero and is left so when the result is 0.
factorize = function("elimination_factorize")
