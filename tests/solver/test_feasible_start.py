"""Feasible points where a search with the objective, and restorations that keep near it, end at violated rows."""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.solver import Options
from stc.solver.feasible_start import least_violation
from stc.solver.kkt import structured_kkt
from stc.solver.monitor import Monitor
from stc.solver.outcome import End
from stc.solver.residuals import assess
from stc.solver.scaled_problem import ScaledProblem

#: Two loads hang below one another from a trolley that passes a disc with little room.
GANTRY = """
constants: n = 60, g = 9.81, M = 2.427, m1 = 0.881, m2 = 2.222, l1 = 1.531, l2 = 0.792, D = 3.584, most = 56.559,
  T = 4.55;
variables: x, a, b, u;
method: hermite-simpson;
definitions: h = T/n; xh = x + l1*sin(a); zh = -l1*cos(a); xl = xh + l2*sin(b); zl = zh - l2*cos(b);
lagrangian: M/2*x'^2 + m1/2*(xh'^2 + zh'^2) + m2/2*(xl'^2 + zl'^2) - m1*g*zh - m2*g*zl;
forces: x: u;
guess: x = D*i/n;
constraints:
  [0, n]: -most <= u <= most; -0.5 <= x <= D + 0.5; -1.2 <= a <= 1.2; (xl - 2.032)^2 + (zl + 2.2)^2 >= 0.5^2;
  [0]: x; a; b; x'; a'; b';
  [n]: x = D; a; b; x'; a'; b';
objective: [0, n]: integral(u^2);
"""

#: A cart-pole swings up with little more force than that takes.
CART_POLE = """
constants: n = 30, T = 2.518, m1 = 2.24, m2 = 0.835, l = 0.677, g = 9.81, d = 0.293, most = 20.256;
variables: q1, q2, u;
method: hermite-simpson;
definitions: h = T/n; D = m1 + m2*(1 - cos(q2)^2);
guess: q1 = d*t/T; q2 = pi*t/T;
constraints:
  [0, n]:
    q1'' = (l*m2*sin(q2)*q2'^2 + u + m2*g*cos(q2)*sin(q2))/D;
    q2'' = -(l*m2*cos(q2)*sin(q2)*q2'^2 + u*cos(q2) + (m1 + m2)*g*sin(q2))/(l*D);
    -2 <= q1 <= 2; -most <= u <= most;
  [0]: q1; q2; q1'; q2';
  [n]: q1 = d; q2 = pi; q1'; q2';
objective: [0, n]: integral(u^2);
"""


@pytest.mark.parametrize("text", [GANTRY, CART_POLE], ids=["gantry", "cart_pole"])
def test_motions_that_can_be_done_are_found(text: str) -> None:
    solution = stc.load(text).solve()
    assert solution.status == "optimal"
    assert solution.violation < 1e-6


#: Two circles' distance is DISTANCE; the point is to be in both, from far off.
CIRCLES = """
constants: n = 0;
variables: x, y;
guess: x = 30; y = -20;
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
