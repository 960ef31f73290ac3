"""Motions whose objective falls without limit: what grows begins small, at the first frames."""

from __future__ import annotations

import pytest

import stc
from stc.solver.unboundedness import falling_to

SPEC = """
constants: n = 60, T = 2, h = T/n, most = inf;
variables: x, u;
method: {rule};
constraints: [0, n]: x'' = u; u <= 1; -most <= u; [0]: x; x';
objective: [n]: x;
"""


@pytest.mark.parametrize("rule", ["central", "trapezoidal", "hermite-simpson"])
@pytest.mark.parametrize("n", [20, 60, 150, 300, 1000])
def test_a_motion_that_may_go_on_for_ever(rule: str, n: int) -> None:
    solution = stc.load(SPEC.format(rule=rule), n=n).solve(max_iterations=100)
    assert solution.status == "unbounded"


@pytest.mark.parametrize("rule", ["central", "trapezoidal", "hermite-simpson"])
@pytest.mark.parametrize("most", [1e3, 1e8])
def test_a_motion_that_may_go_far(rule: str, most: float) -> None:
    solution = stc.load(SPEC.format(rule=rule), most=most).solve(max_iterations=400)
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(-2.0 * most, rel=0.05)


#: Nothing bounds the force, but the slope of the ground keeps rays from telling.
WAVY = """
constants: n = 60, T = 3.85, h = T/n, most = inf;
variables: x, u;
method: trapezoidal;
constraints: [0, n]: x'' = u + 2.69*sin(x) - 0.16*x'; -most <= u; [0]: x = -0.22; x';
objective: [n]: x;
"""


def test_an_objective_that_went_on_falling_is_told_of() -> None:
    solution = stc.load(WAVY).solve(max_iterations=400)
    assert solution.status == "iteration_limit"
    assert "The objective went on falling, to -" in solution.message
    assert "Bound the variables that grow" in solution.message


def test_a_limit_alone_says_nothing_of_that() -> None:
    assert stc.load(WAVY).solve(max_iterations=10).message.endswith("or start from a better guess.")


def test_nor_does_one_near_a_solution_to_which_the_objective_fell() -> None:
    model = stc.load(SPEC.format(rule="central"), most=1e5)
    model.solve(max_iterations=400)  # later solves keep the order of elimination that this one ends with
    solved = model.solve(max_iterations=400)
    assert solved.status == "optimal"
    history = []
    solution = model.solve(max_iterations=solved.iterations - 1, callback=history.append)
    assert solution.status == "iteration_limit"
    assert falling_to(history) is not None
    assert "went on falling" not in solution.message
