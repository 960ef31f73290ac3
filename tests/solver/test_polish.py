"""Equations are met to the last digits, whoever has come near."""

from __future__ import annotations

import numpy as np
import pytest
from symbolic_program import INF, SymbolicProgram

from stc.solver import Options
from stc.solver.kkt import DenseKKT
from stc.solver.polish import meet_equations
from stc.solver.scaled_problem import ScaledProblem
from stc.symbolic.expr import call


def _form() -> ScaledProblem:
    nlp = SymbolicProgram(
        [1.0, 0.5, 0.0],
        lambda x: x[0] ** 2 + x[1] ** 2,
        lambda x: [
            (call("sin", x[0]) + x[1] ** 2, 1.0, 1.0),
            (2.0 * call("sin", x[0]) + 2.0 * x[1] ** 2, 2.0, 2.0),  # says the same
            (x[0] - x[2], -INF, 0.2),
        ],
        lower=[-INF, -INF, 0.0],
    )
    return ScaledProblem(nlp, nlp.x0, Options(scaling=False), DenseKKT)


def _error(x: np.ndarray) -> float:
    return abs(float(np.sin(x[0]) + x[1] ** 2 - 1.0))


def test_equations_are_met() -> None:
    """Rows that depend on one another, and a variable on its bound, are no obstacle."""
    form = _form()
    x = np.array([1.0, np.sqrt(1.0 - np.sin(1.0)), 0.0])
    near = x + [3e-6, -2e-6, 0.0]
    met = meet_equations(form, near)
    assert _error(near) > 1e-8
    assert _error(met) < 1e-11
    assert met[2] == pytest.approx(0.0, abs=1e-12)
    # The least step: along the gradient of the row.
    gradient = np.array([np.cos(near[0]), 2.0 * near[1]])
    change = (met - near)[:2]
    assert change @ [gradient[1], -gradient[0]] == pytest.approx(0.0, abs=1e-10)


def test_what_is_met_stays_as_it_is() -> None:
    form = _form()
    x = np.array([1.0, np.sqrt(1.0 - np.sin(1.0)), 0.0])
    assert meet_equations(form, x) is x


def test_no_gain_is_no_move() -> None:
    """Where the equations contradict each other, their least-squares point is no nearer to both."""
    nlp = SymbolicProgram(
        [0.5], lambda x: x[0] ** 2, lambda x: [(1.0 * x[0], 0.0, 0.0), (1.0 * x[0], 1.0, 1.0)]
    )
    form = ScaledProblem(nlp, nlp.x0, Options(scaling=False), DenseKKT)
    x = np.array([0.5])
    assert meet_equations(form, x) is x
