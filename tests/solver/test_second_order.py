"""What is called optimal is a local minimum: stationary points that bend downwards are left, or not called so."""

from __future__ import annotations

import numpy as np
import pytest
from symbolic_program import INF, SymbolicProgram

from stc.optimizers import optimizer_of
from stc.solver import Options, Status, minimize
from stc.solver.curvature import SecondOrder, second_order_at
from stc.solver.kkt import structured_kkt
from stc.solver.nlp import Floats
from stc.solver.report import Start
from stc.solver.scaled_problem import ScaledProblem

HYPERBOLA = SymbolicProgram([1.0, 1.0], lambda x: -x[0] - x[1], lambda x: [(x[0] * x[1], 1.0, 1.0)])
#: The longest way from the origin on a circle round (1, 0): the nearest point, where all begins, is a minimum of it.
CIRCLE = SymbolicProgram(
    [0.5, 0.0], lambda x: -(x[0] ** 2) - x[1] ** 2, lambda x: [((x[0] - 1.0) ** 2 + x[1] ** 2, 0.25, 0.25)]
)


def test_a_curve_that_ends_leads_to_the_minimum() -> None:
    result = minimize(CIRCLE)
    assert result.status is Status.OPTIMAL
    assert result.x == pytest.approx([1.5, 0.0], abs=1e-6)


def test_a_fourth_order_maximum_is_left() -> None:
    """Nothing bends at the start, to second order; ``x^2 = 1 / (0.3)`` is least."""
    result = minimize(SymbolicProgram([0.0, 1.0], lambda x: -(x[0] ** 4) + 0.2 * x[0] ** 6 + x[1] ** 2))
    assert result.status is Status.OPTIMAL
    assert result.x[0] ** 2 == pytest.approx(1.0 / 0.3, rel=1e-6)


@pytest.mark.parametrize("start", [(0.3, 0.4), (1.0, 0.0), (5.0, -3.0)])
def test_what_does_not_bend_at_all_may_be_optimal(start: tuple[float, float]) -> None:
    """A valley, straight or curved, whose floor is level."""
    straight = SymbolicProgram(start, lambda x: (x[0] + x[1] - 1.0) ** 2)
    curved = SymbolicProgram(start, lambda x: (x[1] - x[0] ** 2) ** 2)
    for program in (straight, curved):
        result = minimize(program)
        assert result.status is Status.OPTIMAL
        assert result.objective == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("program", "at", "y"), [(HYPERBOLA, [1.0, 1.0], [1.0]), (CIRCLE, [0.5, 0.0], [-1.0])]
)
def test_a_saddle_is_not_called_optimal_by_whoever_stands_on_it(
    program: SymbolicProgram, at: list[float], y: list[float]
) -> None:
    """Without an iteration, and from a warm start that meets the conditions of the first order."""
    start = Start(np.array(at), np.array(y))
    gradient, jac, _ = program.derivatives(start.x, start.row_multipliers, 1.0)
    assert gradient + np.bincount(program.jac_cols, jac * y[0]) == pytest.approx(np.zeros(2))
    assert minimize(program, Options(max_iterations=0), start=start).status is Status.ITERATION_LIMIT
    warm = minimize(program, Options(warm_start=True), start=start)
    ours = minimize(program)
    assert warm.status is ours.status
    if ours.status is Status.OPTIMAL:
        assert warm.objective == pytest.approx(ours.objective)


@pytest.mark.parametrize("name", ["nlopt:slsqp", "witkin-kass"])
def test_neither_is_it_from_another_optimizer(name: str) -> None:
    result = optimizer_of(name)(CIRCLE, Options())
    assert result.status is not Status.OPTIMAL or result.x == pytest.approx([1.5, 0.0], abs=1e-5)


def _form(program: SymbolicProgram) -> ScaledProblem:
    return ScaledProblem(program, program.x0, Options(scaling=False), structured_kkt)


def test_the_condition_concerns_the_critical_cone_alone() -> None:
    """``x y`` bends downwards across the diagonal; not where a bound with a multiplier, or an equation, forbids it."""
    bound = SymbolicProgram([0.0, 0.0], lambda x: x[0] * x[1] + x[0], lower=[0.0, -INF])
    assert second_order_at(_form(bound), np.zeros(2), np.zeros(0), 0) is SecondOrder.FLAT
    row = SymbolicProgram([0.0, 0.0], lambda x: x[0] * x[1], lambda x: [(x[0] - x[1], 0.0, 0.0)])
    assert second_order_at(_form(row), np.zeros(2), np.zeros(1), 0) is SecondOrder.HOLDS
    other = SymbolicProgram([0.0, 0.0], lambda x: x[0] * x[1], lambda x: [(x[0] + x[1], 0.0, 0.0)])
    assert second_order_at(_form(other), np.zeros(2), np.zeros(1), 0) is SecondOrder.LEFT


