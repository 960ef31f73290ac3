"""Motions and multipliers on other frames, and what is remembered of how they get there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stc
from stc.guesses.alignment import Alignment
from stc.transcription.resample import resample_multipliers

TRAJECTORIES = Path(__file__).parent.parent / "problems" / "traj"

SWING = """
method: {method};
constants: n = 24, T = 2, umax = 3;
variables: a, u;
definitions: h = T/n;
constraints:
  [0, n]: a'' + 9.81*sin(a) = u;  -umax <= u <= umax;
  [0]: a; a';
  [n]: a = 1; a';
  [n/2]: a >= 0.2;
objective: [0, n]: h*u^2;
"""


def followed(
    model: stc.Model, solution: stc.Solution, transcription, problem
) -> tuple[np.ndarray, np.ndarray]:
    """The multipliers on the frames of another transcription."""
    bound = transcription.bind(problem.constants)
    lengths = transcription.recovery(bound.x0, problem.constants).lengths
    alignment = Alignment.even(solution.n, problem.n)
    return resample_multipliers(solution, transcription, bound, lengths, alignment)


@pytest.mark.parametrize("method", ["trapezoidal", "hermite-simpson", "central"])
def test_multipliers_on_the_same_frames_are_the_same(method):
    """Densities times the time that they stand for are the multipliers again."""
    model = stc.load(SWING.format(method=method))
    solution = model.solve()
    problem, transcription = model.transcription()
    rows, bounds = followed(model, solution, transcription, problem)
    # The objective is that of the guess, which multiplies all by one factor.
    factor = np.linalg.norm(rows) / np.linalg.norm(solution.row_multipliers)
    assert factor > 0.0
    np.testing.assert_allclose(rows, factor * solution.row_multipliers, rtol=1e-9, atol=1e-12 * factor)
    np.testing.assert_allclose(bounds, factor * solution.bound_multipliers, rtol=1e-9, atol=1e-12 * factor)


@pytest.mark.parametrize("method", ["trapezoidal", "hermite-simpson", "central"])
def test_a_way_that_is_known_gives_what_a_new_one_does(method):
    """Whatever numbers it was found with."""
    model = stc.load(SWING.format(method=method))
    solutions = [model.solve(umax=umax) for umax in (3.0, 2.5, 4.0)]
    known = stc.load(SWING.format(method=method))
    for solution in solutions:
        fresh = stc.load(SWING.format(method=method))
        expected = followed(fresh, solution, *reversed(fresh.transcription(n=50)))
        found = followed(known, solution, *reversed(known.transcription(n=50)))
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(one, other)
            assert one.any()


@pytest.mark.parametrize("name", ["pendulum_swing_up", "catenoid"])
def test_differences_of_another_motion_are_those_of_its_own_values(name):
    """What is remembered of one motion's differences are places, not numbers."""
    _, transcription = stc.load(TRAJECTORIES / f"{name}.stc").transcription(n=40)
    rng = np.random.default_rng(5)
    for _ in range(2):
        x = rng.normal(size=transcription.program.size)
        recovery = transcription.recovery(x)
        found = recovery.trajectories()
        time = recovery.time
        for variable in {key for key, _ in found}:
            value = found[variable, 0].after
            slope = (value[2:] - value[:-2]) / (time[2:] - time[:-2])
            np.testing.assert_allclose(found[variable, 1].after[1:-1], slope, rtol=1e-9, atol=1e-9)
            assert not found[variable, 1].jumps


def test_a_solve_that_is_prepared_finds_the_same_each_time():
    """By way of fewer frames, whose structure is remembered."""
    prepared = stc.load(SWING.format(method="central")).prepare(n=200)
    first, second = prepared.run(), prepared.run()
    assert first.iterations == second.iterations
    np.testing.assert_array_equal(first.x, second.x)
    np.testing.assert_array_equal(first.row_multipliers, second.row_multipliers)
    again = stc.load(SWING.format(method="central")).prepare(n=200).run()
    np.testing.assert_array_equal(again.x, second.x)
