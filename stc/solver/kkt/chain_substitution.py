"""Forward and back substitution through the stages of a chain (see stc.solver.kkt.chain_elimination).

The method and its code are in ``stc/core/staged/chain_substitution.c``.
"""

from __future__ import annotations

__all__ = ["ONE", "UNITS"]

#: Blocks with a single 1 are cut out of a row of UNITS numbers that has it here.
ONE, UNITS = 11, 24
