"""What a solve leaves to the next one of the same sparsity."""

from __future__ import annotations

import numpy as np
import pytest
from solver.kkt.dense import DenseKKT
from solver.kkt.kkt_problems import STRUCTURES, generic, sparse_diagonals

from stc.solver.kkt import reuse
from stc.solver.kkt.reuse import StructuredKKT


@pytest.fixture(autouse=True)
def nothing_kept():
    reuse.forget()
    yield
    reuse.forget()


def pattern_of(seed: int, frames: int):
    return STRUCTURES["chain"](np.random.default_rng(seed), frames)


def test_the_next_takes_over_plan_and_arrays():
    rng = np.random.default_rng(1)
    pattern = pattern_of(1, 12)
    first = StructuredKKT(*pattern.arguments())
    system = first.system
    first.factorize(*generic(rng, pattern).arguments())
    assert first.factorizations == 1
    del first
    second = StructuredKKT(*pattern.arguments())
    assert second.system is system
    assert (second.factorizations, second.nnz_factor, second.last_residual) == (0, 0, 0.0)
    with pytest.raises(ValueError, match="factorize before"):
        second.solve(np.zeros(pattern.n), np.zeros(pattern.m))
    judge = DenseKKT(*pattern.arguments())
    for kind in (generic, sparse_diagonals) * 3:
        values = kind(rng, pattern)
        rhs = rng.normal(size=pattern.n), rng.normal(size=pattern.m)
        assert second.factorize(*values.arguments()) == judge.factorize(*values.arguments())
        for found, expected in zip(second.solve(*rhs), judge.solve(*rhs), strict=True):
            np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())
        assert second.last_residual < 1e-12


def test_two_at_once_share_nothing():
    pattern = pattern_of(2, 5)
    first, second = StructuredKKT(*pattern.arguments()), StructuredKKT(*pattern.arguments())
    assert first.system is not second.system


def test_other_patterns_and_stages_are_others():
    pattern = pattern_of(3, 8)
    arguments = list(pattern.arguments())
    system = StructuredKKT(*arguments).system
    arguments[-1] = arguments[-1] + 1
    assert StructuredKKT(*arguments).system is not system


def test_little_is_kept(monkeypatch):
    patterns = [pattern_of(4, frames) for frames in range(3, 10)]
    for pattern in patterns:
        StructuredKKT(*pattern.arguments())
    assert len(reuse._kept) == reuse.KEPT
    newest = StructuredKKT(*patterns[-1].arguments())
    assert len(reuse._kept) == reuse.KEPT - 1
    monkeypatch.setattr(reuse, "KEPT_BYTES", newest.system.nbytes - 1)
    del newest
    assert not reuse._kept
