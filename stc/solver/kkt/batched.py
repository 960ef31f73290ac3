"""The KKT system of a horizon that repeats itself: eight like segments at once, then what is between them.

The method and its code are in ``stc/core/batch.h``.  The seams between segments and irregular stages go through
``MultifrontalKKT``, as does the whole of a matrix that is refused.
"""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
from numpy.typing import NDArray

from stc.arrays import scattered
from stc.codegen.threads import parallel, record
from stc.core.calls import Bound, CallTable
from stc.core.functions import function
from stc.core.structures import structure
from stc.solver.kkt.contract import FINE, Inertia, KKTSystem, check_ended
from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.entries import Arrays
from stc.solver.kkt.multifrontal import DOUBTFUL, MultifrontalKKT
from stc.solver.kkt.seams import kind_of, sew
from stc.solver.kkt.segment_tables import tables_of
from stc.solver.kkt.segments import Segmentation

__all__ = ["BatchedKKT"]

#: Calls that are made by number.
PHASES = ELIMINATE, FORWARD, BACKWARD, RETURN = 0, 1, 2, 3
REST, REST_SOLVE, WHOLE_SOLVE, CALLS = 4, 5, 7, 9


class BatchedKKT(KKTSystem):
    """Sparse LDL^T of segments in vector lanes and of the rest by ``MultifrontalKKT``.

    See ``KKTSystem`` for the members.
    """

    def __init__(self, couplings: Couplings, stage: NDArray[np.int64], found: Segmentation) -> None:
        self.n, self.m = couplings.n, couplings.m
        kinds = [kind_of(found, number, couplings.n) for number in range(len(found.example))]
        sewn = sew(couplings, found, kinds)
        self._couplings, self._stage = couplings, stage
        self._arrays = a = Arrays.of(couplings, sewn.added, (1.0, -1.0))
        a.give_to(self)
        tables, left = tables_of(couplings, found, kinds, sewn, one=a.given.size - 2)
        own = Arrays.of(left.couplings)
        self._rest = MultifrontalKKT.of_couplings(left.couplings, sewn.stage[left.unknowns], own, part=True)
        self._whole: MultifrontalKKT | None = None
        self._trusts_small_pivots = False
        self._calls = CallTable(CALLS)
        size = a.rhs.size
        self._batch: Any = structure("batch")(
            **tables, n=self.n, m=self.m, size=size, hess_count=couplings.hess_count,
            given_count=couplings.hess_count + couplings.jac_count, curved=couplings.hess_variable.size,
            curved_variable=couplings.hess_variable, curved_source=couplings.hess_diagonal.astype(np.int32),
            rest_given=own.given, rest_length=own.given.size, rest_rhs=own.rhs, rest_solution=own.solution,
            rest_second_rhs=own.second_rhs, rest_second_solution=own.second_solution,
            rest_inertia=self._rest.inertia, given=a.given, rhs=a.rhs, second_rhs=a.second_rhs,
            probe=_probe(size), solution=a.solution, second_solution=a.second_solution,
            probed=np.zeros(size), report=a.report, accuracy=a.accuracy, inertia=self.inertia,
            calls=self._calls.cells, fine=FINE,
        )  # fmt: skip
        if _new(self._batch):
            raise MemoryError("there is no memory for a linear system of this size")
        weakref.finalize(self, _free, self._batch).atexit = False
        part = function("batch_part")
        for phase in PHASES:
            calls = [part.bind(self._batch, number, phase) for number in range(len(found.parts))]
            self._calls.put(phase, parallel([calls], record()))
        for place, call in enumerate((self._rest.refactor_call, *self._rest.calls_of_solves)):
            self._calls.put(REST + place, call)
        self._refactor, self._solve, self._solve_both = (
            call.bind(self._batch) for call in (_factorize, _solve, _solve_both)
        )
        self.restart()

    def restart(self) -> None:
        """Forget all matrices, as if new, but not the plan."""
        _restart(self._batch)
        self._rest.restart()
        if self._whole is not None:
            self._whole.restart()
        self._counted = 0
        self._counted_before = self._batch.factorizations
        self.last_residual = 0.0
        self._factorized = False
        self.trust_small_pivots(False)

    def trust_small_pivots(self, trusted: bool) -> None:
        """See ``KKTSystem.trust_small_pivots``."""
        self._trusts_small_pivots = trusted
        self._rest.trust_small_pivots(trusted)
        if self._whole is not None:
            self._whole.trust_small_pivots(trusted)

    @property
    def factorizations(self) -> int:
        """See ``KKTSystem.factorizations``."""
        return self._counted + int(self._batch.factorizations - self._counted_before)

    @property
    def nnz_factor(self) -> int:
        """See ``KKTSystem.nnz_factor``."""
        if not self._factorized:
            return 0
        if self._batch.use:
            assert self._whole is not None
            return self._whole.nnz_factor
        return int(self._batch.entries) + self._rest.nnz_factor

    @property
    def operations(self) -> int:
        """Additions and multiplications of the last factorisation."""
        if self._batch.use:
            return 0 if self._whole is None else self._whole.operations
        return 2 * int(self._batch.operations) + self._rest.operations

    @property
    def factor_bytes(self) -> int:
        """Memory that the last factorisation fills, about."""
        return 8 * self.nnz_factor

    @property
    def nbytes(self) -> int:
        """Memory held, about."""
        own = 8 * _held(self._batch) + 8 * self._arrays.given.size + self._rest.nbytes
        return own + (0 if self._whole is None else self._whole.nbytes)

    @property
    def attempt_call(self) -> Bound | None:
        """See ``KKTSystem.attempt_call``."""
        return self._refactor if self._factorized else None

    def refactor(self) -> Inertia:
        """See ``KKTSystem.refactor``."""
        self._factorized = False
        ended = self._refactor()
        if ended:
            return self.resume(ended)
        self._factorized = True
        return Inertia(*self.inertia.tolist())

    def resume(self, ended: int) -> Inertia:
        """See ``KKTSystem.resume``."""
        self._factorized = False
        check_ended(ended)
        self._counted += 1
        return self._refactor_whole()

    def _refactor_whole(self) -> Inertia:
        if self._whole is None:
            self._whole = MultifrontalKKT.of_couplings(self._couplings, self._stage, self._arrays)
            self._whole.trust_small_pivots(self._trusts_small_pivots)
            for place, call in enumerate(self._whole.calls_of_solves):
                self._calls.put(WHOLE_SOLVE + place, call)
        inertia = self._whole.refactor()
        self._batch.use = 1
        self._factorized = True
        return inertia

    def check_solution(self) -> bool:
        """See ``KKTSystem.check_solution``."""
        repeated = False
        if not self._batch.use and self.report[0] > DOUBTFUL:
            self._counted += 1
            self._refactor_whole()
            self._solve()
            repeated = True
        if self._batch.use:
            assert self._whole is not None
            before = self._whole.factorizations
            repeated = self._whole.check_solution() or repeated
            self._counted += self._whole.factorizations - before
        self.last_residual = float(self.report[0])
        return repeated


def _probe(size: int) -> NDArray[np.float64]:
    """A right-hand side that tells singular matrices.

    Its numbers differ in magnitude: rows that are the same would agree with the same numbers.
    """
    spread = scattered(size)
    return np.copysign(0.5, spread) + 0.5 * spread


_new, _free, _restart, _factorize = (
    function(f"batch_{name}") for name in ("new", "free", "restart", "factorize")
)
_held, _solve, _solve_both = (function(f"batch_{name}") for name in ("held", "solve", "solve_both"))
