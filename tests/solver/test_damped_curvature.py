"""Where the rows make the Hessian indefinite, a share of their curvature is used."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scaled_program import dense, evaluate
from solver.kkt.dense import DenseKKT
from symbolic_program import SymbolicProgram

from stc.solver import Options, minimize
from stc.solver.curvature import SecondOrder, leave_saddle
from stc.solver.newton_system import NewtonSystem
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.workspace import Workspace
from stc.symbolic.expr import Expr

#: Of step.c.
ROWS_SHARE = 0.4

Objective = Callable[[list[Expr]], Expr | float]


def _squares(x: list[Expr]) -> Expr:
    return x[0] ** 2 + 2.0 * x[1] ** 2


def _system(objective: Objective, y: float, *, linear: bool = False) -> NewtonSystem:
    """At (1, 1), with one row that bends downwards where its multiplier ``y`` is positive."""
    nlp = SymbolicProgram(
        [1.0, 1.0],
        objective,
        lambda x: [(x[0] + x[1] if linear else -(x[0] ** 2) + x[0] * x[1] - 3.0 * x[1] ** 2, -1.0, -1.0)],
    )
    form = ScaledProblem(nlp, nlp.x0, Options(scaling=False), DenseKKT)
    work = Workspace(form)
    work.load(evaluate(form, np.concatenate([nlp.x0, [0.0]]), np.array([y]), np.zeros(0)))
    return NewtonSystem(work)


def _in_use(system: NewtonSystem) -> np.ndarray:
    form = system.form
    return dense(form.hess_rows, form.hess_cols, system.work.kkt.hess, (2, 2))


ROWS = np.array([[-2.0, 0.0], [1.0, -6.0]])
OWN = np.diag([2.0, 4.0])


def test_the_matrix_has_a_share_of_the_rows_part() -> None:
    system = _system(_squares, 1.0)
    whole = system.work.it.hess.copy()
    system.factorize(0.1)
    assert _in_use(system) == pytest.approx(OWN + ROWS_SHARE * ROWS)
    assert np.array_equal(system.work.it.hess, whole)  # the iterate keeps its own
    assert system.shift < 1e-3


def test_multipliers_are_as_before() -> None:
    """The next derivatives are those of the iterate, although they were evaluated without its multipliers."""
    system = _system(_squares, 1.0)
    system.factorize(0.1)
    assert system.work.evaluator.y == pytest.approx(system.work.it.y)
    system.work.evaluator.derivatives_call()
    assert dense(system.form.hess_rows, system.form.hess_cols, system.work.it.hess, (2, 2)) == pytest.approx(
        OWN + ROWS
    )


def test_the_whole_is_used_where_it_will_do() -> None:
    system = _system(_squares, 0.1)
    system.factorize(0.1)
    assert _in_use(system) == pytest.approx(OWN + 0.1 * ROWS)
    assert system.shift == 0.0


@pytest.mark.parametrize(
    ("objective", "what"),
    [
        (lambda x: x[0] + x[1], "bends nothing"),
        (lambda x: x[0] ** 2 - x[1] ** 2, "bends downwards"),
    ],
)
def test_an_objective_that_does_not_bend_upwards_gets_a_shift_only(objective: Objective, what: str) -> None:
    system = _system(objective, 1.0)
    whole = system.work.it.hess.copy()
    system.factorize(0.1)
    assert np.array_equal(system.work.kkt.hess, whole), what
    assert system.shift > 0.1


def test_linear_rows_have_no_part() -> None:
    system = _system(lambda x: x[0] ** 2 - 3.0 * x[1] ** 2, 5.0, linear=True)
    whole = system.work.it.hess.copy()
    system.factorize(0.1)
    assert np.array_equal(system.work.kkt.hess, whole)


def test_second_order_conditions_are_checked_with_the_whole() -> None:
    """Minimise ``x^2 + 2 y^2`` on the circle: (0, 1) is a maximum along it, which a share would not show."""
    nlp = SymbolicProgram([0.0, 1.0], _squares, lambda x: [(x[0] ** 2 + x[1] ** 2, 1.0, 1.0)])
    form = ScaledProblem(nlp, nlp.x0, Options(scaling=False), DenseKKT)
    work = Workspace(form)
    work.load(evaluate(form, np.array([0.0, 1.0, 0.0]), np.array([-2.0]), np.zeros(0)))
    assert not work.it.dual.any()  # stationary
    system = NewtonSystem(work)
    system.factorize(0.1)
    assert system.shift < 1.0
    assert leave_saddle(system, 0) is SecondOrder.LEFT
    assert work.it.f < 2.0


def test_solutions_are_those_of_the_problem() -> None:
    """The nearest point of a curve, from where the row's multiplier starts far off: ``x y = 1`` and its axis."""
    nlp = SymbolicProgram([3.0, 0.1], lambda x: x[0] ** 2 + x[1] ** 2, lambda x: [(x[0] * x[1], 1.0, 1.0)])
    result = minimize(nlp)
    assert result.success
    assert np.abs(result.x) == pytest.approx(np.ones(2), abs=1e-6)
    assert result.objective == pytest.approx(2.0, abs=1e-7)
