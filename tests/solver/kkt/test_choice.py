"""Wide stages are for a tree of fronts, which may ignore them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from solver.kkt.kkt_problems import Builder, Pattern, generic
from solver.kkt.test_contract import check

from stc.solver.kkt.reuse import new_system


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
    assert kkt.segments == 0
    check(kkt, pattern, generic(rng, pattern), rng)


def masses(rng: np.random.Generator, count: int, frames: int) -> Pattern:
    """Positions and velocities of masses in a row, each on springs to the next ones."""
    b = Builder(rng)
    q, v = ([b.variables(count, i) for i in range(frames)] for _ in range(2))
    for i in range(frames):
        for k in range(count):
            b.curvature([q[i][k], v[i][k]], 1.0)
            if i + 1 < frames:
                b.row(i, [q[i][k], v[i][k], q[i + 1][k], v[i + 1][k]])
                near = slice(max(k - 1, 0), k + 2)
                b.row(i, [v[i][k], v[i + 1][k], *q[i][near], *q[i + 1][near]])
    return b.pattern()


def bodies(rng: np.random.Generator, count: int, frames: int) -> Pattern:
    """States of bodies in a row, each with a control, that depend on their neighbours a step before."""
    b = Builder(rng)
    x = [[b.variables(3, i) for _ in range(count)] for i in range(frames)]
    for i in range(frames):
        for k in range(count):
            b.curvature(x[i][k], 1.0)
            near = [one for body in x[i][max(k - 1, 0) : k + 2] for one in body]
            for state in range(2 if i + 1 < frames else 0):
                b.row(i, [*near, x[i + 1][k][state]])
    return b.pattern()


@pytest.mark.parametrize(("many", "ignored"), [(masses, True), (bodies, False)])
def test_wide_sparse_stages_are_ignored_where_that_takes_fewer_operations(
    many: Callable[[np.random.Generator, int, int], Pattern], ignored: bool
) -> None:
    rng = np.random.default_rng(9)
    pattern = many(rng, 20, 12)
    values = generic(rng, pattern)
    values.dual[:] = 0.0  # equations have nothing on the diagonal, and need variables beside them
    arguments = pattern.arguments()
    kkt = new_system(*arguments, np.zeros(pattern.n, dtype=bool))
    without = new_system(
        *arguments[:6], *(0 * stage for stage in arguments[6:]), np.zeros(pattern.n, dtype=bool)
    )
    without.factorize(*values.arguments())
    check(kkt, pattern, values, rng)
    if ignored:
        assert kkt.operations == without.operations
    else:
        assert 1.5 * kkt.operations < without.operations
