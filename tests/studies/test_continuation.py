"""Walking a constant: warm steps, halving and growing again, and walks that cannot arrive."""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.studies.continuation import continue_to

# x^2 + y^2 = r^2 with x + y = s: solvable while s <= r sqrt(2); the smallest y^2 there is known.
CIRCLE = """
constants: n = 0, s = 0;
variables: x, y;
guess: x = 1; y = -1;
constraints: x^2 + y^2 = 1; x + y = s;
objective: y^2;
"""


def test_it_arrives_where_a_single_solve_arrives():
    walk = continue_to(stc.load("particle_jet"), "g", 0, 9.8, 7)
    direct = stc.load("particle_jet").solve()
    assert walk.arrived and walk.status == "optimal" and walk.value == 9.8
    assert walk.solution.constants["g"] == 9.8
    assert walk.solution.objective == pytest.approx(direct.objective, rel=1e-8)
    assert [step.value for step in walk.steps] == pytest.approx(np.linspace(0, 9.8, 8))
    assert np.median([step.iterations for step in walk.steps[1:]]) <= 3


def test_every_solve_is_counted():
    seen = []
    walk = continue_to(stc.load("particle_jet"), "g", 9, 9.8, 2, on_step=seen.append)
    assert seen == walk.steps
    assert walk.effort.solves == 3
    assert walk.effort.iterations == sum(step.iterations for step in walk.steps)
    assert walk.to_dict()["solves"] == 3


def test_a_failed_step_is_halved_and_grows_again():
    model = stc.load(CIRCLE)

    def solve(**settings):
        hard = settings["constants"]["s"] == pytest.approx(0.3) and settings["warm_start"].constants["s"] == 0
        return model.solve(**settings, max_iterations=0 if hard else 100)

    walk = continue_to(model, "s", 0, 1.2, 4, solve=solve)
    assert walk.arrived
    assert [(step.value, step.status) for step in walk.steps] == [
        (pytest.approx(value), "iteration_limit" if k == 1 else "optimal")
        for k, value in enumerate([0, 0.3, 0.15, 0.3, 0.6, 0.9, 1.2])
    ]


def test_a_walk_beyond_the_last_solution_stops_there():
    walk = continue_to(stc.load(CIRCLE), "s", 0, 2, 4)
    assert not walk.arrived
    assert walk.status != "optimal"
    assert walk.value == pytest.approx(np.sqrt(2), abs=2e-3)
    assert walk.solution.status == "optimal" and walk.solution.constants["s"] == walk.value
    assert "stopped at s = 1.41" in walk.message


def test_a_walk_whose_first_solve_fails_does_not_begin():
    walk = continue_to(stc.load(CIRCLE), "s", 5, 0, 4)
    assert len(walk.steps) == 1 and walk.status == "infeasible"
    assert "cannot begin" in walk.message


def test_frames_can_be_walked_too():
    walk = continue_to(stc.load("cart_pole_swing_up"), "n", 20, 50, 3)
    assert walk.arrived and walk.solution.n == 50
    assert [step.value for step in walk.steps] == [20, 30, 40, 50]


def test_mistakes_are_told():
    model = stc.load("particle_jet")
    with pytest.raises(stc.UsageError, match="no constant `G`"):
        continue_to(model, "G", 0, 1)
    with pytest.raises(stc.UsageError, match="at least one step"):
        continue_to(model, "g", 0, 1, 0)
    with pytest.raises(stc.UsageError, match="goes nowhere"):
        continue_to(model, "g", 1, 1)


def test_where_a_function_is_undefined_the_step_is_shorter():
    text = """
    constants: n = 0, c = 1;
    variables: x;
    guess: x = 1;
    constraints: log(x + 1 - c) = 0;
    objective: x^2;
    """
    walk = continue_to(
        stc.load(text), "c", 1, 5, 2
    )  # at the old solution x = c the logarithm's argument is c - c'
    assert "failed" in {step.status for step in walk.steps}
    assert walk.arrived and walk.solution["x"][0] == pytest.approx(5)
