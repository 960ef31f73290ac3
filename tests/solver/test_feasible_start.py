"""Feasible points where a search with the objective, and restorations that keep near it, end at violated rows."""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.solver import Options
from stc.solver.kkt import structured_kkt
from stc.solver.monitor import Monitor
from stc.solver.outcome import End
from stc.solver.residuals import assess
from stc.solver.scaled_problem import ScaledProblem
from stc.solver.strategies import least_violation

#: Two circles' distance is DISTANCE; the point is to be in both, from far off.
CIRCLES = """
constants: n = 0;
variables: x, y;
guess: x = 25; y = -20;
constraints: [0]: x^2 + y^2 <= 1; (x - DISTANCE)^2 + y^2 <= 1; x*y >= -1;
objective: [0]: x;
"""


def _least(distance: str) -> tuple[End | None, np.ndarray, float]:
    problem, transcription = stc.load(CIRCLES.replace("DISTANCE", distance)).transcription()
    nlp, options = transcription.bind(problem.constants), Options()
    form = ScaledProblem(nlp, nlp.x0, options, structured_kkt)
    end, outcome = least_violation(form, nlp.x0, options, Monitor(options, None))
    x = form.user_variables(outcome.x)
    return end, x, assess(nlp, x, np.zeros(nlp.m)).violation


def test_the_least_violation_is_none_where_the_rows_can_be_met() -> None:
    end, _, violation = _least("1.5")
    assert end is None
    assert violation < 1e-6


def test_the_least_violation_of_circles_that_do_not_meet_is_between_them() -> None:
    """The sum of the violations is least on the line between the centres, anywhere between the circles' gradients."""
    end, x, violation = _least("3")
    assert end is End.STATIONARY_VIOLATION
    assert violation > 0.1
    assert x[1] == pytest.approx(0.0, abs=1e-6)
    assert 1.0 - 1e-6 <= x[0] <= 2.0 + 1e-6
