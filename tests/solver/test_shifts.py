"""Shifts of the Hessian where its rows' part is damped: how steps change them, and how they measure steps."""

from __future__ import annotations

import numpy as np
import pytest
from symbolic_program import SymbolicProgram

from stc.solver import Options, Start, minimize
from stc.solver.inertia_correction import DECAY, GROWTH
from stc.solver.iterate import evaluate
from stc.solver.kkt import DenseKKT
from stc.solver.newton_system import NewtonSystem
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.workspace import Workspace


@pytest.mark.parametrize("downwards", [0.02, 1.7, 60.0])
def test_shifts_stay_near_the_smallest_that_serves(downwards: float) -> None:
    """``-c x^2 / 2`` again and again: every shift above c serves, and the larger one is, the shorter is its step."""
    nlp = SymbolicProgram([1.0], lambda x: -0.5 * downwards * x[0] ** 2, lambda x: [])
    form = ScaledProblem(nlp, nlp.x0, Options(scaling=False), DenseKKT)
    work = Workspace(form)
    work.load(evaluate(form, nlp.x0, np.zeros(0), np.zeros(0)))
    system = NewtonSystem(work)
    shifts = []
    for _ in range(30):
        system.factorize(0.1)
        shifts.append(system.shift)
    assert min(shifts) > downwards
    assert max(shifts[10:]) <= downwards * GROWTH / DECAY
    assert work.kkt.factorizations <= 80


def test_a_start_without_inequalities_that_leads_nowhere_ends_on_the_barrier_path():
    """Newton's method alone goes astray from there; no other active set is looked for."""
    nlp = SymbolicProgram(
        [0.01, 3.0],
        lambda x: (x[0] - 1.0) ** 2 + x[1] ** 2,
        lambda x: [(x[0] * x[0] * x[0] + x[0] - x[1], 0.0, 0.0)],
    )
    result = minimize(
        nlp, Options(warm_start=True, trusting=False), start=Start(nlp.x0, np.array([1e4]), np.zeros(2))
    )
    assert result.success
    assert "warm" not in {record.phase for record in result.history}
    x, y = result.x
    assert y == pytest.approx(x**3 + x, abs=1e-8)
    # The stationary point of (x - 1)^2 + (x^3 + x)^2.
    assert 2.0 * (x - 1.0) + 2.0 * (x**3 + x) * (3.0 * x**2 + 1.0) == pytest.approx(0.0, abs=1e-6)
