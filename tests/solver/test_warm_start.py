"""Warm starts: the quadratic programs of the steps, and how few steps a neighbouring problem takes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from solver.kkt.dense import DenseKKT

from stc.solver import Options, Start, minimize
from stc.solver.quadratic import ActiveSet, QuadraticProgram, measure
from stc.solver.scaled_problem import ScaledProblem


class DenseQuadratic:
    """1/2 x.Q x + g.x with rows A x and bounds, all dense; a cubic term makes it a problem of several steps."""

    def __init__(self, Q, g, A, row_bounds, x_bounds, cubic=0.0):
        self.Q, self.g, self.A, self.cubic = Q, g, A, cubic
        self.n, self.m = len(g), len(A)
        self.x0 = np.clip(np.zeros(self.n), *x_bounds)
        self.x_lower, self.x_upper = x_bounds
        self.row_lower, self.row_upper = row_bounds
        self.jac_rows, self.jac_cols = (k.ravel() for k in np.indices(A.shape))
        self.hess_rows, self.hess_cols = np.tril_indices(self.n)
        self.var_stage, self.row_stage = np.zeros(self.n, np.int32), np.zeros(self.m, np.int32)
        self.row_linear = np.ones(self.m, bool)
        self.objective_degree = 3 if cubic else 2
        self.fixed_curvature = np.zeros(self.n, bool)

    def values(self, x):
        f = 0.5 * x @ self.Q @ x + self.g @ x + self.cubic * np.sum(np.abs(x) ** 3)
        return float(f), self.A @ x

    def derivatives(self, x, y, factor):
        gradient = self.Q @ x + self.g + 3 * self.cubic * x * np.abs(x)
        H = factor * (self.Q + np.diag(6 * self.cubic * np.abs(x)))
        return gradient, self.A.ravel().copy(), H[self.hess_rows, self.hess_cols]


def random_problem(seed, cubic=0.0):
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 9)), int(rng.integers(0, 6))
    B = rng.normal(size=(n, n))
    A = rng.normal(size=(m, n))
    inside = rng.uniform(-1, 1, n)
    middle = A @ inside
    half = np.where(rng.random(m) < 0.3, 0.0, rng.uniform(0.1, 1, m))
    lower = np.where(rng.random(n) < 0.3, -np.inf, inside - rng.uniform(0, 1, n))
    upper = np.where(rng.random(n) < 0.3, np.inf, inside + rng.uniform(0, 1, n))
    return DenseQuadratic(
        B @ B.T + 0.1 * np.eye(n),
        3 * rng.normal(size=n),
        A,
        (middle - half, middle + half),
        (lower, upper),
        cubic,
    )


def guess_of(rng, lower, upper):
    signs = rng.integers(-1, 2, len(lower)).astype(np.int32)
    reachable = np.where(signs > 0, np.isfinite(upper), np.isfinite(lower))
    return np.where(reachable & (lower < upper), signs, 0).astype(np.int32)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_a_guess_of_the_active_set_leads_to_the_solution_or_nowhere(seed):
    nlp = random_problem(seed)
    form = ScaledProblem(nlp, nlp.x0, Options(), DenseKKT)
    point = measure(form, nlp.x0, np.zeros(nlp.m), np.zeros(nlp.n))
    rng = np.random.default_rng(seed)
    guess = ActiveSet(guess_of(rng, *form.true_x), guess_of(rng, *form.true_rows))
    with np.errstate(all="ignore"):
        found = QuadraticProgram(form, point, 1e-9).solve(guess)
    if found is None:  # active sets that go round
        return
    # The optimality conditions of a convex problem, written out in the problem's own units.
    x = (point.x + found.d) * form.x_scale
    y, z = form.as_stated(x, found.y)[1], found.z / form.x_scale / form.objective_scale
    r = nlp.A @ x
    slack = 1e-6
    assert np.all(x >= nlp.x_lower - slack) and np.all(x <= nlp.x_upper + slack)
    assert np.all(r >= nlp.row_lower - slack) and np.all(r <= nlp.row_upper + slack)
    scale = 1 + np.abs(y).max(initial=0) + np.abs(z).max()
    assert nlp.Q @ x + nlp.g + nlp.A.T @ y + z == pytest.approx(np.zeros(nlp.n), abs=1e-6 * scale)
    for multiplier, value, lower, upper in (
        (z, x, nlp.x_lower, nlp.x_upper),
        (y, r, *(nlp.row_lower, nlp.row_upper)),
    ):
        assert np.all((multiplier <= 1e-6 * scale) | (upper - value <= 1e-5))
        assert np.all((multiplier >= -1e-6 * scale) | (value - lower <= 1e-5))


@pytest.mark.parametrize("seed", range(8))
def test_a_neighbouring_problem_takes_few_steps(seed):
    first = random_problem(seed, cubic=0.3)
    cold = minimize(first, new_kkt=DenseKKT)
    assert cold.success
    neighbour = random_problem(seed, cubic=0.3)
    neighbour.g = 1.01 * neighbour.g
    start = Start(cold.x, cold.row_multipliers, cold.bound_multipliers)
    warm = minimize(neighbour, Options(warm_start=True), start=start, new_kkt=DenseKKT)
    again = minimize(neighbour, new_kkt=DenseKKT)
    assert warm.success and again.success
    assert warm.iterations <= 3
    assert warm.objective == pytest.approx(again.objective, abs=1e-6)


def test_the_solution_itself_takes_one_step():
    problem = random_problem(3)
    cold = minimize(problem, new_kkt=DenseKKT)
    start = Start(cold.x, cold.row_multipliers, cold.bound_multipliers)
    assert minimize(problem, Options(warm_start=True), start=start, new_kkt=DenseKKT).iterations == 1


def test_multipliers_from_elsewhere_do_no_harm():
    problem = random_problem(5, cubic=0.3)
    cold = minimize(problem, new_kkt=DenseKKT)
    rng = np.random.default_rng(0)
    start = Start(problem.x0, 1e3 * rng.normal(size=problem.m), 1e3 * rng.normal(size=problem.n))
    warm = minimize(problem, Options(warm_start=True), start=start, new_kkt=DenseKKT)
    assert warm.success
    assert warm.objective == pytest.approx(cold.objective, abs=1e-6)


def test_a_double_well_started_on_its_ridge_ends_in_a_minimum():
    class DoubleWell(DenseQuadratic):
        def values(self, x):
            return float(0.25 * np.sum(x**4) - 0.5 * np.sum(x**2)), self.A @ x

        def derivatives(self, x, y, factor):
            H = factor * np.diag(3 * x**2 - 1)
            return x**3 - x, self.A.ravel().copy(), H[self.hess_rows, self.hess_cols]

    inf = np.full(2, np.inf)
    problem = DoubleWell(
        np.eye(2), np.zeros(2), np.zeros((0, 2)), (np.zeros(0), np.zeros(0)), (-inf, inf), 1.0
    )
    warm = minimize(
        problem,
        Options(warm_start=True),
        start=Start(np.zeros(2), np.zeros(0), np.zeros(2)),
        new_kkt=DenseKKT,
    )
    assert warm.success
    assert warm.objective == pytest.approx(-0.5, abs=1e-9)
