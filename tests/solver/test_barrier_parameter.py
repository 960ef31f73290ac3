"""When the free choice of the barrier parameter gives way to a held one."""

from __future__ import annotations

import numpy as np
import pytest

from stc.core.functions import function
from stc.core.structures import structure
from stc.solver.workspace import Filter

GAPS = 10


class Barrier:
    """The parameter's numbers by themselves; every iterate counts as progress."""

    def __init__(self, mu: float) -> None:
        self.accepted = Filter(np.inf)
        self.now = structure("iterate")()
        self.s = structure("iteration")(
            form=structure("formulation")(gaps=GAPS), now=self.now, accepted=self.accepted.structure,
            adaptive=True, free=True, mu=mu, largest_mu=np.inf, smallest_mu=1e-11,
        )  # fmt: skip

    def iterate(self, mu: float, error: float) -> bool:
        """Measure an iterate with that error, after a step with that parameter; whether the choice is still free."""
        s = self.s
        s.mu, s.error, s.products = mu, error, GAPS * mu
        self.now.f -= 1.0
        function("barrier_update_update")(s)
        return bool(s.free)


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
