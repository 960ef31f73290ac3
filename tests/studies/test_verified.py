"""Solving until MuJoCo agrees: how near it gets, and what is said where frames cannot help."""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc import specs
from stc.studies.discretisation import estimate
from stc.studies.verified import solve_until_verified
from stc.validate import limits, validate
from stc.validate.steps import step_errors
from stc.validate.verdict import open_setup


def largest(report, name):
    return max(metric.value for metric in report.metrics if metric.name == f"{name} drift, largest")


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(("name", "drift"), [("arm_reach", 1e-8), ("luxo_poses", 1e-7)])
def test_a_stable_motion_is_verified_open_loop(name, drift):
    found = solve_until_verified(stc.load(name), drift)
    assert found.verified and found.message == ""
    assert {one.judged_by for one in found.rounds} == {"open loop"}
    assert [one.drift <= drift for one in found.rounds] == [False] * (len(found.rounds) - 1) + [True]
    assert len(found.rounds) == 2 and found.rounds[1].iterations < found.rounds[0].iterations
    # The whole validation says the same of the solution.
    report = validate(found.solution)
    assert report.passed
    assert largest(report, "open-loop") == pytest.approx(found.rounds[-1].drift, rel=1e-6)


def test_an_unstable_motion_is_judged_with_feedback():
    found = solve_until_verified(stc.load("cart_pole_swing_up", n=25), 1e-6)
    assert found.verified
    assert {one.judged_by for one in found.rounds} == {"tracked"}
    report = validate(found.solution)
    assert largest(report, "tracked") <= 1e-6


def text_of(name):
    path = specs.locate(name)
    assert path is not None
    return path.read_text()


def changed(name, old, new):
    text = text_of(name)
    assert old in text
    return stc.load(text.replace(old, new))


def test_wrong_equations_are_told_at_once():
    heavy = changed("arm_reach", "m1*g*z1", "1.1*m1*g*z1")
    found = solve_until_verified(heavy, 1e-6)
    assert not found.verified and len(found.rounds) == 1
    assert "more frames cannot correct: joint shoulder: gravity" in found.message
    assert found.equations is not None and not found.equations.passed
    assert found.solution.status == "optimal"


def test_a_wrong_replay_line_is_told_at_once():
    found = solve_until_verified(changed("arm_reach", "actuator elbow = u2", "actuator elbow = -u2"), 1e-6)
    assert len(found.rounds) == 1
    assert "more frames cannot correct" in found.message and "elbow" in found.message


def test_rounding_ends_it():
    found = solve_until_verified(stc.load("particle_waypoints", n=8, T=0.5), 1e-18)
    assert not found.verified
    assert "more frames no longer reduce the drift" in found.message


def test_the_budget_of_frames_and_time_is_kept():
    found = solve_until_verified(stc.load("arm_reach"), 1e-9, most_frames=100)
    assert "more than 100 frames; joint elbow is 2.5e-06 away (open loop) with n = 60" in found.message
    found = solve_until_verified(stc.load("arm_reach"), 1e-9, time_limit=0.1)
    assert "time limit" in found.message or "time_limit" in found.message
    found = solve_until_verified(stc.load("arm_reach"), 1e-9, max_iterations=2)
    assert found.message == "with n = 60 the solve ended iteration_limit"
    assert found.rounds[0].judged_by == ""


def test_frames_that_cannot_be_added_are_told_with_their_place():
    found = solve_until_verified(changed("arm_reach", "[n]:\n", "[n - 7]: a2 <= 2.8;\n  [n]:\n"), 1e-9)
    assert "joint elbow is" in found.message
    assert "frame 53 of 60 would be frame " in found.message


def test_a_solution_at_hand_is_not_solved_again():
    model = stc.load("arm_reach")
    found = solve_until_verified(model, 1e-4, start=model.solve())
    assert found.verified and found.effort.solves == 0


def test_what_cannot_be_verified_is_refused():
    with pytest.raises(stc.UsageError, match="must be positive"):
        solve_until_verified(stc.load("arm_reach"), 0.0)
    with pytest.raises(stc.UsageError, match="names no model"):
        solve_until_verified(stc.load("constants: n = 4; variables: x; objective: integral(x''^2);"), 1e-3)


@pytest.mark.nightly
def test_on_the_ground_the_solved_contact_forces_judge():
    found = solve_until_verified(stc.load("luxo_jump"), 1e-3)
    assert found.verified and len(found.rounds) == 1
    assert found.rounds[0].judged_by == "contact forces"


@pytest.mark.nightly
def test_on_the_ground_the_simulators_contacts_have_the_last_word():
    found = solve_until_verified(stc.load("luxo_jump"), 1e-4)
    assert [one.drift <= 1e-4 for one in found.rounds] == [False, True]
    assert "with MuJoCo's own contacts, with feedback," in found.message
    assert "more frames cannot correct" in found.message


@pytest.mark.parametrize("method", ["trapezoidal", "hermite-simpson"])
@pytest.mark.parametrize("spec", ["arm_reach", "luxo_poses", "cart_pole_swing_up"])
def test_the_estimate_and_the_simulator_agree_on_every_step(spec, method):
    """Two independent answers to one question: where do the equations lead from the solved state in one step?"""
    solution = stc.load(spec).solve(method=method)
    setup = open_setup(solution)
    simulated = step_errors(setup)
    found = estimate(solution.origin.problem(method), solution)
    total = np.zeros(solution.n)
    for (name, order), error in found.states.items():
        size = 1.0 + float(np.abs(solution.channel(name + "'" * order).before).max())
        size = max(size, 1.0 + float(np.abs(solution.channel(name + "'" * order).after).max()))
        total += (error * size / limits.TRACKING_RATE**order) ** 2
    assert np.sqrt(total) == pytest.approx(simulated, rel=0.02, abs=0.002 * simulated.max())
