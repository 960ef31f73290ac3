"""Attempts that gain nothing for long: a held barrier is tried, and they go on where that is in vain."""

from __future__ import annotations

import numpy as np
import pytest

import stc
from stc.solver import attempts
from stc.solver.interior import optimise
from stc.solver.outcome import End, Outcome, Tactics

SPEC = """
constants: n = 12, T = 1, g = 9.81, l = 0.5, most = 12;
variables: q, u;
method: trapezoidal;
definitions: h = T/n;
guess: q = pi*t/T;
constraints:
  [0, n]: q'' = u - g/l*sin(q); -most <= u <= most;
  [0]: q; q';
  [n]: q = pi/2; q';
objective: [0, n]: integral(u^2);
"""


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Tactics, Outcome]]:
    """The attempts made from now on: how, and how they ended."""
    found: list[tuple[Tactics, Outcome]] = []

    def recorded(*args, tactics, **more):
        outcome = optimise(*args, tactics=tactics, **more)
        found.append((tactics, outcome))
        return outcome

    monkeypatch.setattr(attempts, "optimise", recorded)
    return found


@pytest.fixture(scope="module")
def usual() -> stc.Solution:
    return stc.load(SPEC).solve()


def test_an_attempt_that_gains_is_left_alone(made, usual):
    assert stc.load(SPEC).solve().iterations == usual.iterations
    assert [outcome.end for _, outcome in made] == [End.CONVERGED]
    assert made[0][0].adaptive


def test_where_it_gains_nothing_the_barrier_is_held(made, usual, monkeypatch):
    monkeypatch.setattr(attempts, "GAINING", 2)
    found = stc.load(SPEC).solve()
    free, held = made
    assert free[1].idle and free[1].early and free[1].end is End.STUCK
    assert not held[0].adaptive and held[1].end is End.CONVERGED
    assert found.status == "optimal"
    assert found.objective == pytest.approx(usual.objective, rel=1e-8)


def test_where_that_is_in_vain_the_first_one_goes_on(made, usual, monkeypatch):
    monkeypatch.setattr(attempts, "GAINING", 2)
    monkeypatch.setattr(attempts, "HELD", 1)
    found = stc.load(SPEC).solve()
    (_, free), (_, held), (again, last) = made
    assert free.idle and held.end is End.STUCK
    assert again.adaptive and not again.gaining and last.end is End.CONVERGED
    assert free.iterate is not None
    assert found.objective == pytest.approx(usual.objective, rel=1e-8)


def test_convex_programs_are_solved_in_one_attempt(made, monkeypatch):
    monkeypatch.setattr(attempts, "GAINING", 1)
    spec = """
constants: n = 0;
variables: x, y;
constraints: [0]: x + y <= 1; x >= 0; y >= 0;
objective: [0]: x^2 + y^2 - 3*x;
"""
    found = stc.load(spec).solve()
    assert found.status == "optimal"
    assert np.allclose([found["x"][0], found["y"][0]], [1.0, 0.0], atol=1e-7)
    assert not any(tactics.gaining for tactics, _ in made)


def test_few_steps_are_left_to_one_attempt(made, monkeypatch):
    """A motion on fewer frames is given 150 iterations: a second attempt would end before it got anywhere."""
    monkeypatch.setattr(attempts, "GAINING", 2)
    assert stc.load(SPEC).solve(max_iterations=150).status == "optimal"
    ((tactics, outcome),) = made
    assert not tactics.gaining and outcome.end is End.CONVERGED
