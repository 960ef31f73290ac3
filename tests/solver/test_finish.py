"""Newton's method on the active set as the last steps: when it is tried, and what it remembers."""

from __future__ import annotations

import numpy as np
import pytest
from scaled_program import evaluate
from solver.kkt.dense import DenseKKT
from symbolic_program import INF, SymbolicProgram

from stc.solver import Options, active_set
from stc.solver.active_set import NEAR, Finish
from stc.solver.constants import CONTRACTION
from stc.solver.monitor import Monitor
from stc.solver.scaled_problem import ScaledProblem


def finish_of(rows):
    """For the point of least norm with some rows, near (1, 0)."""
    nlp = SymbolicProgram([1.0, 1e-3], lambda x: 0.5 * (x[0] ** 2 + x[1] ** 2), rows)
    form = ScaledProblem(nlp, nlp.x0, Options(scaling=False), DenseKKT)
    slacks = form.size - form.n
    it = evaluate(
        form, np.concatenate([nlp.x0, np.full(slacks, 1.001)]), np.full(nlp.m, -0.5), np.ones(form.gaps)
    )
    return Finish(form, 1e-8, Monitor(Options(), None)), form, it


def test_it_waits_longer_after_every_attempt_in_vain(monkeypatch):
    finish, _, it = finish_of(lambda x: [(x[0], 1.0, INF)])
    monkeypatch.setattr(active_set, "newton_on_active_set", lambda *_, **__: (None, False))
    assert finish.threshold == NEAR
    error = NEAR
    for power in (1, 2, 3):
        assert finish.is_due(error)
        assert finish.attempt(it, error) is None
        assert finish.threshold == pytest.approx(CONTRACTION**power * error)
        error = finish.threshold


def test_one_row_needs_no_shift():
    finish, form, it = finish_of(lambda x: [(x[0], 1.0, INF)])
    point = finish.attempt(it, 1e-3)
    assert point is not None
    assert point.x == pytest.approx([1.0, 0.0], abs=1e-12)
    assert point.y == pytest.approx([-1.0])
    assert form.kkt.factorizations == 1


def test_inequalities_that_depend_on_one_another_need_no_shift():
    finish, form, it = finish_of(lambda x: [(x[0], 1.0, INF), (2.0 * x[0], 2.0, INF)])
    point = finish.attempt(it, 1e-3)
    assert point is not None
    assert point.x == pytest.approx([1.0, 0.0], abs=1e-8)
    assert form.kkt.factorizations == 1


def test_that_equations_depend_on_one_another_is_found_once():
    finish, form, it = finish_of(lambda x: [(x[0], 1.0, 1.0), (2.0 * x[0], 2.0, 2.0)])
    point = finish.attempt(it, 1e-3)
    first = form.kkt.factorizations
    assert point is not None
    assert point.x == pytest.approx([1.0, 0.0], abs=1e-8)
    assert finish.attempt(it, 1e-4) is not None
    assert form.kkt.factorizations - first == first - 1  # the one without a shift is not tried again
