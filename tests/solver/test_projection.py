"""Steps of Newton's method on the active set, and their corrections with the same factorisation."""

from __future__ import annotations

import numpy as np
import pytest
from solver.kkt.dense import DenseKKT
from symbolic_program import INF, SymbolicProgram

from stc.solver import Options
from stc.solver.constants import EXACT
from stc.solver.projection import ProjectionPair
from stc.solver.scaled_problem import ScaledProblem
from stc.symbolic.expr import call

TOLERANCE = 1e-8


def pair_at(distance):
    """For the lowest point of a circle, x2 held at its bound, begun at a distance from the solution."""
    program = SymbolicProgram(
        [-1.0, 0.0, 0.0],
        lambda x: x[0] + x[2],
        lambda x: [(x[0] ** 2 + x[1] ** 2 + x[2] * x[1], 1.0, 1.0)],
        lower=[-INF, -INF, 0.0],
    )
    form = ScaledProblem(program, program.x0, Options(scaling=False), DenseKKT)
    pair = ProjectionPair(form)
    assert pair.start(
        np.array([-1.0, 0.0, 0.0]) + distance * np.array([0.3, 1.0, 0.0]), np.array([0.5 + distance])
    )
    return pair, form


def error_of_plain_step(distance):
    pair, _ = pair_at(distance)
    assert pair.advance()
    assert pair.next.evaluate()
    return pair.next.error


@pytest.mark.parametrize("distance", [1e-2, 1e-3, 1e-4])
def test_a_step_is_corrected_without_another_factorisation(distance):
    pair, form = pair_at(distance)
    plain = error_of_plain_step(distance)
    assert pair.step(TOLERANCE)
    assert form.kkt.factorizations == 1
    after = pair.next.error
    assert after <= EXACT * TOLERANCE or after < 0.1 * plain
    # It is evaluated where it is, and the change is that of all steps together.
    np.testing.assert_allclose(pair.next.x, [-1.0, 0.0, 0.0], atol=10.0 * after + 1e-15)
    assert pair.change == pytest.approx(distance, rel=0.1)
    assert pair.next.evaluate()
    assert pair.next.error == after


def test_from_far_off_a_correction_is_kept_only_where_it_helps():
    for distance in (0.15, 0.3, 0.5):
        pair, form = pair_at(distance)
        assert pair.step(1e-14)
        assert form.kkt.factorizations == 1
        assert pair.next.error <= error_of_plain_step(distance)


def test_no_correction_where_a_step_is_exact():
    """A linear row and a quadratic objective: the step is the solution, and the point it began at stays."""
    program = SymbolicProgram(
        [1.0, 2.0], lambda x: x[0] ** 2 + x[1] ** 2, lambda x: [(x[0] + x[1], 1.0, 1.0)]
    )
    pair = ProjectionPair(ScaledProblem(program, program.x0, Options(scaling=False), DenseKKT))
    assert pair.start(program.x0, np.zeros(1))
    begun = pair.point
    assert pair.step(TOLERANCE)
    assert pair.point is begun
    np.testing.assert_array_equal(pair.point.x, program.x0)
    np.testing.assert_allclose(pair.next.x, [0.5, 0.5], atol=1e-14)


def test_a_step_to_where_nothing_is_defined_leads_nowhere():
    program = SymbolicProgram([3.0], lambda x: x[0] - call("log", x[0]))
    pair = ProjectionPair(ScaledProblem(program, program.x0, Options(scaling=False), DenseKKT))
    assert pair.start(np.array([0.99]), np.zeros(0))
    assert pair.step(TOLERANCE)
    assert pair.next.x == pytest.approx([1.0], abs=1e-6)
    assert pair.start(np.array([3.0]), np.zeros(0))
    assert not pair.step(TOLERANCE)  # to -3
    assert not pair.start(np.array([-1.0]), np.zeros(0))
