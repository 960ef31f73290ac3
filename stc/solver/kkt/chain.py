"""The KKT system of wide stages, one after the other: all pivots fixed before, no rest.

Segments in vector lanes (see stc.solver.kkt.segmented) couple with both of their ends, which takes two to three times
as many operations as a chain does.  In small stages that costs nothing, since lanes take as long for eight numbers as
for one; in wide ones the vectors can be filled by rows of a stage instead.  What is irregular is part of the chain.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from stc.arrays import aligned_zeros
from stc.codegen.calls import Bound
from stc.solver.kkt import attempts, chain_elimination, pivots, plan_calls
from stc.solver.kkt.arrangement import Couplings
from stc.solver.kkt.chain_elimination import eliminate
from stc.solver.kkt.chain_plan import WAYS, Chain, ChainProgram, lay_out_chain, plan_chain
from stc.solver.kkt.chain_rows import VECTORS
from stc.solver.kkt.chain_solve import ONE, UNITS, solve
from stc.solver.kkt.contract import Inertia
from stc.solver.kkt.entries import Arrays
from stc.solver.kkt.frontal import SWEEPS
from stc.solver.kkt.lane_program import effort_of
from stc.solver.kkt.plan_choice import Plans, Prepared
from stc.solver.kkt.planned import GROWTH, INVERSE, ROOM, PlannedKKT, new_state, reading_distance
from stc.solver.kkt.segmented_passes import equilibrate_all
from stc.solver.kkt.segments import Numbered
from stc.solver.nlp import Floats

__all__ = ["ChainKKT", "find_chain"]

#: Kinds of stages at most: each is planned for.
KINDS = 64


def find_chain(couplings: Couplings, numbered: Numbered) -> Chain | None:
    """Lay out a chain, or None where it would have too many kinds of stages."""
    chain = lay_out_chain(numbered, couplings.n, couplings.first, couplings.second)
    return chain if len(chain.kinds) <= KINDS else None


class _Nothing:
    """The rest where there is none: see ``planned.Rest``."""

    bindings = 0
    follows_plan = True
    nnz_factor = nbytes = operations = factor_bytes = 0

    def __init__(self) -> None:
        self.counts = np.zeros(pivots.COUNTS, dtype=np.int64)
        self.account = np.zeros(attempts.ACCOUNT)
        self.account[1] = np.inf  # its plan never has to be made anew

    def steps(self) -> list[tuple[Bound, bool]]:
        return []

    def prepare_steps(self) -> None: ...

    def follow(self) -> None: ...

    def restart(self) -> None: ...

    def refactor(self) -> Inertia:
        return Inertia(0, 0, 0)

    def complete(self, ended: int) -> Inertia:
        return self.refactor()


class ChainKKT(PlannedKKT):
    """Sparse LDL^T of stages in a row (see stc.solver.kkt.chain_elimination).

    See ``AttachedKKT`` for the members.
    """

    def __init__(self, couplings: Couplings, stage: NDArray[np.int64], chain: Chain) -> None:
        arrays = Arrays.of(couplings, numbers=(0.0,))
        super().__init__(couplings, stage, arrays, _Nothing(), 0)
        self._chain = chain
        size = couplings.size
        widest = max(kind.own + kind.outer for kind in chain.kinds)
        # An odd number of blocks, with one to spare, so that columns do not fall on the same lines of a cache.
        self._stride = chain_elimination.BLOCK * ((widest + 7) // 8 + 1 | 1)
        self._vectors = [aligned_zeros(size + chain_elimination.BLOCK) for _ in range(8)]
        self._scale, self._most = np.ones(size), np.zeros(size)
        self._place = np.empty(size, dtype=np.int32)
        self._place[chain.order] = np.arange(size)
        self._index = chain.order.astype(np.int32)
        sources = couplings.hess_off, couplings.hess_count + np.arange(couplings.jac_count)
        self._source = np.concatenate(sources).astype(np.int32)
        self._sources = self._source[chain.edges]
        stride = self._stride
        rows = (chain_elimination.BLOCK + 2) * stride
        self._work = aligned_zeros(2 * VECTORS * stride)
        self._spaces = tuple(aligned_zeros(room) for room in (stride * stride, rows, 2 * stride * stride))
        self._matrix = aligned_zeros(0)
        self._masks = np.concatenate([np.repeat([1.0, 0.0], [k, 8 - k]) for k in range(9)])
        self._units = np.zeros(UNITS)
        self._units[ONE] = 1.0
        self._equilibrate = equilibrate_all.bind(
            SWEEPS, 0, 0, np.zeros(1, dtype=np.int64), self._index, np.zeros(1, dtype=np.int32), 0, size,
            chain.edges.size, self._place[couplings.first[chain.edges]], self._place[couplings.second[chain.edges]],
            self._sources, arrays.given, self._diagonal, self._scale, self._most, np.zeros(1), np.zeros(1),
        )  # fmt: skip
        nothing = np.zeros(0)
        first = Prepared(0, (), nothing, nothing, (nothing, nothing), self._equilibrate, 0, 0, False)
        self._plans = Plans(size, first)

    @property
    def nbytes(self) -> int:
        """Memory held, about."""
        own = 8 * self._arrays.given.size + 64 * self._diagonal.size + 12 * self._sources.nbytes
        own += self._factors.nbytes + self._matrix.nbytes + sum(space.nbytes for space in self._spaces)
        return own + (self._whole.nbytes if self._whole is not None else 0)

    def _programs(self, thorough: bool) -> tuple[list[ChainProgram], NDArray[np.int64]]:
        """See ``PlannedKKT``; which program each stage has, too."""
        scale, couplings = self._scale[self._place], self._couplings
        values = self._arrays.given[self._source] * scale[couplings.first] * scale[couplings.second]
        diagonal = self._own_diagonal() * scale**2
        return plan_chain(self._chain, self._stride, values, diagonal, thorough=thorough)

    def _prepare(self, programs: tuple[list[ChainProgram], NDArray[np.int64]], slot: int) -> Prepared:
        """See ``PlannedKKT``."""
        chain = self._chain
        kinds, which = programs
        factors, matrix, entries, operations, lengths = (
            np.array(numbers, dtype=np.int64)
            for numbers in zip(
                *(
                    (kind.factors, kind.matrix, kind.entries.size, kind.operations, kind.code.size)
                    for kind in kinds
                ),
                strict=True,
            )
        )
        base = chain.base[:-1]
        places = np.empty(chain.order.size, dtype=np.int32)
        for number, kind in enumerate(kinds):
            here = base[which == number][:, None]
            places[here + kind.rows] = here + np.arange(kind.rows.size)
        index = np.zeros(places.size + chain_elimination.BLOCK, dtype=np.int32)
        index[: places.size] = chain.order[places]
        outer, outer_at = _outer_places(kinds, which)
        table = np.zeros((which.size, chain_elimination.FIELDS), dtype=np.int64)
        ends = base[-1] + kinds[which[-1]].rows[: chain.kinds[0].border]
        table[:, chain_elimination.OUTER] = ends.size + lengths.sum() + outer_at
        table[:, chain_elimination.CODE] = ends.size + (np.cumsum(lengths) - lengths)[which]
        table[:, chain_elimination.BASE] = base
        for field, sizes in (
            (chain_elimination.FACTORS, factors),
            (chain_elimination.MATRIX, matrix),
            (chain_elimination.SOURCES, entries),
        ):
            table[:, field] = np.cumsum(sizes[which]) - sizes[which]
        needed = int(factors[which].sum())
        if self._factors.size < needed:
            self._factors = aligned_zeros(int(ROOM * needed))
        numbers = int(matrix[which].sum())
        if self._matrix.size < numbers:
            self._matrix = aligned_zeros(int(ROOM * numbers))
        kept = self._matrix
        state = new_state(self._factors[:needed])
        codes = np.concatenate([ends, *(kind.code for kind in kinds), outer]).astype(np.int32)
        tables = which.size, table.reshape(-1), codes, index
        scale = aligned_zeros(index.size)
        arrays, border = self._arrays, chain.kinds[0].border
        zero = arrays.given.size - 1
        sources = np.full(int(entries[which].sum()), zero, dtype=np.int32)
        for number, kind in enumerate(kinds):
            here = np.flatnonzero(which == number)[:, None]
            held = np.flatnonzero(kind.entries >= 0)
            sources[table[here, chain_elimination.SOURCES] + held] = self._sources[
                chain.begin[:-1][here] + kind.entries[held]
            ]
        left, peaks, windows = self._spaces
        effort = sum(effort_of(len(WAYS), int(kind.code[chain_elimination.SIZE])) for kind in kinds)
        bound = eliminate.bind(
            *tables, border, self._index.size, self._stride, 1.0 / GROWTH, 1.0 / INVERSE, self._masks,
            sources, arrays.given, self._diagonal, places, self._scale, scale, left, peaks, kept, self._most, windows,
            self._factors, state,
        )  # fmt: skip
        self._calls.put(plan_calls.CALLS * slot + plan_calls.ELIMINATE, bound)
        self._calls.put(plan_calls.CALLS * slot + plan_calls.EQUILIBRATE, self._equilibrate)
        return Prepared(
            slot, tables, self._factors[:needed], state, (kept, scale), self._equilibrate,
            int(operations[which].sum()), effort, bool(self._curvatures[0]),
        )  # fmt: skip

    def _prepare_solve(
        self,
        plan: Prepared,
        place: int,
        refinements: int,
        vectors: tuple[Floats, ...],
        reports: tuple[Floats, Floats],
    ) -> Bound:
        """See ``PlannedKKT``."""
        kept, scale = plan.space
        return solve.bind(
            int(place == plan_calls.SOLVE_BOTH), refinements, self.accuracy, reading_distance(plan.factors),
            *plan.tables, self._index.size, self._stride, kept, plan.factors, scale, self._units, self._work,
            np.zeros(2), *vectors, *reports,
        )  # fmt: skip


def _outer_places(
    kinds: list[ChainProgram], which: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where the unknowns of F are in vectors, in lists for all pairs of programs, and which list each stage has."""
    pairs, list_of = np.unique(np.stack([which, np.append(which[1:], 0)]), axis=1, return_inverse=True)
    lists = [
        kinds[one].rows.size + kinds[other].rows[kinds[one].following] for one, other in pairs.T.tolist()
    ]
    lengths = np.array([places.size for places in lists])
    return np.concatenate(lists), (np.cumsum(lengths) - lengths)[list_of.reshape(-1)]
