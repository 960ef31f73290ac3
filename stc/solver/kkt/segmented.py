"""The KKT system of a horizon that repeats itself: eight segments at once, then what is between them.

Segments are eliminated with pivots fixed before (see stc.solver.kkt.lanes).  The seams between them and irregular
stages go through ``FrontalKKT``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.arrays import aligned_zeros
from stc.codegen.native import NativeFunction
from stc.solver.kkt import lanes, plan_calls
from stc.solver.kkt.arrangement import Couplings
from stc.solver.kkt.entries import Arrays
from stc.solver.kkt.frontal import SWEEPS, FrontalKKT
from stc.solver.kkt.lane_panel import DISTANCE, PANEL
from stc.solver.kkt.lane_program import Program, kind_of, plan_panels
from stc.solver.kkt.lane_tables import code_of, lay_out
from stc.solver.kkt.lane_values import sizes_of
from stc.solver.kkt.plan_choice import Plans, Prepared
from stc.solver.kkt.planned import GROWTH, INVERSE, ROOM, PlannedKKT, new_state, reading_distance
from stc.solver.kkt.seams import sew
from stc.solver.kkt.segmented_passes import eliminate_all, equilibrate_all, solve_all
from stc.solver.kkt.segments import LANES, Segmentation

__all__ = ["SegmentedKKT"]


class SegmentedKKT(PlannedKKT):
    """Sparse LDL^T of segments in vector lanes and of the rest by ``FrontalKKT``.

    See ``AttachedKKT`` for the members.
    """

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
        beside = np.concatenate([places.reshape(-1) for places in (*sewn.before, *sewn.after)])
        self._rest_system = FrontalKKT.of_couplings(
            left.couplings,
            sewn.stage[left.unknowns],
            Arrays.of(left.couplings),
            part_filled=np.searchsorted(left.unknowns, beside),
        )
        super().__init__(couplings, stage, arrays, self._rest_system, left.unknowns.size)
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
        nothing = [np.zeros(kind.size * (kind.size + 1) // 2, dtype=bool) for kind in self._kinds]
        first = self._prepare([Program([], used, 0, 0) for used in nothing], 0)  # for equilibration
        self._plans = Plans(couplings.size, first)

    @property
    def nbytes(self) -> int:
        """Memory held, about."""
        own = 8 * self._arrays.given.size + 64 * self._diagonal.size + self._layout.index.nbytes
        own += self._factors.nbytes + self._matrix.nbytes + (2 + len(self._vectors)) * self._scale.nbytes
        return own + self._rest.nbytes + (self._whole.nbytes if self._whole is not None else 0)

    def _programs(self, thorough: bool) -> list[Program]:
        """See ``PlannedKKT``."""
        scale, couplings, found = self._scale[self._layout.places], self._couplings, self._found
        values = self._arrays.given[self._source[: couplings.first.size]]
        values *= scale[couplings.first] * scale[couplings.second]
        diagonal = self._own_diagonal() * scale[: couplings.size] ** 2
        return [
            plan_panels(kind, *sizes_of(found, kind, number, values, diagonal), thorough=thorough)
            for number, kind in enumerate(self._kinds)
        ]

    def _prepare(self, programs: list[Program], slot: int) -> Prepared:
        """See ``PlannedKKT``."""
        layout, groups, given = self._layout, self._found.groups, self._arrays.given
        rest = layout.rest
        code = code_of(layout.table, groups, self._kinds, programs)
        last = layout.table[-1]
        vectors = int(last[lanes.FACTORS] + last[lanes.STEPS] * last[lanes.FACTOR_STEP])
        widest = max(kind.size for kind in self._kinds)
        if self._factors.size < 8 * vectors:
            self._factors = aligned_zeros(int(ROOM * 8 * vectors))
        factors = self._factors[: 8 * vectors]
        state = new_state(factors)
        tables = len(groups), layout.table.reshape(-1).copy(), layout.index, code
        work, part = aligned_zeros(16 * widest), aligned_zeros(16 * widest)
        outside = layout.outer, rest.unknowns.size, rest.entry.size
        eliminate = eliminate_all.bind(
            *tables, 1.0 / GROWTH, 1.0 / INVERSE, given, self._diagonal, self._scale, self._rest_system.given,
            aligned_zeros(4 * widest * (widest + 1)), work,
            aligned_zeros(16 * PANEL * (widest + PANEL)), aligned_zeros(8 * PANEL * (widest + PANEL)), self._matrix,
            part, self._most, aligned_zeros(2 * LANES), factors, state, *outside, rest.target, *self._rest_entries,
            rest.couplings.n, rest.couplings.jac_count, self._rest_matrix,
        )  # fmt: skip
        equilibrate = equilibrate_all.bind(
            SWEEPS,
            int(state[DISTANCE]),
            *tables,
            *outside,
            *self._rest_entries,
            given,
            self._diagonal,
            self._scale,
            self._most,
            work,
            part,
        )
        operations = sum(
            group.segments * len(group.stages) * programs[group.kind].operations for group in groups
        )
        self._calls.put(plan_calls.CALLS * slot + plan_calls.ELIMINATE, eliminate)
        self._calls.put(plan_calls.CALLS * slot + plan_calls.EQUILIBRATE, equilibrate)
        curved = bool(self._curvatures[0])
        return Prepared(slot, tables, factors, state, (work, part), equilibrate, operations, curved)

    def _solver(self, plan: Prepared) -> tuple[NativeFunction[..., None], tuple[Any, ...]]:
        """See ``PlannedKKT``."""
        layout, rest_factors = self._layout, self._rest_system.factors_in_order()
        common = (
            self.accuracy, reading_distance(plan.factors), *plan.tables, layout.outer, layout.rest.unknowns.size,
            layout.rest.entry.size, *self._rest_entries[:2], plan.factors, self._matrix, self._rest_matrix,
            self._scale, *plan.space, np.zeros(4), *rest_factors,
        )  # fmt: skip
        return solve_all, common
