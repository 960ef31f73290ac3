"""Products with the matrix of a chain, as it is kept for them (see stc.solver.kkt.chain_elimination).

The method and its code are in ``stc/core/staged/chain_rows.c``.
"""

from __future__ import annotations

__all__ = ["HELD", "VECTORS"]

#: Vectors of a stage in the work space, for each of two: the part of x that belongs to its rows; what is held back
#: meanwhile; the part once it is scaled; sums of products with the matrix, by columns and by rows, of which there are
#: eight for each row first.
HELD, VECTORS = 1, 13
