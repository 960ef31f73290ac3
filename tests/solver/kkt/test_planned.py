"""Pivots planned before, in segments or in a chain: against dense algebra, whatever the values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from solver.kkt.kkt_problems import VALUES, generic
from solver.kkt.motions import chain_of, motion, parts, system_of
from solver.kkt.test_contract import check

from stc.solver.kkt import planned
from stc.solver.kkt.lane_state import DISTANCE, FETCHED, RARELY, STREAMED, TRUSTED

SYSTEMS = pytest.mark.parametrize("system", [system_of, chain_of])


@pytest.mark.parametrize("parameters", [0, 2])
@pytest.mark.parametrize(("frames", "waypoint"), [(16, False), (16, True), (33, True)])
@pytest.mark.parametrize("values_of", VALUES.values(), ids=VALUES)
@SYSTEMS
def test_against_eigenvalues(system, values_of, frames, parameters, waypoint):
    rng = np.random.default_rng(frames + parameters)
    pattern = motion(rng, frames, parameters=parameters, waypoint=waypoint)
    kkt = system(pattern)
    for _ in range(2):
        check(kkt, pattern, values_of(rng, pattern), rng)


@SYSTEMS
@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    frames=st.integers(16, 30),
    softness=st.sampled_from([0.0, 1e-14, 1e-9, 1e-4, 1.0]),
    curvature=st.sampled_from([-1.0, 0.0, 1.0]),
)
def test_any_values(system, seed, frames, softness, curvature):
    """Rows without softness and with hardly any; convex, flat and concave."""
    rng = np.random.default_rng(seed)
    pattern = motion(rng, frames, parameters=seed % 2, waypoint=seed % 3 == 0)
    if system is system_of and parts(pattern)[2] is None:
        return
    values = generic(rng, pattern)
    values.dual = softness * rng.uniform(0.5, 2.0, pattern.m)
    values.primal = np.maximum(curvature, 0.0) * rng.uniform(0.5, 2.0, pattern.n)
    values.hess = np.where(
        rng.random(values.hess.size) < 0.3, 0.0, curvature * values.hess + 0.1 * values.hess**2
    )
    with np.errstate(divide="ignore"):  # the condition of singular ones
        check(system(pattern), pattern, values, rng)


@SYSTEMS
@pytest.mark.parametrize("parameters", [0, 2])
def test_memory_that_is_asked_for_changes_nothing(system, parameters, monkeypatch):
    """Factors that are written to distant memory are the same, and so is what is solved with them."""
    rng = np.random.default_rng(31)
    pattern = motion(rng, 40, parameters=parameters)
    values, rhs = generic(rng, pattern), (rng.normal(size=pattern.n), rng.normal(size=pattern.m))
    solutions = []
    for near in (2**40, 0):
        monkeypatch.setattr(planned, "NEAR", near)
        monkeypatch.setattr(planned, "DISTANT", near)
        monkeypatch.setattr(planned, "FAR", near)
        kkt = system(pattern)
        for _ in range(2):
            kkt.factorize(*values.arguments())
        assert kkt._by_plan
        assert (kkt._plans.now.state[DISTANCE] > 0) == (near == 0)
        assert (kkt._plans.now.state[STREAMED] > 0) == (near == 0)
        assert (kkt._plans.now.state[FETCHED] > 0) == (near == 0)
        solutions.append(np.concatenate(kkt.solve(*rhs)))
    np.testing.assert_array_equal(*solutions)


@SYSTEMS
def test_doubtful_solves_fall_back(system, monkeypatch):
    rng = np.random.default_rng(8)
    pattern = motion(rng, 30)
    kkt = system(pattern)
    values = generic(rng, pattern)
    rhs = rng.normal(size=pattern.n), rng.normal(size=pattern.m)
    kkt.factorize(*values.arguments())
    expected = kkt.solve(*rhs)
    assert kkt.factorizations == 1
    kkt._plans.now.state[TRUSTED] = 1.0
    monkeypatch.setattr(planned, "DOUBTFUL", -1.0)
    found = kkt.solve(*rhs)
    assert kkt.factorizations == 2
    assert kkt._plans.now.state[TRUSTED] == planned.SUSPECT
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-8 * np.abs(other).max())


@pytest.mark.parametrize("factor", [1e-6, 1e8])
@SYSTEMS
def test_scales_that_have_served_their_time(system, factor):
    """Where all was well they are tested with one matrix in so many."""
    rng = np.random.default_rng(13)
    pattern = motion(rng, 40)
    kkt = system(pattern)
    values = generic(rng, pattern)
    check(kkt, pattern, values, rng)
    before = kkt._scale.copy()
    size = np.where(np.arange(pattern.n) % 5 == 1, factor, 1.0)
    values.jac = values.jac * size[pattern.jac_cols]
    values.hess = values.hess * size[pattern.hess_rows] * size[pattern.hess_cols]
    values.primal = values.primal * size**2
    for _ in range(int(RARELY) + 1):
        check(kkt, pattern, values, rng)
    assert np.abs(np.log(kkt._scale / before)).max() > 5.0
