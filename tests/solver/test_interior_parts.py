"""The pieces of the barrier iteration against dense references."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scaled_program import dense, errors_of, evaluate, inside, program, scaled
from solver.kkt.dense import DenseKKT
from symbolic_program import INF, SymbolicProgram

from stc.solver import Options
from stc.solver.curvature import largest_step
from stc.solver.elastic import ElasticProblem
from stc.solver.kkt.contract import Inertia
from stc.solver.newton_system import NewtonSystem
from stc.solver.projection import Projection
from stc.solver.residuals import assess
from stc.solver.scaled_problem import ScaledProblem, relative_violation
from stc.solver.starting import cold_iterate, warm_iterate
from stc.solver.workspace import Filter, Workspace


@given(st.integers(0, 1000))
def test_the_reduced_system_solves_the_full_one(seed: int) -> None:
    """Newton's step on all the optimality conditions of the barrier problem, nothing eliminated."""
    form = scaled(scaling=False)
    it = inside(form, seed)
    n, m, size, mu = form.n, form.m, form.size, 0.1
    work = Workspace(form)
    work.load(it)
    system = NewtonSystem(work)
    system.factorize(mu)
    work.s.mu = mu
    work.run("step_newton")
    dw, dy, dz = work.step.dw, work.step.dy, work.step.dz

    hess = dense(form.hess_rows, form.hess_cols, it.hess, (n, n))
    hess = hess + np.tril(hess, -1).T + system.shift * np.diag(form.free)
    jac = dense(form.jac_rows, form.jac_cols, it.jac, (m, n))
    # gradient of the Lagrangian in (x, s); rows; complementarity, linearised at the iterate
    pull = np.zeros((size, form.gaps))
    pull[form.index, np.arange(form.gaps)] = form.sign
    stationarity = it.dual - pull @ it.z
    stationarity[:n] += hess @ dw[:n] + jac.T @ dy
    stationarity[n:] -= dy
    stationarity -= pull @ dz
    assert stationarity[form.moving] == pytest.approx(0.0, abs=1e-8)
    live = ~form.ignored
    assert (it.c + jac @ dw[:n] - dw[n:])[live] == pytest.approx(0.0, abs=1e-8)
    assert it.gap * it.z + it.z * (pull.T @ dw) + it.gap * dz == pytest.approx(
        np.full(form.gaps, mu), abs=1e-8
    )
    assert not dw[~form.moving].any()


@given(st.integers(0, 1000))
def test_the_shifted_matrix_gives_descent(seed: int) -> None:
    """With the inertia right, the step is a descent direction on the linearised rows."""
    form = scaled()
    it = inside(form, seed)
    it.y = it.y * 10.0 - 20.0  # makes the Hessian indefinite
    it = evaluate(form, it.w, np.where(form.ignored, 0.0, it.y), it.z)
    work = Workspace(form)
    work.load(it)
    system = NewtonSystem(work)
    system.factorize(0.1)
    n, m = form.n, form.m
    hess = dense(form.hess_rows, form.hess_cols, work.kkt.hess, (n, n))
    sigma = np.zeros(form.size)
    np.add.at(sigma, form.index, it.z / it.gap)
    hess = hess + np.tril(hess, -1).T + np.diag(sigma[:n] + system.shift)
    jac = dense(form.jac_rows, form.jac_cols, it.jac, (m, n))
    stiff = hess + jac.T @ np.diag(np.where(form.inequality, sigma[n:], 0.0)) @ jac
    free = np.flatnonzero(form.free)
    equality = jac[form.equality][:, free]
    null = np.linalg.svd(equality)[2][equality.shape[0] :].T
    assert np.linalg.eigvalsh(null.T @ stiff[np.ix_(free, free)] @ null).min() > 0.0


def _elastic() -> tuple[ScaledProblem, ElasticProblem]:
    base = scaled()
    elastic = ElasticProblem(base, price=3.0)
    elastic.stay_near(np.ones(base.n), 0.1)
    return base, elastic


def _elastic_reference(base: ScaledProblem, elastic: ElasticProblem, x: np.ndarray, y: np.ndarray):
    """Objective, rows and derivatives of the elastic problem of :func:`_elastic`, in NumPy."""
    n, m = base.n, base.m
    own, p, q = x[:n], x[n : n + m], x[n + m :]
    away = 0.1 * (own - 1.0)
    _, r = base.values(own)
    _, jac, hess = base.weighted_derivatives(own, y, 0.0)
    live = np.where(base.ignored, 0.0, 1.0)
    gradient = np.concatenate([away, np.full(2 * m, 3.0)]) * ~elastic.held
    f = 3.0 * (p.sum() + q.sum()) + 0.5 * away @ (own - 1.0)
    return f, r - p + q, (gradient, np.concatenate([jac, -live, live]), hess)


