"""Segments in two parts, which two threads can share: against dense algebra, and the same bits on one thread."""

from __future__ import annotations

import numpy as np
import pytest
from solver.kkt.kkt_problems import VALUES, generic
from solver.kkt.motions import motion, parts, system_of
from solver.kkt.test_contract import check

from stc.codegen import threads
from stc.solver.kkt.multifrontal import MultifrontalKKT


def _plain(rng, pattern):
    """Values of a convex problem with independent constraints."""
    values = generic(rng, pattern)
    values.hess = np.abs(values.hess) * (pattern.hess_rows == pattern.hess_cols)
    values.primal[:] = 1.0
    values.dual[:] = 0.0
    return values


@pytest.mark.parametrize("values_of", VALUES.values(), ids=VALUES)
def test_two_parts_against_dense_algebra(two_threads, values_of):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        pattern = motion(rng, 45, parameters=seed, waypoint=seed == 2)
        couplings, stage, found = parts(pattern, shared=True)
        assert found is not None
        assert len(found.parts) == 2
        kkt = MultifrontalKKT.of_couplings(couplings, stage, found)
        for _ in range(2):
            check(kkt, pattern, values_of(rng, pattern), rng)


def test_the_same_bits_on_one_thread(two_threads):
    """Whether a second thread takes a part is seen in no digit of inertia and solutions."""
    rng = np.random.default_rng(30)
    pattern = motion(rng, 120, parameters=1)
    values = [_plain(rng, pattern) for _ in range(6)]
    rhs = rng.normal(size=(6, 2, pattern.n + pattern.m))
    seen = []
    for limit in (2, 1):
        threads.limit(limit)
        kkt = system_of(pattern, shared=True)
        results = []
        for own, (one, other) in zip(values, rhs, strict=True):
            inertia = kkt.factorize(*own.arguments())
            kkt.rhs[:], kkt.second_rhs[:] = one, other
            kkt.solve_both_call()
            both = kkt.solution.tobytes(), kkt.second_solution.tobytes()
            kkt.solve_call()
            results.append((inertia, *both, kkt.solution.tobytes()))
        seen.append(results)
    assert seen[0] == seen[1]


def test_parts_are_of_about_the_same_size():
    rng = np.random.default_rng(31)
    for frames in (300, 1000, 3000):
        _, _, found = parts(motion(rng, frames), shared=True)
        assert found is not None
        first, second = found.parts
        assert first + second == len(found.groups)
        steps = [len(group.stages) for group in found.groups]
        assert 0.8 < sum(steps[:first]) / sum(steps[first:]) < 1.25


def test_little_work_is_not_shared():
    """Nor are short horizons cut into more segments for that."""
    rng = np.random.default_rng(32)
    _, _, found = parts(motion(rng, 300))
    assert found is not None
    assert found.parts == (1,)
    _, _, found = parts(motion(rng, 6000))
    assert found is not None
    assert found.parts == (1, 1)


@pytest.mark.parametrize("part", [0, 1])
def test_a_pivot_that_one_part_refuses(two_threads, part):
    """The whole matrix is factorised another way then, and those after it part by part again."""
    rng = np.random.default_rng(33)
    pattern = motion(rng, 45)
    couplings, stage, found = parts(pattern, shared=True)
    assert found is not None
    kkt = MultifrontalKKT.of_couplings(couplings, stage, found)
    values = _plain(rng, pattern)
    check(kkt, pattern, values, rng)
    first, _ = found.parts
    group = found.groups[0 if part == 0 else first]
    frame = int(group.stages[1, 0])
    own = np.flatnonzero(pattern.row_stage == frame)[:2]
    jac = values.jac.copy()
    values.jac[np.isin(pattern.jac_rows, own)] = 0.0  # rows of nothing
    inertia = kkt.factorize(*values.arguments())
    assert inertia.zero == 2
    values.jac[:] = jac
    check(kkt, pattern, values, rng)
