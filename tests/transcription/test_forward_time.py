"""Time goes forward: what steps depend on is bounded so that they are positive, or no solution is claimed."""

from __future__ import annotations

import numpy as np
import pytest

import stc

RUNAWAY = """
    constants: n = 20;
    parameters: T;
    definitions: h = {h};
    variables: x;
    constraints: [0, n]: x' = -1; [0]: x; [n]: x = {end}; {limits}
    guess: T = 1;
    method: {method};
"""


def runaway(h: str = "T/n", end: float = 3.0, limits: str = "", method: str = "trapezoidal") -> str:
    return RUNAWAY.format(h=h, end=end, limits=limits, method=method)


@pytest.mark.parametrize("method", ["central", "trapezoidal", "hermite-simpson"])
@pytest.mark.parametrize("n", [20, 400])
def test_what_is_reached_backward_in_time_alone_is_not_reached(method: str, n: int) -> None:
    solution = stc.load(runaway(method=method), n=n).solve()
    assert solution.status == "infeasible"
    assert solution.parameters["T"] >= -1e-8
    forward = stc.load(runaway(end=-3.0, method=method), n=n).solve()
    assert (forward.status, forward.parameters["T"]) == ("optimal", pytest.approx(3.0))


@pytest.mark.parametrize(
    ("h", "low", "high"),
    [
        ("T/n", 0.0, np.inf),
        ("(2 - T)/n", -np.inf, 2.0),
        ("0.1 + T/n", -2.0, np.inf),
        ("(T - 0.25)*(i + 1)/n", 0.25, np.inf),
        ("T^2/n", -np.inf, np.inf),
        ("0.5 - 0.1*T*(i + 1)/n", -np.inf, 5.0),
    ],
)
def test_bounds_of_a_parameter_that_steps_depend_on(h: str, low: float, high: float) -> None:
    problem, transcription = stc.load(runaway(h)).transcription()
    bound = transcription.bind(problem.constants)
    at = transcription.layout.parameters["T"]
    assert (bound.x_lower[at], bound.x_upper[at]) == (pytest.approx(low), pytest.approx(high))


def test_phases_bound_a_parameter_each_and_stated_bounds_hold() -> None:
    text = runaway().replace("parameters: T", "parameters: T, S").replace("guess: T", "guess: S = 1; T")
    text = text.replace("h = T/n;", "[0, 9]: h = T/10; [10, n]: h = (3 - S)/10;")
    text = text.replace("[n]: x = 3.0;", "[n]: x = 3.0; T >= 0.5; S <= 2.5;")
    problem, transcription = stc.load(text).transcription()
    bound, layout = transcription.bind(problem.constants), transcription.layout
    places = [layout.parameters[name] for name in "TS"]
    assert [(bound.x_lower[at], bound.x_upper[at]) for at in places] == [(0.5, np.inf), (-np.inf, 2.5)]


def test_a_bound_that_excludes_positive_steps_is_a_mistake() -> None:
    with pytest.raises(stc.SpecError) as caught:
        stc.load(runaway(limits="T <= -1;")).solve()
    assert "T must be at least 0 and at most -1: steps are positive" in str(caught.value)
    assert "T <= -1" in str(caught.value)


@pytest.mark.parametrize("h", ["(T - S)/n", "(T^3 - S)/n"])
def test_no_solution_is_claimed_where_several_parameters_turn_time_back(h: str) -> None:
    text = runaway(h).replace("parameters: T", "parameters: T, S").replace("guess: T", "guess: S = 0; T")
    solution = stc.load(text).solve()
    assert solution.status == "failed"
    assert "steps must be positive" in solution.message
    assert "`T` and `S`" in solution.message
    forward = stc.load(text.replace("x = 3.0", "x = -3.0")).solve()
    assert forward.status == "optimal"
    assert (np.diff(forward.time) > 0.0).all()