def _matrix(elastic: ElasticProblem, hess: np.ndarray, jac: np.ndarray, primal: np.ndarray, dual: np.ndarray):
    hess = dense(elastic.hess_rows, elastic.hess_cols, hess, (elastic.n, elastic.n))
    hess = hess + np.tril(hess, -1).T + np.diag(primal)
    jac = dense(elastic.jac_rows, elastic.jac_cols, jac, (elastic.m, elastic.n))
    return np.block([[hess, jac.T], [jac, -np.diag(dual)]])


def test_the_elastic_system_is_solved_exactly() -> None:
    base, elastic = _elastic()
    it = elastic.start(inside(base, 1).w, np.zeros(base.m), np.ones(base.gaps), 0.1)
    rng = np.random.default_rng(2)
    kkt = elastic.attached_kkt
    for repeated in (False, True, True):
        primal, dual = rng.uniform(0.5, 2.0, elastic.n), rng.uniform(0.0, 1.0, elastic.m)
        if repeated and kkt.attempt_call is not None:  # as compiled iterations do it
            kkt.primal[:], kkt.dual[:] = primal, dual
            assert kkt.attempt_call() == 0
            inertia = Inertia(*kkt.inertia)
        else:
            inertia = kkt.factorize(it.hess, it.jac, primal, dual)
        full = _matrix(elastic, it.hess, it.jac, primal, dual)
        eigenvalues = np.linalg.eigvalsh(full)
        assert inertia.positive == (eigenvalues > 0).sum()
        assert inertia.negative == (eigenvalues < 0).sum()
        right = rng.standard_normal(elastic.n + elastic.m)
        step = np.concatenate(kkt.solve(right[: elastic.n], right[elastic.n :]))
        assert full @ step == pytest.approx(right, abs=1e-9)
        kkt.second_rhs[:] = rng.standard_normal(right.size)
        kkt.solve_both_call()
        assert full @ kkt.solution == pytest.approx(right, abs=1e-9)
        assert full @ kkt.second_solution == pytest.approx(kkt.second_rhs, abs=1e-9)


def test_elastic_functions_are_the_same_compiled() -> None:
    base, elastic = _elastic()
    ev = elastic.evaluator()
    rng = np.random.default_rng(3)
    for _ in range(3):
        ev.x[:], ev.y[:] = rng.uniform(0.5, 2.0, elastic.n), rng.standard_normal(elastic.m)
        ev.values_call()
        ev.derivatives_call()
        f, r, parts = _elastic_reference(base, elastic, ev.x, ev.y)
        assert ev.f[0] == pytest.approx(f, rel=1e-14)
        assert ev.r == pytest.approx(r, rel=1e-14)
        for own, expected in zip((ev.gradient, ev.jac, ev.hess), parts, strict=True):
            assert own == pytest.approx(expected, rel=1e-14)
        assert ev.values_status[0] == ev.derivatives_status[0] == 0.0
    ev.x[base.n] = np.nan
    ev.values_call()
    assert np.isnan(ev.values_status[0])


def test_elastic_iterates_are_told_in_the_users_terms() -> None:
    base, elastic = _elastic()
    it = elastic.start(inside(base, 4).w, np.zeros(base.m), np.ones(base.gaps), 0.1)
    work = Workspace(elastic)
    work.load(it)
    work.run("progress_measure")
    x = it.w[: base.n]
    f, r = base.values(x)
    assert (work.s.stated, work.s.violation) == pytest.approx(
        (base.user_objective(f), base.violation(x, r)), rel=1e-12
    )


def test_the_elastic_start_meets_its_rows() -> None:
    base = scaled()
    it = inside(base, 3)
    elastic = ElasticProblem(base, price=1.0)
    start = elastic.start(it.w, np.zeros(base.m), it.z, 1e-3)
    assert start.c == pytest.approx(np.zeros(base.m), abs=1e-12)
    assert start.gap.min() > 0.0