@pytest.mark.parametrize("stiff", [1.0, 1e6, 1e12])
def test_units_hide_no_curvature(stiff: float) -> None:
    """What bends downwards in one variable does so however steep another one is."""
    program = SymbolicProgram([0.0, 0.0], lambda x: stiff * x[1] ** 2 - x[0] ** 2 + x[0] ** 4)
    assert second_order_at(_form(program), np.zeros(2), np.zeros(0), 0) is SecondOrder.LEFT
    result = minimize(program)
    assert result.status is Status.OPTIMAL
    assert result.objective == pytest.approx(-0.25, abs=1e-6)


class Dense:
    """``q x + x Q x / 2 + sum x^4 / 4`` on ``x B x / 2 = c``, the variables turned: :class:`stc.solver.nlp.NLP`."""

    objective_degree = 3

    def __init__(self, rng: np.random.Generator) -> None:
        n = self.n = int(rng.integers(2, 7))
        self.m = int(rng.integers(0, min(n - 1, 2) + 1))
        turn = np.linalg.qr(rng.normal(size=(n, n)))[0]
        self._turn = turn
        diagonal = rng.uniform(-2.0, 2.0, n)
        diagonal[0] = -abs(diagonal[0]) - 0.1
        self._Q = np.diag(diagonal)
        self._B = [np.diag(rng.uniform(0.3, 2.0, n)) for _ in range(self.m)]
        x = np.zeros(n)  # where the even variables are 0 their slopes are, too
        x[n - 1] = rng.uniform(0.5, 1.5)
        if self.m == 2:
            x[n - 2] = rng.uniform(0.5, 1.5)
        level = np.array([0.5 * x @ B @ x for B in self._B])
        self.x0 = turn.T @ x
        self.row_lower = self.row_upper = level
        self.x_lower, self.x_upper = np.full(n, -INF), np.full(n, INF)
        self.jac_rows, self.jac_cols = (i.ravel().astype(np.int32) for i in np.indices((self.m, n)))
        self.hess_rows, self.hess_cols = (i.astype(np.int32) for i in np.tril_indices(n))
        self.var_stage, self.row_stage = np.zeros(n, np.int32), np.zeros(self.m, np.int32)
        self.row_linear, self.fixed_curvature = np.zeros(self.m, bool), np.zeros(n, bool)

    def values(self, u: Floats) -> tuple[float, Floats]:
        x = self._turn @ u
        return float(0.5 * x @ self._Q @ x + 0.25 * (x**4).sum()), np.array(
            [0.5 * x @ B @ x for B in self._B]
        )

    def dense(self, u: Floats, y: Floats, weight: float) -> tuple[Floats, Floats, Floats]:
        """Gradient (n,), Jacobian (m, n) and Hessian (n, n)."""
        x, turn = self._turn @ u, self._turn
        hess = weight * (self._Q + np.diag(3.0 * x**2)) + sum(
            (yk * B for yk, B in zip(y, self._B)), np.zeros(())
        )
        jac = np.array([turn.T @ (B @ x) for B in self._B]).reshape(self.m, self.n)
        return turn.T @ (self._Q @ x + x**3), jac, turn.T @ hess @ turn

    def derivatives(self, u: Floats, y: Floats, weight: float) -> tuple[Floats, Floats, Floats]:
        gradient, jac, hess = self.dense(u, y, weight)
        return gradient, jac.ravel(), hess[self.hess_rows, self.hess_cols]

    def least_curvature(self, u: Floats, y: Floats) -> float:
        """The smallest eigenvalue of the Lagrangian's Hessian on the null space of the rows' Jacobian."""
        _, jac, hess = self.dense(u, y, 1.0)
        basis = np.linalg.svd(jac)[2][self.m :].T if self.m else np.eye(self.n)
        return float(np.linalg.eigvalsh(basis.T @ hess @ basis)[0])


@pytest.mark.parametrize("seed", range(60))
def test_random_programs_from_stationary_points_in_most_variables(seed: int) -> None:
    program = Dense(np.random.default_rng(seed))
    result = minimize(program)
    assert result.status is Status.OPTIMAL, result.message
    assert program.least_curvature(result.x, result.row_multipliers) > -1e-6
    if program.m == 0:  # each variable has its own minimum
        least = -0.25 * (np.minimum(np.diag(program._Q), 0.0) ** 2).sum()
        assert result.objective == pytest.approx(least, abs=1e-7)
