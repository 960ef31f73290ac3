"""Shifts of the Hessian where its rows' part is damped: how steps change them, and how they measure steps."""

from __future__ import annotations

import numpy as np
import pytest
from symbolic_program import SymbolicProgram

from stc.solver import Options, Start, minimize, places
from stc.solver.iterate import evaluate
from stc.solver.kkt import DenseKKT
from stc.solver.newton_system import NewtonSystem
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.shift_passes import AFTER_SHORT, DECAY, DECAY_IF_CRAMPED, SHORT, relax
from stc.solver.step_passes import ROWS_SHARE, SHARE, SLIGHT
from stc.solver.workspace import Workspace


def after(length: float, *, bends: float = 1.0, limit: float = 1.0) -> np.ndarray:
    """The numbers after a step of that length, made with a shift of 1e-3."""
    s = np.zeros(places.NUMBERS)
    s[places.SHIFT], s[places.BENDS], s[places.LIMIT], s[places.LAST_SHIFT] = 1e-3, bends, limit, 1e-3
    relax(length, s)
    return s


def test_a_short_step_asks_for_a_larger_shift_at_once():
    s = after(0.5 * SHORT)
    assert DECAY * s[places.LAST_SHIFT] == pytest.approx(DECAY * AFTER_SHORT * 1e-3)
    assert DECAY * AFTER_SHORT > 1.0
    assert s[places.UNTRIED] == 1.0


@pytest.mark.parametrize(
    ("length", "more"),
    [
        (1.0, {}),
        (1.5 * SHORT, {}),
        (0.5 * SHORT, {"limit": 0.6 * SHORT}),  # the bounds allowed no more
        (0.5 * SHORT, {"bends": 0.0}),  # damping is of no use
    ],
)
def test_other_steps_leave_the_shift_to_decay(length, more):
    s = after(length, **more)
    assert s[places.LAST_SHIFT] == 1e-3
    assert s[places.UNTRIED] == 0.0


def test_no_shift_is_made_up_where_none_was_needed():
    s = np.zeros(places.NUMBERS)
    s[places.BENDS], s[places.LIMIT] = 1.0, 1.0
    relax(0.01, s)
    assert s[places.LAST_SHIFT] == 0.0
    assert s[places.UNTRIED] == 0.0


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
    assert work.s[places.WHOLE] == 0.0
    weighted = shift * (1.0 + np.square(point)) ** 0.25
    assert work.kkt.primal == pytest.approx(weighted)
    assert np.all(2.0 + ROWS_SHARE * 4.0 * -4.0 + weighted[1:] > 0.0)
    assert SLIGHT < SHARE  # of curvature upwards, which there is none of here
    work.s[places.WHOLE] = 1.0
    work.shifted_call()
    assert work.kkt.primal == pytest.approx(np.full(3, shift))


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
    assert max(shifts[10:]) <= downwards / DECAY_IF_CRAMPED
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
