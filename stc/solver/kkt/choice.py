"""Which factorisation suits a sparsity: segments side by side, or a tree of fronts alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.multifrontal import MultifrontalKKT
from stc.solver.kkt.segments import find_segments, number_stages
from stc.solver.nlp import Ints

__all__ = ["new_system"]


def new_system(
    n: int,
    m: int,
    jac_rows: Ints,
    jac_cols: Ints,
    hess_rows: Ints,
    hess_cols: Ints,
    var_stage: Ints,
    row_stage: Ints,
    held: NDArray[np.bool_],
) -> MultifrontalKKT:
    """The linear algebra for a sparsity that takes the least time; arguments as for ``StructuredKKT``."""
    couplings = Couplings.of(n, m, jac_rows, jac_cols, hess_rows, hess_cols)
    stage = np.concatenate([np.asarray(given).astype(np.int64) for given in (var_stage, row_stage)])
    numbered = number_stages(couplings, stage, held)
    return MultifrontalKKT.of_couplings(
        couplings, stage, None if numbered is None else find_segments(numbered)
    )
