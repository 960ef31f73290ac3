"""The arrays that come into a KKT system, checked, and its calls that copy them."""

from __future__ import annotations

import numpy as np

from stc.core.calls import Bound
from stc.records import dataclass
from stc.solver.kkt.contract import FINE, REPORT, AttachedKKT, Inertia
from stc.solver.kkt.couplings import Couplings
from stc.solver.nlp import Floats

__all__ = ["Arrays", "ByCopies", "checked_values"]


@dataclass(frozen=True)
class Arrays:
    """The arrays of an ``AttachedKKT``; ``given`` is H, J, p and d one after the other, and further numbers."""

    given: Floats
    hess: Floats
    jac: Floats
    primal: Floats
    dual: Floats
    rhs: Floats
    solution: Floats
    second_rhs: Floats
    second_solution: Floats
    report: Floats
    accuracy: Floats

    @staticmethod
    def of(couplings: Couplings, unknowns: int = 0, numbers: tuple[float, ...] = ()) -> Arrays:
        """New ones for a pattern, vectors with so many further unknowns, and with further numbers."""
        sizes = couplings.hess_count, couplings.jac_count, couplings.n, couplings.m
        given = np.concatenate([np.zeros(sum(sizes)), numbers])
        hess, jac, primal, dual, _ = np.split(given, np.cumsum(sizes))
        size = couplings.size + unknowns
        rhs, solution, second_rhs, second_solution = (np.zeros(size) for _ in range(4))
        return Arrays(
            given, hess, jac, primal, dual, rhs, solution, second_rhs, second_solution, np.zeros(REPORT),
            np.full(1, FINE),
        )  # fmt: skip


def checked_values(*arrays: tuple[Floats, int, str]) -> list[Floats]:
    """Contiguous float64 forms of ``(array, size, name)``, without a copy where they already are.

    Raises:
        ValueError: an array does not have its size.
    """
    checked = []
    for array, size, name in arrays:
        if not (isinstance(array, np.ndarray) and array.dtype == np.float64 and array.flags.c_contiguous):
            array = np.ascontiguousarray(array, dtype=np.float64)
        if array.shape != (size,):
            raise ValueError(f"{name} has shape {array.shape}, expected ({size},)")
        checked.append(array)
    return checked


class ByCopies:
    """The calls of a ``KKTSystem`` for a system with arrays of its own: ``factorize`` and ``solve`` copy."""

    _factorized: bool
    _solve: Bound
    _solve_both: Bound

    @property
    def solve_call(self) -> Bound:
        """See ``AttachedKKT.solve_call``."""
        if not self._factorized:
            raise ValueError("factorize before solving")
        return self._solve

    @property
    def solve_both_call(self) -> Bound:
        """See ``AttachedKKT.solve_both_call``."""
        if not self._factorized:
            raise ValueError("factorize before solving")
        return self._solve_both

    def factorize(
        self: AttachedKKT,
        hess_values: Floats,
        jac_values: Floats,
        primal_diagonal: Floats,
        dual_diagonal: Floats,
    ) -> Inertia:
        """See ``KKTSystem.factorize``."""
        own = self.hess, self.jac, self.primal, self.dual
        names = "hess_values", "jac_values", "primal_diagonal", "dual_diagonal"
        given = hess_values, jac_values, primal_diagonal, dual_diagonal
        checked = checked_values(
            *((array, mine.size, name) for array, mine, name in zip(given, own, names, strict=True))
        )
        for mine, array in zip(own, checked, strict=True):
            mine[:] = array
        return self.refactor()

    def solve(self: AttachedKKT, rhs_x: Floats, rhs_y: Floats) -> tuple[Floats, Floats]:
        """See ``KKTSystem.solve``."""
        call = self.solve_call
        n = self.primal.size
        rhs_x, rhs_y = checked_values((rhs_x, n, "rhs_x"), (rhs_y, self.dual.size, "rhs_y"))
        self.rhs[:n] = rhs_x
        self.rhs[n:] = rhs_y
        call()
        self.check_solution()
        return self.solution[:n].copy(), self.solution[n:].copy()
