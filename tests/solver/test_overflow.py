"""A matrix with entries that are not finite ends an attempt, never the program."""

from __future__ import annotations

import numpy as np
import pytest

from stc.solver.kkt import FrontalKKT
from stc.solver.kkt.contract import NotFinite
from stc.solver.kkt.dense import DenseKKT
from stc.solver.newton_system import NewtonSystem, SingularSystem


@pytest.mark.parametrize("kind", [FrontalKKT, DenseKKT])
@pytest.mark.parametrize("value", [np.inf, np.nan])
def test_factorisations_say_so(kind: type, value: float) -> None:
    one = np.zeros(1, np.int32)
    kkt = kind(1, 1, one, one, one, one, one, one)
    with pytest.raises(NotFinite):
        kkt.factorize(np.array([value]), np.ones(1), np.zeros(1), np.zeros(1))


class Overflowing:
    """Stands for a linear system whose values have overflowed."""

    def factorize(self, *values: np.ndarray) -> None:
        raise NotFinite("not finite")


def test_a_newton_system_counts_as_singular() -> None:
    class Form:
        n = m = 1
        gaps = 0
        size = 2
        equality = np.array([True])
        held = np.array([False])
        free = ~held
        any_held = any_ignored = False
        extra_diagonal = None
        index = np.zeros(0, int)
        kkt = Overflowing()

    class Point:
        z = gap = np.zeros(0)
        jac = hess = np.ones(1)

    with pytest.raises(SingularSystem):
        NewtonSystem(Form()).factorize(Point(), 0.1)
