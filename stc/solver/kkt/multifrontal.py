"""The KKT system factorised by the core (``stc/core/kkt.h``): a multifrontal LDL^T with threshold pivoting."""

from __future__ import annotations

import ctypes
import functools
import weakref

import numpy as np
from numpy.typing import NDArray

from stc.arrays import ranks
from stc.core import library as core
from stc.core.calls import Bound
from stc.solver.kkt.contract import Inertia, KKTSystem, check_ended
from stc.solver.kkt.couplings import Couplings
from stc.solver.kkt.entries import Arrays
from stc.solver.nlp import Ints

__all__ = ["DOUBTFUL", "MultifrontalKKT"]

#: Where a solve leaves a larger relative residual than DOUBTFUL, the matrix is factorised again with larger pivot
#: thresholds, up to the highest.
DOUBTFUL = 1e-9
THRESHOLD, HIGHEST_THRESHOLD = 1e-4, 0.3
#: Where small pivots are trusted, those that exceed the noise in them so many times are not zero.
CERTAIN, NEVER = 1e3, 1e300
#: A matrix that comes scaled, as part of another one, is scaled anew where its largest entries are so far from 1.
STALE_OF_PART = 64.0


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
        couplings = Couplings.of(n, m, jac_rows, jac_cols, hess_rows, hess_cols)
        stage = np.concatenate([np.asarray(given).astype(np.int64) for given in (var_stage, row_stage)])
        self._prepare(couplings, stage, Arrays.of(couplings), part=False)

    @classmethod
    def of_couplings(
        cls, couplings: Couplings, stage: NDArray[np.int64], arrays: Arrays, *, part: bool = False
    ) -> MultifrontalKKT:
        """For a pattern that is known already.

        Args:
            stage: elimination group of each unknown, (N,).
            arrays: those it works with.
            part: whether the matrix is what the elimination of others has left, scaled: its entries of H may couple
                rows, and solutions are refined by whoever eliminated the others.
        """
        system = cls.__new__(cls)
        system._prepare(couplings, stage, arrays, part=part)
        return system

    def _prepare(self, couplings: Couplings, stage: NDArray[np.int64], arrays: Arrays, *, part: bool) -> None:
        self.n, self.m = n, m = couplings.n, couplings.m
        hess = np.empty((2, couplings.hess_count), dtype=np.int32)
        off = couplings.hess_off
        hess[0, off], hess[1, off] = couplings.first[: off.size], couplings.second[: off.size]
        hess[:, couplings.hess_diagonal] = couplings.hess_variable
        integers = [
            np.ascontiguousarray(numbers, dtype=np.int32)
            for numbers in (
                *hess, couplings.first[off.size :] - n, couplings.second[off.size :],
                ranks(stage)[0] if stage.size else stage,
            )
        ]  # fmt: skip
        arrays.give_to(self)
        self._counted_before = 0
        lib = core.library()
        pattern = core.Pattern(
            n, m, self.hess.size, self.jac.size, *(numbers.ctypes.data for numbers in integers)
        )
        places = core.Arrays(
            *(
                array.ctypes.data
                for array in (
                    self.hess, self.jac, self.primal, self.dual, self.rhs, self.second_rhs, self.solution,
                    self.second_solution, self.report, self.accuracy, self.inertia,
                )
            )
        )  # fmt: skip
        system = lib.kkt_new(ctypes.byref(pattern), ctypes.byref(places))
        if not system:
            raise MemoryError("there is no memory for a linear system of this size")
        weakref.finalize(self, lib.kkt_free, system).atexit = False
        self._forget = functools.partial(lib.kkt_restart, system)
        self._options = lib.kkt_options_of(system).contents
        if part:
            self._options.refinements, self._options.stale = 0, STALE_OF_PART
        self._facts = lib.kkt_facts_of(system).contents
        self._refactor, self._attempt, self._solve, self._solve_both = (
            Bound.of_native(function, [system], self)
            for function in (lib.kkt_refactor, lib.kkt_attempt, lib.kkt_solve, lib.kkt_solve_both)
        )
        self.restart()

    def restart(self) -> None:
        """Forget all matrices, as if new, but not the plan."""
        self._forget()
        self._counted_before = self._facts.factorizations
        self._options.threshold, self._options.certain = THRESHOLD, NEVER
        #: The count of factorisations at the last check, and the threshold that this matrix has been tried with.
        self._careful = 0, THRESHOLD
        self.last_residual = 0.0
        self._factorized = False

    def trust_small_pivots(self, trusted: bool) -> None:
        """See ``KKTSystem.trust_small_pivots``."""
        self._options.certain = CERTAIN if trusted else NEVER

    @property
    def factorizations(self) -> int:
        """See ``KKTSystem.factorizations``."""
        return int(self._facts.factorizations - self._counted_before)

    @property
    def nnz_factor(self) -> int:
        """See ``KKTSystem.nnz_factor``."""
        return int(self._facts.entries) if self._factorized else 0

    @property
    def operations(self) -> int:
        """Additions and multiplications of the last factorisation."""
        return 2 * int(self._facts.operations)

    @property
    def factor_bytes(self) -> int:
        """Memory that the last factorisation fills, about."""
        return 8 * int(self._facts.entries)

    @property
    def nbytes(self) -> int:
        """Memory held, about."""
        return 12 * int(self._facts.entries) + 40 * (self.hess.size + self.jac.size) + 120 * self.rhs.size

    @property
    def calls_of_solves(self) -> tuple[Bound, Bound]:
        """``solve_call`` and ``solve_both_call``, which may be asked for before there are factors."""
        return self._solve, self._solve_both

    @property
    def refactor_call(self) -> Bound:
        """The call that factorises; its result is what ``resume`` takes, or 0."""
        return self._refactor

    @property
    def attempt_call(self) -> Bound | None:
        """See ``KKTSystem.attempt_call``."""
        return self._attempt if self._factorized else None

    def refactor(self) -> Inertia:
        """See ``KKTSystem.refactor``."""
        self._factorized = False
        return self.resume(self._refactor())

    def resume(self, ended: int) -> Inertia:
        """See ``KKTSystem.resume``."""
        self._factorized = False
        check_ended(ended)
        self._factorized = True
        return Inertia(*self.inertia.tolist())

    def check_solution(self) -> bool:
        """See ``KKTSystem.check_solution``."""
        made, reached = self._careful
        before = threshold = reached if made == self.factorizations else THRESHOLD
        while self.report[0] > DOUBTFUL and threshold < HIGHEST_THRESHOLD and self.inertia[2] == 0:
            threshold = min(100.0 * threshold, HIGHEST_THRESHOLD)
            self._options.threshold = threshold
            self.refactor()
            self._solve()
        self._options.threshold = THRESHOLD  # the next matrix may not need it
        self._careful = self.factorizations, threshold
        self.last_residual = float(self.report[0])
        return threshold > before
