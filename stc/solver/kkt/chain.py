"""The KKT system of wide stages, one after the other: all pivots fixed before, no rest.

Segments in vector lanes (see stc.solver.kkt.segmented) couple with both of their ends, which takes two to three times
as many operations as a chain does.  In small stages that costs nothing, since lanes take as long for eight numbers as
for one; in wide ones the vectors can be filled by rows of a stage instead.  What is irregular is part of the chain.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.arrays import aligned_zeros
from stc.codegen.threads import parallel, record
from stc.core.calls import Bound, CallTable
from stc.solver.kkt import chain_elimination, plan_calls
from stc.solver.kkt.chain_elimination import eliminate, eliminate_run
from stc.solver.kkt.chain_plan import WAYS, Chain, ChainProgram, lay_out_chain, plan_chain
from stc.solver.kkt.chain_rows import VECTORS
from stc.solver.kkt.chain_solve import (
    BACKWARD,
    BACKWARD_TAIL,
    CALLS,
    FORWARD,
    FORWARD_TAIL,
    PROGRESS,
    backward_run,
    forward_run,
    solve,
)
from stc.solver.kkt.chain_substitution import ONE, UNITS
from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.entries import Arrays
from stc.solver.kkt.folding import fold
from stc.solver.kkt.lane_program import effort_of
from stc.solver.kkt.lane_state import STATE
from stc.solver.kkt.plan_choice import Plans, Prepared
from stc.solver.kkt.planned import (
    GROWTH,
    INVERSE,
    ROOM,
    SWEEPS,
    WHOLE,
    PlannedKKT,
    new_state,
    reading_distance,
)
from stc.solver.kkt.postponing import postponed
from stc.solver.kkt.segmented_passes import equilibrate_all
from stc.solver.kkt.segments import Numbered, number_unknowns, row_of_stages
from stc.solver.nlp import Floats

__all__ = ["ChainKKT", "find_chain"]

#: Kinds of stages at most: each is planned for.
KINDS = 64
#: Calls of the runs of stages, in a table that has so many for each plan: two of the elimination, then those of each
#: solve.
ELIMINATE, ELIMINATE_TAIL = 0, 1
PHASES_OF = {
    place: 2 + CALLS * number
    for number, place in enumerate((plan_calls.PROBE, plan_calls.SOLVE, plan_calls.SOLVE_BOTH))
}
CALLS_OF_PLAN = 2 + CALLS * len(PHASES_OF)


#: What a stage takes is about the third power of its unknowns. Where all take more than this together, the chain is
#: gone through from both ends: two threads gain more by that than it takes to plan for stages in either direction.
FOLDED = 5e7


def find_chain(
    couplings: Couplings,
    stage: NDArray[np.int64],
    numbered: Numbered,
    held: NDArray[np.bool_] | None,
    equations: NDArray[np.bool_] | None = None,
    *,
    folded: bool = True,
) -> Chain | None:
    """Lay out a chain, or None where it would have too many kinds of stages.

    Args:
        stage, held: what ``numbered`` was found for.
        equations: rows that have nothing on the diagonal, (m,): they wait for the next stage where they are too many
            for theirs (see stc.solver.kkt.postponing).
        folded: whether a long one may be gone through from both ends. Where stages are sparse, the last one may have
            more rows than variables.
    """
    if folded and (np.diff(numbered.stages.pointers).astype(np.float64) ** 3).sum() >= FOLDED:
        row = row_of_stages(couplings, stage)
        halves = fold(couplings, row, held, equations) if row is not None else None
        if halves is not None:
            chain = lay_out_chain(halves[0], couplings.n, couplings.first, couplings.second, halves[1])
            meeting = chain.kinds[chain.kind[sum(halves[1])]]
            if len(chain.kinds) <= KINDS and meeting.arrived.size and meeting.joined.size:
                return chain
    stages = numbered.stages
    later = postponed(couplings, stages.stage, stages.border, held, equations)
    if later is not stages.stage:
        numbered = number_unknowns(couplings, later, stages.border, held)
    chain = lay_out_chain(numbered, couplings.n, couplings.first, couplings.second)
    return chain if len(chain.kinds) <= KINDS else None


class ChainKKT(PlannedKKT):
    """Sparse LDL^T of stages in a row (see stc.solver.kkt.chain_elimination).

    See ``AttachedKKT`` for the members.
    """

    def __init__(self, couplings: Couplings, stage: NDArray[np.int64], chain: Chain) -> None:
        arrays = Arrays.of(couplings, numbers=(0.0,))
        super().__init__(couplings, stage, arrays)
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
        stages, border = chain.kind.size, chain.kinds[0].border
        ends = [0, *np.cumsum(chain.parts).tolist(), stages]
        self._runs = [_Run(*span, chain, self._stride) for span in itertools.pairwise(ends)]
        self._tail = int(chain.base[ends[-2]]) if chain.parts else size
        self._border_entries = border * (border + 1) // 2
        room = size + chain_elimination.BLOCK if chain.parts else 0
        self._other_most = np.zeros(room)
        self._aside = [aligned_zeros(room) for _ in range(4)]
        self._run_calls = CallTable(CALLS_OF_PLAN * WHOLE)
        self._paces = [record() for _ in range(1 + 2 * CALLS)]
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
        own += self._factors.nbytes + self._matrix.nbytes + sum(run.nbytes for run in self._runs)
        own += self._other_most.nbytes + sum(vector.nbytes for vector in self._aside)
        return own + (self._whole.nbytes if self._whole is not None else 0)

    def _programs(self, thorough: bool) -> list[tuple[list[ChainProgram], NDArray[np.int64]]]:
        """See ``PlannedKKT``; which program each stage has, too."""
        scale, couplings = self._scale[self._place], self._couplings
        values = self._arrays.given[self._source] * scale[couplings.first] * scale[couplings.second]
        diagonal = self._own_diagonal() * scale**2
        return [plan_chain(self._chain, self._stride, values, diagonal, thorough=thorough)]

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
        border = chain.kinds[0].border
        places = np.empty(chain.order.size, dtype=np.int32)
        for number, kind in enumerate(kinds):
            here = base[which == number][:, None]
            places[here + kind.rows] = here + np.arange(kind.rows.size)
        index = np.zeros(places.size + chain_elimination.BLOCK, dtype=np.int32)
        index[: places.size] = chain.order[places]
        outer, outer_at = _outer_places(kinds, which, base, chain.after)
        table = np.zeros((which.size, chain_elimination.FIELDS), dtype=np.int64)
        ends = base[-1] + kinds[which[-1]].rows[:border]
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
        arrays = self._arrays
        zero = arrays.given.size - 1
        sources = np.full(int(entries[which].sum()), zero, dtype=np.int32)
        for number, kind in enumerate(kinds):
            here = np.flatnonzero(which == number)[:, None]
            held = np.flatnonzero(kind.entries >= 0)
            sources[table[here, chain_elimination.SOURCES] + held] = self._sources[
                chain.begin[:-1][here] + kind.entries[held]
            ]
        effort = sum(effort_of(len(WAYS), int(kind.code[chain_elimination.SIZE])) for kind in kinds)
        states = aligned_zeros(STATE * len(self._runs))
        bound = []
        for number, run in enumerate(self._runs):
            own_state = states[STATE * number :][:STATE]
            own_state[:] = state
            # The last run goes on where the first one has ended, and takes up what the second one has left.
            last = number == 2
            joined = self._runs[1].left if last else run.left[:0]
            bound.append(
                eliminate_run.bind(
                    *run.tables(tables), self._stride, 1.0 / GROWTH, 1.0 / INVERSE, self._masks, sources, arrays.given,
                    self._diagonal, scale, 0 if last else self._border_entries, joined,
                    self._runs[0].left if last else run.left, run.peaks, kept, 0 if last else self._index.size,
                    self._other_most if number == 1 else self._most, run.windows, self._factors, own_state,
                )
            )  # fmt: skip
        place = CALLS_OF_PLAN * slot
        self._run_calls.put(place + ELIMINATE, parallel([bound[:2]], self._paces[0]))
        self._run_calls.put(place + ELIMINATE_TAIL, bound[-1])
        first = eliminate.bind(
            self._run_calls.cells, place, len(self._runs), states, self._other_most, self._index.size, places,
            self._scale, scale, self._most, state,
        )  # fmt: skip
        self._calls.put(plan_calls.CALLS * slot + plan_calls.ELIMINATE, first)
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
        both, distance = int(place == plan_calls.SOLVE_BOTH), reading_distance(plan.factors)
        half = len(vectors) // 2
        solution, change = vectors[2], vectors[3]
        other_solution, other_change = vectors[half + 2], vectors[half + 3]
        aside, left, other_aside, other_left = self._aside
        size, stride = self._index.size, self._stride
        progress = np.zeros(PROGRESS, dtype=np.int64)
        forward, backward = [], []
        for number, run in enumerate(self._runs):
            apart = int(number == 1)
            span = apart, run.begin, run.end, self._tail, size, progress, distance
            _, table, code, _ = run.tables(plan.tables)
            stages = run.stages, table, code, stride
            forward.append(
                forward_run.bind(
                    *span, *stages, plan.factors, run.work, solution, change, aside, other_solution, other_change,
                    other_aside,
                )
            )  # fmt: skip
            backward.append(
                backward_run.bind(
                    *span, *stages, self._units, plan.factors, kept, run.work, solution, change, aside, left,
                    other_solution, other_change, other_aside, other_left,
                )
            )  # fmt: skip
        begin = CALLS_OF_PLAN * plan.slot + PHASES_OF[place]
        paces = self._paces[1 + CALLS * both :]
        self._run_calls.put(begin + FORWARD, parallel([forward[:2]], paces[FORWARD]))
        self._run_calls.put(begin + FORWARD_TAIL, forward[-1])
        self._run_calls.put(begin + BACKWARD_TAIL, backward[-1])
        self._run_calls.put(begin + BACKWARD, parallel([backward[:2]], paces[BACKWARD]))
        return solve.bind(
            both, refinements, self.accuracy, self._run_calls.cells, begin, len(self._runs), self._tail, progress,
            *plan.tables, size, stride, kept, scale, self._runs[0].work, np.zeros(2), *self._aside, *vectors, *reports,
        )  # fmt: skip


class _Run:
    """Stages from ``first`` to before ``last``, and the memory of whoever goes through them."""

    def __init__(self, first: int, last: int, chain: Chain, stride: int) -> None:
        self._first, self.stages = first, last - first
        self.begin, self.end = int(chain.base[first]), int(chain.base[last])
        self.left, self.windows = aligned_zeros(stride * stride), aligned_zeros(2 * stride * stride)
        self.peaks = aligned_zeros((chain_elimination.BLOCK + 2) * stride)
        self.work = aligned_zeros(2 * VECTORS * stride)

    @property
    def nbytes(self) -> int:
        """Memory held."""
        return self.left.nbytes + self.windows.nbytes + self.peaks.nbytes + self.work.nbytes

    def tables(self, tables: tuple[Any, ...]) -> tuple[Any, ...]:
        """Those of a plan for these stages alone."""
        _, table, code, index = tables
        return self.stages, table[chain_elimination.FIELDS * self._first :], code, index


def _outer_places(
    kinds: list[ChainProgram], which: NDArray[np.int64], base: NDArray[np.int64], after: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where the unknowns of F are in vectors, counted from a stage's own, and which list of that each stage has.

    Stages have the same list where they and those after them have the same programs and are as far apart.

    Args:
        which: the program of each stage; base: where its unknowns begin; after: which stage has its F.
    """
    alike = np.stack([which, which[after], base[after] - base])
    different, list_of = np.unique(alike, axis=1, return_inverse=True)
    lists = [
        distance + kinds[other].rows[kinds[one].following] for one, other, distance in different.T.tolist()
    ]
    lengths = np.array([places.size for places in lists])
    return np.concatenate(lists), (np.cumsum(lengths) - lengths)[list_of.reshape(-1)]
