"""Factorisations in one call of machine code find what those do that are made step by step."""

from __future__ import annotations

import numpy as np
import pytest
from solver.kkt.dense import DenseKKT
from solver.kkt.kkt_problems import generic
from solver.kkt.motions import motion, system_of

from stc.solver.kkt import MultifrontalKKT
from stc.solver.kkt.contract import Inertia, NotFinite

SYSTEMS = [system_of, lambda pattern: MultifrontalKKT(*pattern.arguments())]


def settled(system, rng):
    """A system that has factorised one matrix again and again, what it is of, and an attempt that has been made."""
    pattern = motion(rng, 40)
    kkt = system(pattern)
    values = generic(rng, pattern)
    for _ in range(9):
        kkt.factorize(*values.arguments())
    call = kkt.attempt_call
    assert call is not None
    assert call() == 0
    return kkt, pattern, values, call


@pytest.mark.parametrize("system", SYSTEMS)
def test_attempts_find_what_factorisations_do(system):
    rng = np.random.default_rng(21)
    pattern = motion(rng, 40)
    kkt = system(pattern)
    judge = DenseKKT(*pattern.arguments())
    values = generic(rng, pattern)
    values.primal += 30.0  # more than what H has of negative curvature
    assert kkt.attempt_call is None  # there is no plan yet
    made = 0
    for number in range(12):
        values.hess *= rng.uniform(0.9, 1.1, values.hess.size)
        values.jac *= rng.uniform(0.9, 1.1, values.jac.size)
        kkt.hess[:], kkt.jac[:], kkt.primal[:], kkt.dual[:] = values.arguments()
        call = kkt.attempt_call
        ended = -1 if call is None else call()
        made += ended == 0
        inertia = (
            kkt.refactor() if ended < 0 else kkt.resume(ended) if ended else Inertia(*kkt.inertia.tolist())
        )
        assert inertia == judge.factorize(*values.arguments()) == (pattern.n, pattern.m, 0)
        assert kkt.factorizations == number + 1
        kkt.rhs[:] = rng.normal(size=kkt.rhs.size)
        kkt.solve_call()
        assert not kkt.check_solution()
        expected = judge.solve(kkt.rhs[: pattern.n], kkt.rhs[pattern.n :])
        np.testing.assert_allclose(kkt.solution, np.concatenate(expected), rtol=1e-7, atol=1e-9)
    assert made >= 5


@pytest.mark.parametrize("system", SYSTEMS)
def test_attempts_refuse_what_is_not_finite(system):
    rng = np.random.default_rng(22)
    kkt, pattern, values, call = settled(system, rng)
    inertia = DenseKKT(*pattern.arguments()).factorize(*values.arguments())
    given = (
        (kkt.hess, values.hess),
        (kkt.jac, values.jac),
        (kkt.primal, values.primal),
        (kkt.dual, values.dual),
    )
    places = [(*both, int(k)) for both in given for k in rng.choice(both[0].size, 8, replace=False)]
    for bad in (np.nan, np.inf):
        for array, own, k in places:
            array[k] = bad
            call = kkt.attempt_call
            assert call is not None
            ended = call()
            assert ended != 0
            with pytest.raises(NotFinite):
                kkt.resume(ended)
            array[k] = own[k]
            assert kkt.refactor() == inertia
            assert kkt.factorizations > 9


@pytest.mark.parametrize("system", SYSTEMS)
def test_solves_follow_a_factorisation_that_had_to_be_repeated(system, monkeypatch):
    """A larger threshold gives other factors: whoever solves then has to use those."""
    rng = np.random.default_rng(23)
    kkt, pattern, values, _ = settled(system, rng)
    judge = DenseKKT(*pattern.arguments())
    for _ in range(2):
        values.jac *= rng.uniform(0.9, 1.1, values.jac.size)
        assert kkt.factorize(*values.arguments()) == judge.factorize(*values.arguments())
        with monkeypatch.context() as patched:
            patched.setattr("stc.solver.kkt.multifrontal.DOUBTFUL", -1.0)
            kkt.rhs[:] = rng.normal(size=kkt.rhs.size)
            kkt.solve_call()
            assert kkt.check_solution()
        for _ in range(2):
            kkt.rhs[:] = rng.normal(size=kkt.rhs.size)
            kkt.solve_call()
            expected = np.concatenate(judge.solve(kkt.rhs[: pattern.n], kkt.rhs[pattern.n :]))
            np.testing.assert_allclose(kkt.solution, expected, rtol=1e-7, atol=1e-9)
