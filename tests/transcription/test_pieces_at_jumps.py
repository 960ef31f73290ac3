"""Ranged definitions, forces and Lagrangians in the step after a jump; weights of terms that are partly relative.

The truth is motions that can be told by hand.
"""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.errors import Source
from stc.language.elaborate import elaborate
from stc.language.parser import parse
from stc.phases import resolved, stretches


def solved(text: str, method: str = "hermite-simpson") -> stc.Solution:
    solution = stc.load(text).solve(method=method)
    assert solution.status == "optimal"
    return solution


@pytest.mark.parametrize("method", ["trapezoidal", "hermite-simpson"])
def test_a_force_that_ends_at_a_jump_does_not_act_in_the_step_after_it(method):
    solution = solved(
        """
        constants: n = 6, h = 0.5;
        variables: q;
        lagrangian: q'^2/2;
        forces: [0, 3]: q: 1;
        constraints: [0]: q; q'; [3]: after(q') = before(q');
        jumps: [3]: q'';
        """,
        method,
    )
    assert solution["q'"][-1] == pytest.approx(1.5, abs=1e-9)  # the force 1 on the mass 1 for 1.5 s
    assert solution["q"][-1] == pytest.approx(1.125 + 1.5 * 1.5, abs=1e-9)
    if method == "hermite-simpson":
        np.testing.assert_allclose(solution.channel("q''").mid, [1, 1, 1, 0, 0, 0], atol=1e-9)


def test_a_definition_that_ends_at_a_jump_does_not_count_after_it():
    solution = solved(
        """
        constants: n = 6, h = 0.1;
        variables: f;
        definitions: load = 0; [0, 3]: load = 1;
        constraints: f = load;
        objective: integral(f^2);
        jumps: [3]: f;
        """
    )
    assert solution.objective == pytest.approx(0.3, abs=1e-12)


def test_the_momentum_after_a_jump_is_that_of_the_later_lagrangian():
    solution = solved(
        """
        constants: n = 4, h = 0.5;
        variables: q, p;
        lagrangian: [2, n]: 3*q'^2/2; [0, 2]: q'^2/2;
        constraints: p = momentum(q); [0]: q; [2]: before(q') = 1; after(q') = 1;
        jumps: [2]: q', p;
        """
    )
    momentum = solution.channel("p")
    np.testing.assert_allclose(momentum.mid, [1, 1, 3, 3], atol=1e-9)
    np.testing.assert_allclose(momentum.after[2:], 3, atol=1e-9)


def test_a_relative_piece_that_ends_at_a_jump_takes_no_midpoint_from_the_step_after_it():
    solution = solved(
        """
        constants: n = 4;
        variables: x, y;
        definitions: f = 5; [0, 2]: f = x[i+1];
        constraints: x = 1; y = f;
        objective: integral((y - 7)^2);
        jumps: [2]: y;
        """
    )
    middle = solution.channel("y").mid
    np.testing.assert_allclose(middle[2:], 5, atol=1e-9)  # rows hold there
    np.testing.assert_allclose(middle[:2], 7, atol=1e-6)  # and not here: the objective alone decides


def test_steps_are_those_of_the_frames_they_begin_at_whatever_jumps():
    solution = solved(
        """
        constants: n = 4;
        variables: x, y;
        definitions: h = 0.1; [0, 2]: h = 0.2;
        constraints: x = t; y = h;
        jumps: [2]: x, y;
        """
    )
    np.testing.assert_allclose(np.diff(solution.time), [0.2, 0.2, 0.2, 0.1], atol=1e-15)
    np.testing.assert_allclose(solution.channel("y").mid, [0.2, 0.2, 0.2, 0.1], atol=1e-9)
    np.testing.assert_allclose(solution.channel("y").after[2], 0.2, atol=1e-9)


def test_equations_between_frames_are_those_after_the_jump():
    text = """
        constants: n = 6;
        variables: x, f;
        definitions: load = 0; [0, 3]: load = 1;
        constraints: x'' = load;
        jumps: [3]: x'';
        method: hermite-simpson;
    """
    problem = elaborate(parse(Source("case", text)))
    body = problem.relations[0].body
    assert resolved(problem, body, 2) is not resolved(problem, body, 3)
    assert resolved(problem, body, 3) is resolved(problem, body, 5)
    assert (0, 3) in stretches(problem, ())


PLAIN = "constants: n = 6, h = 1; variables: x; definitions: f = x; [0, 2]: f = x[i+1] - {off}; constraints: x = {x};"


@pytest.mark.parametrize(
    ("term", "x", "off", "value"),
    [
        ("f^2", "1", 0, 7.0),  # every frame counts once, as in a sum of seven ones
        ("f", "t", 1, 21.0),  # and the sum of 0 to 6 is exact for a straight line
        ("integral(f)", "t", 1, 18.0),  # the integral of t from 0 to 6
        ("[2, 4]: f", "t", 1, 9.0),
        ("[2, 4]: integral(f)", "t", 1, 6.0),
    ],
)
def test_a_step_without_its_midpoint_counts_at_its_frames(term, x, off, value):
    text = PLAIN.format(x=x, off=off) + f"objective: {term};"
    assert solved(text).objective == pytest.approx(value, abs=1e-9)
