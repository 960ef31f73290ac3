"""Solves of one program one after the other: what they share changes nothing but the time."""

from __future__ import annotations

import numpy as np

import stc
from stc.solver import Options, Start, minimize


def test_the_same_solve_again_finds_the_same() -> None:
    problem, transcription = stc.load("cart_pole_swing_up").transcription(n=20)
    bound = transcription.bind(problem.constants)
    first = minimize(bound)
    again = minimize(bound)
    # The order of elimination that the first one ended with rounds otherwise.
    np.testing.assert_allclose(first.x, again.x, rtol=0.0, atol=1e-12)
    assert (first.iterations, first.factorizations) == (again.iterations, again.factorizations)
    assert np.array_equal(minimize(bound).x, again.x)


def test_a_program_without_rows_is_solved_again() -> None:
    """It needs no multipliers to begin with, so that the first matrix is that of an iteration."""
    problem, transcription = stc.load(
        "constants: n = 200, T = 1, h = T/n;\nvariables: x, y;\nmethod: trapezoidal;\nobjective:\n"
        " [0, n]: (x - 1)^4 + exp(y)*x^2 + y^2; [0, n - 1]: (x[i+1] - x[i])^2 + (y[i+1] - y[i])^2;"
    ).transcription()
    bound = transcription.bind(problem.constants)
    assert bound.m == 0
    first = minimize(bound)
    again = minimize(bound)
    assert first.status.value == again.status.value == "optimal"
    np.testing.assert_allclose(first.x, again.x, rtol=0.0, atol=1e-12)
    assert (first.iterations, first.factorizations) == (again.iterations, again.factorizations)


def test_other_starts_and_options_do_not_get_what_was_left() -> None:
    problem, transcription = stc.load("cart_pole_swing_up").transcription(n=20)
    alone = transcription.bind(problem.constants)
    x = np.clip(alone.x0 + 0.05 * np.sin(np.arange(alone.n)), alone.x_lower, alone.x_upper)
    wanted = minimize(alone, Options(scaling=False), start=Start(x))
    shared = transcription.bind(problem.constants)
    minimize(shared)
    found = minimize(shared, Options(scaling=False), start=Start(x))
    assert np.array_equal(found.x, wanted.x)


def test_programs_with_the_same_numbers_share_all_but_their_start() -> None:
    problem, transcription = stc.load("cart_pole_swing_up").transcription(n=20)
    one = transcription.bind(problem.constants)
    x = np.clip(one.x0 + 0.01, one.x_lower, one.x_upper)
    other = transcription.bind(problem.constants, x)
    assert np.array_equal(other.x0, x)
    assert not np.array_equal(one.x0, x)
    assert other.values(x)[0] == transcription.bind({**problem.constants}, x).values(x)[0]
    heavier = transcription.bind({**problem.constants, "m2": problem.constants["m2"] * 2.0})
    assert not np.array_equal(heavier.values(x)[1], one.values(x)[1])


def test_a_limit_leaves_the_program_as_good_as_new() -> None:
    problem, transcription = stc.load("cart_pole_swing_up").transcription(n=20)
    bound = transcription.bind(problem.constants)
    wanted = minimize(bound)
    assert minimize(bound, Options(max_iterations=3)).status.value == "iteration_limit"
    np.testing.assert_allclose(minimize(bound).x, wanted.x, rtol=0.0, atol=1e-12)
