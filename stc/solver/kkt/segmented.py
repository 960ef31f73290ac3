"""The KKT system of a horizon that repeats itself: eight segments at once, then what is between them.

Segments are eliminated with pivots fixed before (see stc.solver.kkt.lanes).  The seams between them and irregular
stages go through ``MultifrontalKKT``.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.arrays import aligned_zeros
from stc.codegen.threads import parallel, record
from stc.core.calls import Bound, CallTable
from stc.solver.kkt import lanes, plan_calls
from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.entries import Arrays
from stc.solver.kkt.lane_panel import KNOWN, PANEL
from stc.solver.kkt.lane_program import WAYS, Program, effort_of, kind_of, plan_panels
from stc.solver.kkt.lane_runs import RUN
from stc.solver.kkt.lane_state import FETCHED, STATE
from stc.solver.kkt.lane_tables import Layout, code_of, lay_out
from stc.solver.kkt.lane_values import sizes_of
from stc.solver.kkt.multifrontal import MultifrontalKKT
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
from stc.solver.kkt.seams import sew
from stc.solver.kkt.segmented_parts import (
    BACKWARD,
    CALLS,
    FORWARD,
    NORMS,
    PROGRESS,
    RETURN,
    SPREADS,
    backward_part,
    eliminate_part,
    forward_part,
    return_part,
)
from stc.solver.kkt.segmented_passes import eliminate_all, equilibrate_all, solve_all
from stc.solver.kkt.segments import Segmentation
from stc.solver.nlp import Floats

__all__ = ["SegmentedKKT"]

#: Calls of the parts, in a table that has so many for each plan: the elimination, then the phases of each solve.
ELIMINATE = 0
PHASES_OF = {
    place: 1 + CALLS * number
    for number, place in enumerate((plan_calls.PROBE, plan_calls.SOLVE, plan_calls.SOLVE_BOTH))
}
CALLS_OF_PLAN = 1 + CALLS * len(PHASES_OF)
#: Behind those of all plans: the rest's solves, of one right-hand side and of two.
REST_SOLVE = CALLS_OF_PLAN * WHOLE


class SegmentedKKT(PlannedKKT):
    """Sparse LDL^T of segments in vector lanes and of the rest by ``MultifrontalKKT``.

    See ``AttachedKKT`` for the members.
    """

    tells_of_entries = True

    def __init__(self, couplings: Couplings, stage: NDArray[np.int64], found: Segmentation) -> None:
        self._found = found
        variables = np.bincount(found.stages.stage[: couplings.n], minlength=found.stages.pointers.size - 1)
        self._kinds = [kind_of(found, k, int(variables[example])) for k, example in enumerate(found.example)]
        self._sewn = sewn = sew(couplings, found, self._kinds)
        arrays = Arrays.of(couplings, sewn.added, (1.0, -1.0))
        one, minus_one = arrays.given.size - 2, arrays.given.size - 1
        self._source = np.concatenate(
            [
                couplings.hess_off,
                couplings.hess_count + np.arange(couplings.jac_count),
                np.full(sewn.added // 2, minus_one),
            ]
        ).astype(np.int32)
        self._layout = layout = lay_out(found, self._kinds, sewn, self._source, one)
        left = layout.rest
        self._rest_arrays = Arrays.of(left.couplings)
        rest = MultifrontalKKT.of_couplings(
            left.couplings, sewn.stage[left.unknowns], self._rest_arrays, part=True
        )
        super().__init__(couplings, stage, arrays, rest)
        self._scale, self._most, *self._vectors = (aligned_zeros(layout.length) for _ in range(12))
        self._scale[:] = 1.0
        self._matrix = aligned_zeros(layout.matrix)
        self._rest_matrix = np.zeros(left.unknowns.size + left.entry.size)
        entry = left.entry
        self._rest_entries = (
            layout.places[sewn.couplings.first[entry]],
            layout.places[sewn.couplings.second[entry]],
            self._source[entry].copy(),
        )
        widest = max(kind.size for kind in self._kinds)
        ends = np.cumsum((0, *found.parts)).tolist()
        self._parts = [_Part(range(begin, end), layout, widest) for begin, end in itertools.pairwise(ends)]
        others = len(self._parts) - 1
        self._left_entries = np.zeros((others, self._rest_arrays.given.size))
        self._left_most = np.zeros((others, layout.length))
        self._left = np.zeros((others, layout.length)), np.zeros((others, layout.length))
        self._part_calls = CallTable(REST_SOLVE + 2)
        for both, call in enumerate(rest.calls_of_solves):
            self._part_calls.put(REST_SOLVE + both, call)
        self._paces = [record() for _ in range(1 + 2 * CALLS)]
        nothing = [np.zeros(kind.size * (kind.size + 1) // 2, dtype=bool) for kind in self._kinds]
        first = self._prepare([Program([], used, 0, 0) for used in nothing], 0)  # for equilibration
        self._plans = Plans(couplings.size, first)

    @property
    def nbytes(self) -> int:
        """Memory held, about."""
        own = 8 * self._arrays.given.size + 64 * self._diagonal.size + self._layout.index.nbytes
        own += self._factors.nbytes + self._matrix.nbytes + (2 + len(self._vectors)) * self._scale.nbytes
        own += self._left_entries.nbytes + self._left_most.nbytes + sum(left.nbytes for left in self._left)
        own += 0 if self._rest is None else self._rest.nbytes
        return own + (self._whole.nbytes if self._whole is not None else 0)

    def _programs(self, thorough: bool) -> list[list[Program]]:
        """See ``PlannedKKT``."""
        scale, couplings = self._scale[self._layout.places], self._couplings
        diagonal = self._own_diagonal() * scale[: couplings.size] ** 2
        sizes = sizes_of(
            self._found, self._kinds, couplings, self._source, self._arrays.given, scale, diagonal
        )
        by_kind = [
            plan_panels(kind, *known, thorough=thorough)
            for kind, known in zip(self._kinds, sizes, strict=True)
        ]
        most = max(len(programs) for programs in by_kind)
        return [[programs[min(k, len(programs) - 1)] for programs in by_kind] for k in range(most)]

    def _prepare(self, programs: list[Program], slot: int) -> Prepared:
        """See ``PlannedKKT``."""
        layout, groups, given = self._layout, self._found.groups, self._arrays.given
        rest = layout.rest
        code = code_of(layout.table, groups, self._kinds, programs)
        last = layout.table[-1]
        vectors = int(last[lanes.FACTORS] + last[lanes.STEPS] * last[lanes.FACTOR_STEP])
        if self._factors.size < 8 * vectors:
            self._factors = aligned_zeros(int(ROOM * 8 * vectors))
        factors = self._factors[: 8 * vectors]
        state = new_state(factors)
        states = aligned_zeros(STATE * len(self._parts))
        tables = len(groups), layout.table.reshape(-1).copy(), layout.index, code
        outside = layout.outer, rest.unknowns.size, rest.entry.size
        spreads = aligned_zeros(SPREADS * len(self._parts))
        calls = []
        for number, part in enumerate(self._parts):
            own_state = states[STATE * number :][:STATE]
            own_state[:] = state
            first = number == 0
            left = self._rest_arrays.given if first else self._left_entries[number - 1]
            most = self._most if first else self._left_most[number - 1]
            calls.append(
                eliminate_part.bind(
                    *part.tables(tables), 1.0 / GROWTH, 1.0 / INVERSE, given, part.ring, self._diagonal, self._scale,
                    left, part.triangle, part.work, part.known, part.made, self._matrix, part.vector, most,
                    spreads[SPREADS * number :], factors, own_state, 0 if first else left.size, layout.outer,
                    0 if first else rest.unknowns.size,
                )
            )  # fmt: skip
        place = CALLS_OF_PLAN * slot
        self._part_calls.put(place + ELIMINATE, parallel([calls], self._paces[ELIMINATE]))
        eliminate = eliminate_all.bind(
            self._part_calls.cells, place + ELIMINATE, len(self._parts), states, spreads, self._left_entries.shape[1],
            self._left_entries.reshape(-1), self._left_most.reshape(-1), layout.index, given, self._diagonal,
            self._scale, self._most, self._rest_arrays.given, state, *outside, rest.target, *self._rest_entries,
            rest.couplings.n, rest.couplings.hess_count, self._rest_matrix,
        )  # fmt: skip
        work = self._parts[0]
        equilibrate = equilibrate_all.bind(
            SWEEPS,
            int(state[FETCHED]),
            *tables,
            *outside,
            *self._rest_entries,
            given,
            self._diagonal,
            self._scale,
            self._most,
            work.work,
            work.vector,
        )
        operations = sum(
            group.segments * len(group.stages) * programs[group.kind].operations for group in groups
        )
        effort = sum(effort_of(len(WAYS), kind.size) for kind in self._kinds)
        self._calls.put(plan_calls.CALLS * slot + plan_calls.ELIMINATE, eliminate)
        self._calls.put(plan_calls.CALLS * slot + plan_calls.EQUILIBRATE, equilibrate)
        return Prepared(
            slot, tables, factors, state, (), equilibrate, operations, effort, bool(self._curvatures[0])
        )

    def _prepare_solve(
        self,
        plan: Prepared,
        place: int,
        refinements: int,
        vectors: tuple[Floats, ...],
        reports: tuple[Floats, Floats],
    ) -> Bound:
        """See ``PlannedKKT``."""
        layout, both = self._layout, int(place == plan_calls.SOLVE_BOTH)
        half = len(vectors) // 2
        rhs, scaled_rhs, solution, change, between, kept, result = vectors[:half]
        other_rhs, other_scaled_rhs, other_solution, other_change, other_between, other_kept, other_result = (
            vectors[half:]
        )
        outer, rest, distance = layout.outer, layout.rest, reading_distance(plan.factors)
        progress, norms = np.zeros(PROGRESS, dtype=np.int64), np.zeros(NORMS * len(self._parts))
        left, other_left = self._left
        left_over = self._rest_arrays
        phases: tuple[list[Bound], ...] = [], [], []
        for number, part in enumerate(self._parts):
            # What the first part leaves goes to the rest at once.
            first = number == 0
            own_norms = norms[NORMS * number :]
            span = part.begin, part.end, outer, 0 if first else rest.unknowns.size
            common = both, distance, *part.tables(plan.tables), plan.factors
            phases[FORWARD].append(
                forward_part.bind(
                    *common, part.vector, progress, own_norms, *span, self._scale, rhs, scaled_rhs, change, between,
                    between if first else left[number - 1], other_rhs, other_scaled_rhs, other_change, other_between,
                    other_between if first else other_left[number - 1],
                )
            )  # fmt: skip
            phases[BACKWARD].append(
                backward_part.bind(
                    *common, self._matrix, part.work, part.vector, progress, own_norms, *span, between, kept, solution,
                    scaled_rhs, change, change if first else left[number - 1], other_between, other_kept,
                    other_solution, other_scaled_rhs, other_change,
                    other_change if first else other_left[number - 1],
                )
            )  # fmt: skip
            phases[RETURN].append(
                return_part.bind(
                    both, part.begin, part.end, layout.index, self._scale, solution, result, other_solution,
                    other_result,
                )
            )  # fmt: skip
        begin = CALLS_OF_PLAN * plan.slot + PHASES_OF[place]
        for phase, calls in enumerate(phases):
            pace = self._paces[1 + len(phases) * both + phase]
            self._part_calls.put(begin + phase, parallel([calls], pace))
        return solve_all.bind(
            both, refinements, self.accuracy, self._part_calls.cells, begin, len(self._parts), progress, norms,
            np.zeros(2), left.reshape(-1), other_left.reshape(-1), layout.index, outer, rest.unknowns.size,
            rest.entry.size, *self._rest_entries[:2], self._rest_matrix, self._scale,
            REST_SOLVE, left_over.rhs, left_over.solution, left_over.second_rhs, left_over.second_solution, *vectors,
            *reports,
        )  # fmt: skip


class _Part:
    """Some groups of segments, and the memory that whoever is at them works in."""

    def __init__(self, groups: range, layout: Layout, widest: int) -> None:
        self._groups = groups
        table = layout.table
        self.begin = int(table[groups.start, lanes.UNKNOWNS])
        last = groups.stop == len(table)
        self.end = layout.outer if last else int(table[groups.stop, lanes.UNKNOWNS])
        self.triangle = aligned_zeros(4 * widest * (widest + 1))
        self.known = aligned_zeros(KNOWN)
        self.made = aligned_zeros(8 * PANEL * (widest + PANEL))
        self.work, self.vector = aligned_zeros(16 * widest), aligned_zeros(16 * widest)
        self.ring = aligned_zeros(8 * RUN * int(table[:, lanes.ENTRIES].max(initial=0)))

    def tables(self, tables: tuple[Any, ...]) -> tuple[Any, ...]:
        """Those of a plan for these groups alone: how many, their fields, what these refer to."""
        _, table, index, code = tables
        groups = self._groups
        return len(groups), table[lanes.FIELDS * groups.start : lanes.FIELDS * groups.stop], index, code
