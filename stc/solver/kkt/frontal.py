"""The structured KKT system: elimination stage by stage in a small dense window, time and memory linear in the stages."""

from __future__ import annotations

import numpy as np

from stc.solver.kkt import elimination
from stc.solver.kkt.arrangement import Couplings, arrange
from stc.solver.kkt.contract import Inertia
from stc.solver.kkt.entries import checked_values
from stc.solver.kkt.staging import assign_stages
from stc.solver.kkt.substitution import REPORT, solve
from stc.solver.kkt.values import equilibrate, load
from stc.solver.kkt.window import LANES
from stc.solver.nlp import Floats, Ints

__all__ = ["FrontalKKT"]

#: Columns of the equilibrated matrix no larger than this are zero.
SINGULAR = 1e-13
#: Magnitude of the pivot that takes the place of a zero one.
REPLACEMENT = 1e-8
PIVOT_THRESHOLD = 0.01
SWEEPS = 3
REFINEMENTS = 10
TOLERANCE = 1e-14


class FrontalKKT:
    """Sparse LDL^T with threshold pivoting on a window that slides over the stages."""

    def __init__(
        self,
        n: int,
        m: int,
        jac_rows: Ints,
        jac_cols: Ints,
        hess_rows: Ints,
        hess_cols: Ints,
        var_stage: Ints,
        row_stage: Ints,
    ) -> None:
        self.n = n
        self.m = m
        self.factorizations = 0
        self.nnz_factor = 0
        self.last_residual = 0.0
        self.pivot_threshold = PIVOT_THRESHOLD
        hess_rows = np.asarray(hess_rows, dtype=np.int32)
        hess_cols = np.asarray(hess_cols, dtype=np.int32)
        off = hess_rows != hess_cols
        hess_off, hess_diagonal = np.flatnonzero(off), np.flatnonzero(~off)
        self._couplings = Couplings(
            n,
            m,
            np.concatenate([hess_rows[hess_off], n + np.asarray(jac_rows, dtype=np.int32)]),
            np.concatenate([hess_cols[hess_off], np.asarray(jac_cols, dtype=np.int32)]),
            hess_off,
            hess_diagonal,
            hess_rows[hess_diagonal],
            hess_rows.size,
            len(jac_rows),
        )
        stage = np.concatenate([np.asarray(var_stage, dtype=np.int64), np.asarray(row_stage, dtype=np.int64)])
        self._staging = assign_stages(stage, self._couplings.first, self._couplings.second)
        self._hess = np.zeros(hess_rows.size)
        self._jac = np.zeros(len(jac_rows))
        self._primal = np.zeros(n)
        self._dual = np.zeros(m)
        self._rhs = np.zeros(n + m)
        self._result = np.zeros(n + m)
        self._report = np.zeros(REPORT)
        self._counts = np.zeros(elimination.COUNTS, dtype=np.int64)
        self._extra = 32
        self._prepare()

    def _prepare(self) -> None:
        size = self.n + self.m
        staging = self._staging
        a = self._arrangement = arrange(
            self._couplings, staging.stage, staging.stages, np.zeros(size, dtype=np.int32)
        )
        entries = a.columns.size
        self._values = np.zeros(size + entries)
        self._scale = np.zeros(size)
        self._most = np.zeros(size)
        self._slot = np.zeros(size, dtype=np.int32)
        self._planned_slot = staging.slot[a.order]
        self._pivots = np.zeros(2 * size, dtype=np.int32)
        self._starts = np.zeros(2 * size + 2, dtype=np.int64)
        self._inverse = np.zeros(3 * size)
        self._plan = (
            np.full(size, -1, dtype=np.int32),
            np.zeros(size, dtype=np.int32),
            np.zeros(size, dtype=np.int32),
        )
        self._plan_slots = np.zeros(1, dtype=np.int32)
        self._capacity = 4 * (size + entries) + 64
        self._vectors = [np.zeros(size) for _ in range(3)]
        self._allocate_window()
        self._allocate_factors()
        self._load = load.bind(
            self.n, self.m, self._hess.size, self._jac.size, self._hess, self._jac, self._primal, self._dual,
            a.position, a.hess_target, a.jac_target, self._values,
        )  # fmt: skip
        self._equilibrate = equilibrate.bind(
            size, SWEEPS, 1.1, a.pointers, a.columns, self._values, self._scale, self._most
        )
        self._bind()

    def _allocate_window(self) -> None:
        self._held_from = -(-self._staging.window // LANES) * LANES
        stride = self._held_from + self._extra
        self._stride = stride
        self._window = np.zeros(stride * stride)
        self._floats = [np.zeros(stride) for _ in range(6)]
        self._ints = [np.zeros(stride, dtype=np.int32) for _ in range(5)]

    def _allocate_factors(self) -> None:
        self._indices = np.zeros(self._capacity, dtype=np.int32)
        self._factors = np.zeros(2 * self._capacity)

    def _bind(self) -> None:
        a, staging, size = self._arrangement, self._staging, self.n + self.m
        spread_1, spread_2, values_1, values_2, first, second = self._floats
        owner, queue, found_1, found_2, found_12 = self._ints
        self._eliminate = elimination.factorize.bind(
            size, staging.stages, self.n, self.pivot_threshold, SINGULAR, REPLACEMENT, 2 * self._staging.window + 32,
            self._capacity, self._stride, self._held_from, a.stage_pointers, a.pointers, a.columns, self._values,
            a.order, self._planned_slot, staging.top, *self._plan, self._plan_slots, self._window,
            spread_1, spread_2, self._slot, owner, queue, found_1, found_2, found_12, values_1, values_2, first, second,
            self._pivots, self._starts, self._indices, self._factors, self._inverse, self._counts,
        )  # fmt: skip
        self._solve = solve.bind(
            size, REFINEMENTS, TOLERANCE, a.pointers, a.columns, self._values, self._scale, a.order,
            self._counts, self._pivots, self._starts, self._indices, self._factors, self._inverse, self._rhs,
            *self._vectors, self._result, self._report,
        )  # fmt: skip

    def factorize(
        self, hess_values: Floats, jac_values: Floats, primal_diagonal: Floats, dual_diagonal: Floats
    ) -> Inertia:
        """See ``KKTSystem.factorize``."""
        hess, jac, primal, dual = checked_values(
            (hess_values, self._hess.size, "hess_values"),
            (jac_values, self._jac.size, "jac_values"),
            (primal_diagonal, self.n, "primal_diagonal"),
            (dual_diagonal, self.m, "dual_diagonal"),
        )
        self._hess[:] = hess
        self._jac[:] = jac
        self._primal[:] = primal
        self._dual[:] = dual
        if self._load() != 0.0:
            raise ValueError("the KKT matrix has entries that are not finite")
        self.factorizations += 1
        self._equilibrate()
        while code := self._eliminate():
            if code == elimination.FACTORS_FULL:
                self._capacity *= 2
                self._allocate_factors()
                self._window[:] = 0.0
            else:
                self._extra *= 2
                self._allocate_window()
            self._bind()
        counts = self._counts
        self.nnz_factor = int(counts[elimination.FACTORS])
        return Inertia(
            int(counts[elimination.POSITIVE]),
            int(counts[elimination.NEGATIVE]),
            int(counts[elimination.ZERO]),
        )

    def solve(self, rhs_x: Floats, rhs_y: Floats) -> tuple[Floats, Floats]:
        """See ``KKTSystem.solve``."""
        if self.factorizations == 0:
            raise ValueError("factorize before solving")
        n = self.n
        self._rhs[:n] = rhs_x
        self._rhs[n:] = rhs_y
        self._solve()
        self.last_residual = float(self._report[0])
        return self._result[:n].copy(), self._result[n:].copy()
