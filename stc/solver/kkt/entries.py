"""The arrays of a KKT system."""

from __future__ import annotations

import numpy as np

from stc.records import dataclass
from stc.solver.kkt.contract import FINE, REPORT, KKTSystem
from stc.solver.kkt.couplings import Couplings
from stc.solver.nlp import Floats

__all__ = ["Arrays"]


@dataclass(frozen=True)
class Arrays:
    """The arrays of a ``KKTSystem``; ``given`` is H, J, p and d one after the other, and further numbers."""

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

    def give_to(self, system: KKTSystem) -> None:
        """Make them those of a system, which takes vectors of its own length."""
        size = self.primal.size + self.dual.size
        system.hess, system.jac, system.primal, system.dual = self.hess, self.jac, self.primal, self.dual
        system.rhs, system.solution = self.rhs[:size], self.solution[:size]
        system.second_rhs, system.second_solution = self.second_rhs[:size], self.second_solution[:size]
        system.report, system.accuracy = self.report, self.accuracy
        system.inertia = np.zeros(3, dtype=np.int64)
        system.last_residual = 0.0
        system._factorized = False
