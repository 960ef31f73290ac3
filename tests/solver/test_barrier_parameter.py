"""When the free choice of the barrier parameter gives way to a held one."""

from __future__ import annotations

import numpy as np
import pytest

from stc.core.calls import Bound, CallTable
from stc.solver import barrier_update, state
from stc.solver.filter import Filter

GAPS = 10


class Barrier:
    """The parameter's numbers by themselves; every iterate counts as progress."""

    def __init__(self, mu: float) -> None:
        self.s = s = np.zeros(state.NUMBERS)
        s[[state.ADAPTIVE, state.FREE]] = 1.0
        s[state.MU] = mu
        s[state.LARGEST_MU] = np.inf
        s[state.SMALLEST_MU] = 1e-11
        self.accepted = Filter(np.inf)
        self.calls = CallTable(state.MEASURE + 1)
        self.calls.put(state.MEASURE, Bound.of_python(lambda: 0, ()))  # errors are as they are said to be

    def iterate(self, mu: float, error: float) -> bool:
        """Measure an iterate with that error, after a step with that parameter; whether the choice is still free."""
        s = self.s
        s[state.MU], s[state.ERROR], s[state.PRODUCTS] = mu, error, GAPS * mu
        s[state.OBJECTIVE] -= 1.0
        barrier_update.update(self.calls.cells, GAPS, np.zeros(1), self.accepted.array, s)
        return bool(s[state.FREE])


@pytest.mark.parametrize(
    ("mu", "error"),
    [
        (1e-6, 2e-2),  # the parameter has gone down by far
        (6e-5, 5e-3),  # the error has not gone up by far
    ],
)
def test_other_steps_do_not(mu: float, error: float) -> None:
    barrier = Barrier(1e-4)
    for factor in (1.0, 1e-1, 1e-2, 1e-3):
        assert barrier.iterate(factor * 1e-4, factor * 1e-3)
        assert barrier.iterate(factor * mu, factor * error)
        assert barrier.iterate(factor * mu, factor * 1e-3)
