"""The KKT system factorised by the core (``stc/core/kkt.h``): a multifrontal LDL^T with threshold pivoting.

Where stages repeat, like segments of the horizon are eliminated first, eight at a time.
"""

from __future__ import annotations

import ctypes
import weakref
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.arrays import ranks
from stc.codegen.threads import parallel, record
from stc.core.calls import Bound, CallTable
from stc.core.functions import function
from stc.core.structures import structure
from stc.solver.kkt.contract import FINE, Inertia, KKTSystem, check_ended
from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.segment_tables import entries_by_column, tables_of
from stc.solver.kkt.segments import Segmentation
from stc.solver.nlp import Ints

__all__ = ["DOUBTFUL", "MultifrontalKKT"]

#: Where a solve leaves a larger relative residual than DOUBTFUL, the matrix is factorised again without segments, then
#: with larger pivot thresholds, up to the highest.
DOUBTFUL = 1e-9
THRESHOLD, HIGHEST_THRESHOLD = 1e-4, 0.3
#: What is done for the segments of a part: calls that are made by number.
PHASES = ELIMINATE, FORWARD, BACKWARD, RETURN = 0, 1, 2, 3


class MultifrontalKKT(KKTSystem):
    """Sparse LDL^T over a tree of fronts.  See ``KKTSystem`` for the arguments and members."""

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
        held: NDArray[np.bool_] | None = None,
    ) -> None:
        stage = np.concatenate([np.asarray(given).astype(np.int64) for given in (var_stage, row_stage)])
        self._prepare(Couplings.of(n, m, jac_rows, jac_cols, hess_rows, hess_cols), stage, None)

    @classmethod
    def of_couplings(
        cls, couplings: Couplings, stage: NDArray[np.int64], found: Segmentation | None
    ) -> MultifrontalKKT:
        """For a pattern that is known: ``stage`` of each unknown, (N,), and segments that are eliminated first."""
        system = cls.__new__(cls)
        system._prepare(couplings, stage, found)
        return system

    def _prepare(self, couplings: Couplings, stage: NDArray[np.int64], found: Segmentation | None) -> None:
        n, m = couplings.n, couplings.m
        segments = tables_of(couplings, found) if found is not None else {"total": couplings.size}
        vectors = self._allocate(
            n, m, couplings.hess_count, couplings.jac_count, segments["total"] - couplings.size
        )
        common = dict(
            n=n, m=m, given_count=self.hess.size + self.jac.size, curved=couplings.hess_variable.size,
            curved_variable=couplings.hess_variable, curved_source=couplings.hess_diagonal.astype(np.int32),
            given=self.given, **vectors, report=self.report, accuracy=self.accuracy, inertia=self.inertia,
            threshold=THRESHOLD, fine=FINE,
        )  # fmt: skip
        size = couplings.size
        whole = structure("kkt")(
            **common, total=size, size=size, variables=n, entries=couplings.first.size, filled=couplings.first.size,
            **entries_by_column(couplings.first, couplings.second, couplings.sources, size),
            unknown=np.arange(size, dtype=np.int32), stage=ranks(stage)[0].astype(np.int32),
        )  # fmt: skip
        self._system: Any = whole
        self._whole = whole
        if found is not None:
            self._calls = CallTable(len(PHASES))
            self._system = structure("kkt")(**common, **segments, calls=self._calls.cells)
            self._system.whole = ctypes.addressof(whole)
        if _new(self._system):
            raise MemoryError("there is no memory for a linear system of this size")
        weakref.finalize(self, lambda *systems: _free(systems[0]), self._system, whole).atexit = False
        for phase in PHASES if found is not None else ():
            parts = [_part.bind(self._system, number, phase) for number in range(segments["parts"])]
            self._calls.put(phase, parallel([parts], record()))
        self._refactor, self._attempt, self._solve, self._solve_both = (
            call.bind(self._system) for call in (_refactor, _attempt, _solve, _solve_both)
        )
        self.restart()

    def restart(self) -> None:
        """Forget all matrices, as if new, but not the plan."""
        self._system.threshold, self._system.careful = THRESHOLD, 0
        _restart(self._system)
        self._counted_before = self._system.factorizations
        #: The count of factorisations at the last check, and the threshold that this matrix has been tried with.
        self._checked = 0, 0.0
        self.last_residual = 0.0
        self._factorized = False

    @property
    def segments(self) -> int:
        """How many groups of segments are eliminated first."""
        return int(self._system.groups)

    @property
    def refused(self) -> int:
        """How many matrices had segments without pivots, or inaccurate factors."""
        return int(self._system.refused)

    @property
    def factorizations(self) -> int:
        """See ``KKTSystem.factorizations``."""
        return int(self._system.factorizations - self._counted_before)

    @property
    def nnz_factor(self) -> int:
        """See ``KKTSystem.nnz_factor``."""
        return int(self._system.nonzeros) if self._factorized else 0

    @property
    def operations(self) -> int:
        """Additions and multiplications of the last factorisation."""
        return 2 * int(self._system.operations)

    @property
    def factor_bytes(self) -> int:
        """Memory that the last factorisation fills, about."""
        return 8 * int(self._system.nonzeros)

    @property
    def nbytes(self) -> int:
        """Memory held, about."""
        both = {id(system): system.held for system in (self._system, self._whole)}
        return 8 * int(sum(both.values())) + 24 * self.given.size + 100 * self.rhs.size

    @property
    def attempt_call(self) -> Bound | None:
        """See ``KKTSystem.attempt_call``."""
        return self._attempt if self._factorized else None

    def refactor(self) -> Inertia:
        """See ``KKTSystem.refactor``."""
        return self.resume(self._refactor())

    def resume(self, ended: int) -> Inertia:
        """See ``KKTSystem.resume``."""
        self._factorized = False
        check_ended(ended)
        self._factorized = True
        return Inertia(*self.inertia.tolist())

    def check_solution(self) -> bool:
        """See ``KKTSystem.check_solution``."""
        made, reached = self._checked
        usual = 0.0 if self._system.segmented else THRESHOLD
        before = tried = max(reached, usual) if made == self.factorizations else usual
        while self.report[0] > DOUBTFUL and tried < HIGHEST_THRESHOLD and self.inertia[2] == 0:
            tried = min(100.0 * tried, HIGHEST_THRESHOLD) if tried else THRESHOLD
            self._system.threshold, self._system.careful = tried, 1
            self.refactor()
            self._solve()
        self._system.threshold, self._system.careful = THRESHOLD, 0  # the next matrix may not need it
        self._checked = self.factorizations, tried
        self.last_residual = float(self.report[0])
        return tried > before


_new, _free, _restart, _part = (function(f"kkt_{name}") for name in ("new", "free", "restart", "part"))
_refactor, _attempt, _solve, _solve_both = (
    function(f"kkt_{name}") for name in ("refactor", "attempt", "solve", "solve_both")
)
