"""Wide stages are for a tree of fronts."""

from __future__ import annotations

import numpy as np
from solver.kkt.kkt_problems import Builder, Pattern, generic
from solver.kkt.test_contract import check

from stc.solver.kkt.choice import new_system
from stc.solver.kkt.multifrontal import MultifrontalKKT


def irregular(rng: np.random.Generator, frames: int, width: int) -> Pattern:
    """Frames that couple with the one before, each in its own way, so that nothing repeats."""
    b = Builder(rng)
    x = [b.variables(width, i) for i in range(frames)]
    for i in range(frames):
        b.curvature(x[i], 0.2)
        for _ in range(width // 2):
            near = [*x[i], *(x[i - 1] if i else [])]
            b.row(i, list(rng.choice(near, size=4, replace=False)))
    return b.pattern()


def test_wide_stages():
    rng = np.random.default_rng(8)
    pattern = irregular(rng, 6, 60)
    kkt = new_system(*pattern.arguments(), np.zeros(pattern.n, dtype=bool))
    assert isinstance(kkt, MultifrontalKKT)
    check(kkt, pattern, generic(rng, pattern), rng)
