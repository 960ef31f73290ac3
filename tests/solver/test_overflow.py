"""A matrix with entries that are not finite ends an attempt, never the program."""

from __future__ import annotations

import numpy as np
import pytest
from solver.kkt.dense import DenseKKT
from symbolic_program import SymbolicProgram

from stc.solver import Options
from stc.solver.kkt import MultifrontalKKT
from stc.solver.kkt.contract import Inertia, NotFinite
from stc.solver.newton_system import NewtonSystem, SingularSystem
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.workspace import Workspace


@pytest.mark.parametrize("kind", [MultifrontalKKT, DenseKKT])
@pytest.mark.parametrize("value", [np.inf, np.nan])
def test_factorisations_say_so(kind: type, value: float) -> None:
    one = np.zeros(1, np.int32)
    kkt = kind(1, 1, one, one, one, one, one, one)
    with pytest.raises(NotFinite):
        kkt.factorize(np.array([value]), np.ones(1), np.zeros(1), np.zeros(1))


class Overflowing(DenseKKT):
    """Stands for a linear system whose values have overflowed."""

    def refactor(self) -> Inertia:
        raise NotFinite("not finite")


def test_a_newton_system_counts_as_singular() -> None:
    nlp = SymbolicProgram([0.5], lambda x: x[0] ** 2, lambda x: [(x[0] + 1.0, 2.0, 2.0)])
    form = ScaledProblem(nlp, nlp.x0, Options(), Overflowing)
    with pytest.raises(SingularSystem):
        NewtonSystem(Workspace(form)).factorize(0.1)
