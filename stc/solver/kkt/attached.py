"""The attached interface for factorisations that only take copies."""

from __future__ import annotations

from typing import cast

import numpy as np

from stc.core.calls import Bound
from stc.solver.kkt.contract import FINE, AttachedKKT, Inertia, KKTSystem
from stc.solver.kkt.reuse import StructuredKKT
from stc.solver.nlp import Floats

__all__ = ["attached"]


def attached(kkt: KKTSystem, n: int, m: int, jac_count: int, hess_count: int) -> AttachedKKT:
    """``kkt`` itself where it has arrays of its own, or what it stands for, else a wrapper that copies."""
    if isinstance(kkt, StructuredKKT):
        return kkt.system
    if hasattr(kkt, "refactor"):
        return cast("AttachedKKT", kkt)
    return _Copying(kkt, n, m, jac_count, hess_count)


class _Copying:
    """See ``AttachedKKT``."""

    def __init__(self, kkt: KKTSystem, n: int, m: int, jac_count: int, hess_count: int) -> None:
        self._kkt, self._n = kkt, n
        self.hess, self.jac = np.zeros(hess_count), np.zeros(jac_count)
        self.primal, self.dual = np.zeros(n), np.zeros(m)
        self.rhs, self.solution = np.zeros(n + m), np.zeros(n + m)
        self.second_rhs, self.second_solution = np.zeros(n + m), np.zeros(n + m)
        self.report, self.accuracy = np.zeros(1), np.full(1, FINE)
        self.inertia = np.zeros(3, dtype=np.int64)
        self.solve_call = Bound.of_python(self._solve, ())
        self.solve_both_call = Bound.of_python(self._solve_both, ())

    @property
    def factorizations(self) -> int:
        return self._kkt.factorizations

    @property
    def nnz_factor(self) -> int:
        return self._kkt.nnz_factor

    @property
    def last_residual(self) -> float:
        return self._kkt.last_residual

    def trust_small_pivots(self, trusted: bool) -> None: ...

    def factorize(
        self, hess_values: Floats, jac_values: Floats, primal_diagonal: Floats, dual_diagonal: Floats
    ) -> Inertia:
        return self._kkt.factorize(hess_values, jac_values, primal_diagonal, dual_diagonal)

    def solve(self, rhs_x: Floats, rhs_y: Floats) -> tuple[Floats, Floats]:
        return self._kkt.solve(rhs_x, rhs_y)

    @property
    def attempt_call(self) -> None:
        return None

    def resume(self, ended: int) -> Inertia:
        return self.refactor()

    def refactor(self) -> Inertia:
        return self._kkt.factorize(self.hess, self.jac, self.primal, self.dual)

    def _solve(self) -> None:
        self._solve_for(self.rhs, self.solution)

    def _solve_for(self, rhs: Floats, solution: Floats) -> None:
        n = self._n
        solution[:n], solution[n:] = self._kkt.solve(rhs[:n], rhs[n:])
        self.report[0] = self._kkt.last_residual

    def _solve_both(self) -> None:
        self._solve_for(self.second_rhs, self.second_solution)
        before = self._kkt.last_residual
        self._solve_for(self.rhs, self.solution)
        self.report[0] = max(before, self.report[0])

    def check_solution(self) -> bool:
        return False  # the wrapped one has done so