def test_scaling_bounds_gradients_and_inverts() -> None:
    nlp = SymbolicProgram(
        [1.0, 2.0],
        lambda x: 1e7 * x[0] ** 2 + x[1],
        lambda x: [(1e5 * x[0] * x[1], 0.0, INF), (1e-6 * (x[0] + x[1]), 1e-6, INF), (x[0] + x[1], 0.0, 9.0)],
    )
    form = ScaledProblem(nlp, nlp.x0, Options(), DenseKKT)
    x = nlp.x0 / form.x_scale
    gradient, jac, _ = form.derivatives(x, np.zeros(3))
    largest = np.zeros(3)
    np.maximum.at(largest, form.jac_rows, np.abs(jac))
    assert np.abs(gradient).max() == pytest.approx(100.0)
    assert largest == pytest.approx([100.0, 1.0, 1.0])
    y = np.array([1.0, -2.0, 3.0])
    assert form.scaled_multipliers(form.as_stated(np.zeros(form.n), y)[1]) == pytest.approx(y)


def test_violations_are_the_users_own() -> None:
    nlp = program()
    form = scaled()
    x = nlp.x0 * 3.0
    _, r = form.values(x / form.x_scale)
    _, rows = nlp.values(x)
    expected = max(
        relative_violation(rows, nlp.row_lower, nlp.row_upper).max(),
        relative_violation(x, nlp.x_lower, nlp.x_upper).max(),
    )
    assert form.violation(x / form.x_scale, r) == pytest.approx(expected)


def test_errors_vanish_on_the_central_path() -> None:
    """minimise x on x >= 1: at x = 1 + mu with z = 1 the barrier problem is solved."""
    nlp = SymbolicProgram([2.0], lambda x: 1.0 * x[0] + 0.0 * x[0] ** 2, lower=1.0)
    form = ScaledProblem(nlp, nlp.x0, Options(), DenseKKT)
    mu = 0.25
    it = evaluate(form, form.lower + mu, np.zeros(0), np.ones(1))
    assert max(errors_of(form, it, mu)) == pytest.approx(0.0, abs=1e-9)
    assert errors_of(form, it, 0.0)[2] == pytest.approx(mu)


def test_first_iterates_are_strictly_inside() -> None:
    form = scaled()
    x = program().x0 / form.x_scale
    for it in (cold_iterate(form, x), warm_iterate(form, x, np.ones(form.m))):
        assert it.gap.min() > 0.0
        assert it.z.min() > 0.0
        assert it.w[2] == pytest.approx(2.0 / form.x_scale[2])


@given(st.lists(st.floats(1e-3, 1e3), min_size=1, max_size=6), st.integers(0, 100))
def test_the_fraction_to_the_boundary(value: list[float], seed: int) -> None:
    v = np.array(value)
    change = np.random.default_rng(seed).standard_normal(v.size) * v * 3
    alpha = largest_step(v, change, 0.99)
    assert 0.0 < alpha <= 1.0
    assert np.all(v + alpha * change >= 0.01 * v * (1 - 1e-9))
    if alpha < 1.0:
        assert np.any(v + 1.001 * alpha * change < 0.01 * v)


def test_the_filter_refuses_what_it_has_seen() -> None:
    f = Filter(10.0)
    assert f.accepts(5.0, 1e9)
    assert not f.accepts(11.0, -1e9)
    f.add(1.0, 2.0)
    assert not f.accepts(1.0, 2.0)
    assert f.accepts(0.5, 50.0)
    assert f.accepts(5.0, 1.0)
    f.add(0.5, 1.0)
    assert not f.accepts(0.9, 1.5)
    f.restart(10.0)
    assert f.accepts(1.0, 2.0)


def test_the_judge_sees_wrong_multipliers() -> None:
    """minimise x^2 on x >= 1 as a row: only y = -2 is right."""
    nlp = SymbolicProgram([1.0], lambda x: x[0] ** 2, lambda x: [(1.0 * x[0] + 0.0, 1.0, INF)])
    x = np.array([1.0])
    assert assess(nlp, x, np.array([-2.0])).optimality == pytest.approx(0.0, abs=1e-12)
    assert assess(nlp, x, np.array([-1.0])).optimality > 0.1
    assert assess(nlp, x, np.array([2.0])).optimality > 0.1
    assert assess(nlp, np.array([0.5]), np.array([-1.0])).violation == pytest.approx(0.5)


def test_the_projection_finds_the_active_set() -> None:
    nlp = SymbolicProgram(
        [0.0, 0.0],
        lambda x: (x[0] - 2) ** 2 + (x[1] + 1) ** 2,
        lambda x: [(x[0] + x[1], -INF, 5.0)],
        lower=0.0,
        upper=1.0,
    )
    form = ScaledProblem(nlp, nlp.x0, Options(scaling=False), DenseKKT)
    point = Projection(form)
    point.x[:], point.y[:] = [1.0, 0.0], [0.0]
    assert point.evaluate()
    assert point.active_x.tolist() == [True, True]
    assert point.active_rows.tolist() == [False]
    assert point.error == 0.0
