"""Which factorisation suits a sparsity: stages in a row, segments side by side, or a tree of fronts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.levels import narrower_stages
from stc.solver.kkt.multifrontal import MultifrontalKKT
from stc.solver.kkt.planned import PlannedKKT
from stc.solver.kkt.segments import Numbered, Segmentation, find_segments, number_stages
from stc.solver.nlp import Ints

if TYPE_CHECKING:
    from stc.solver.kkt.batched import BatchedKKT

__all__ = ["new_system", "suits_chain"]

#: A chain is faster than segments where the middle one of all stages has so many unknowns.
WIDE = 60
#: For each unknown there should be so many entries off the diagonal, for each unknown of a stage: what is sparser takes
#: less time in lanes, which waste no operation on zeros. Transcriptions with midpoints have half as many.
DENSE = 0.1
#: A chain of sparse wide stages is faster than segments, too, where these leave more than so much of a horizon, as long
#: as its factors and scaled entries take no more bytes than that: so many for each unknown of a stage and each other
#: one of it, about.
SEGMENTED = 0.6
SHORT = 6 * 2**20
BYTES = 8.2


def suits_chain(couplings: Couplings, numbered: Numbered) -> bool:
    """Whether a chain takes less time than segments or fronts."""
    middle = np.median(np.diff(numbered.stages.pointers))
    dense = couplings.first.size >= DENSE * middle * couplings.size
    return bool(middle >= max(WIDE, numbered.stages.border.size) and dense)


def leaves_much(numbered: Numbered, found: Segmentation | None) -> bool:
    """Whether segments, or fronts where there are none, take longer than a chain of sparse stages."""
    width = np.diff(numbered.stages.pointers)
    taken = 0 if found is None else int(width[found.interior].sum())
    wide = np.median(width) >= max(WIDE, numbered.stages.border.size)
    size = BYTES * float(((width + numbered.stages.border.size) ** 2.0).sum())
    return bool(wide and taken < SEGMENTED * width.sum() and size <= SHORT)


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
    equations: NDArray[np.bool_],
) -> BatchedKKT | PlannedKKT | MultifrontalKKT:
    """The linear algebra for a sparsity that takes the least time; arguments as for ``StructuredKKT``."""
    pattern = n, m, jac_rows, jac_cols, hess_rows, hess_cols
    couplings = Couplings.of(*pattern)
    stage = np.concatenate([np.asarray(given).astype(np.int64) for given in (var_stage, row_stage)])
    numbered = number_stages(couplings, stage, held)
    narrower = narrower_stages(couplings, numbered) if numbered is not None else None
    if narrower is not None:
        stage, numbered = narrower, number_stages(couplings, narrower, held)
    if numbered is not None:
        # Each family is loaded where it is needed: hardly a process needs both.
        dense = suits_chain(couplings, numbered)
        found = None if dense else find_segments(numbered)
        if dense or leaves_much(numbered, found):
            from stc.solver.kkt.chain import ChainKKT, find_chain

            chain = find_chain(couplings, stage, numbered, held, equations, folded=dense)
            if chain is not None:
                return ChainKKT(couplings, stage, chain)
            if dense:
                found = find_segments(numbered)
        if found is not None:
            from stc.solver.kkt.batched import BatchedKKT

            return BatchedKKT(couplings, stage, found)
    return MultifrontalKKT(*pattern, var_stage, row_stage)
