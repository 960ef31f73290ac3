"""Shifts of the Hessian where its rows' part is damped: how steps change them, and how they measure steps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scaled_program import evaluate
from solver.kkt.dense import DenseKKT
from symbolic_program import SymbolicProgram

from stc.core.functions import function
from stc.solver import Options, Start, minimize
from stc.solver.newton_system import NewtonSystem
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.workspace import Workspace

#: Of step.c, and of inertia_correction.c.
ROWS_SHARE, SHARE, SLIGHT = 0.4, 0.1, 1e-3
GROWTH, DECAY = 8.0, 1.0 / 3.0


def test_steps_are_measured_relative_to_what_is_large_where_rows_are_damped():
    """``x^2 + y^2 + z^2`` with a row that bends downwards: damped, and shifted more where a variable is large."""
    point = [1.0, 30.0, -400.0]
    nlp = SymbolicProgram(
        point,
        lambda x: x[0] ** 2 + x[1] ** 2 + x[2] ** 2,
        lambda x: [(-2.0 * x[0] ** 2 - 2.0 * x[1] ** 2 - 2.0 * x[2] ** 2, -1.0, -1.0)],
    )
    form = ScaledProblem(nlp, nlp.x0, Options(scaling=False), DenseKKT)
    work = Workspace(form)
    work.load(evaluate(form, np.concatenate([nlp.x0, [0.0]]), np.array([4.0]), np.zeros(0)))
    system = NewtonSystem(work)
    system.factorize(0.1)
    shift = system.shift
    assert shift > 0.0
    assert not work.s.whole
    weighted = shift * (1.0 + np.square(point)) ** 0.25
    assert work.kkt.primal == pytest.approx(weighted)
    assert np.all(2.0 + ROWS_SHARE * 4.0 * -4.0 + weighted[1:] > 0.0)
    work.s.whole = 1
    work.run("step_shifted")
    assert work.kkt.primal == pytest.approx(np.full(3, shift))


def test_what_the_objective_alone_bends_is_hardly_shifted():
    """``3 u^2 - x^2`` with a row in which u is linear: only x needs a shift."""
    nlp = SymbolicProgram(
        [1.0, 2.0], lambda x: -(x[0] ** 2) + 3.0 * x[1] ** 2, lambda x: [(x[0] ** 2 + x[1], 3.0, 3.0)]
    )
    nlp.fixed_curvature = np.array([False, True])
    form = ScaledProblem(nlp, nlp.x0, Options(scaling=False), DenseKKT)
    work = Workspace(form)
    work.load(evaluate(form, np.concatenate([nlp.x0, [0.0]]), np.zeros(1), np.zeros(0)))
    work.s.whole, work.s.shift = 1, 50.0
    work.run("step_diagonals")
    work.run("step_shifted")
    assert work.kkt.primal[0] == pytest.approx(50.0)
    assert work.kkt.primal[1] == pytest.approx(SHARE * 6.0 + SLIGHT * 50.0)


@given(st.lists(st.floats(-1e6, 1e6), max_size=40))
def test_the_median_magnitude(values: list[float]) -> None:
    sizes = sorted(abs(v) for v in values if v)
    expected = sizes[len(sizes) // 2] if sizes else 0.0
    assert function("inertia_correction_median_magnitude")(len(values), np.array(values)) == expected


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
