"""The method of the 1988 paper: where it arrives, where it only comes to rest, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import stc
from stc.optimizers.conjugate_gradients import conjugate_gradients

# The paper's example: a particle under gravity goes from rest to rest with the least force.
PARTICLE = """constants: n = 20, T = 2, h = T/n, m = 1, g = 9.8;
variables: x, fx, y, fy;
constraints:
  m*x'' = fx;  m*y'' = fy - m*g;
  [0]: x; y; x'; y';  [n]: x = 2; y = 1; x'; y';
objective: [1, n - 1]: fx^2 + fy^2;
"""


@pytest.mark.parametrize("name", ["witkin-kass", "witkin-kass:printed"])
def test_the_particle_of_the_paper(name: str) -> None:
    ours, theirs = stc.load(PARTICLE).solve(), stc.load(PARTICLE).solve(optimizer=name)
    assert theirs.status == "optimal", theirs.message
    assert theirs.objective == pytest.approx(ours.objective, rel=1e-9)
    assert theirs["x"] == pytest.approx(ours["x"], abs=1e-6)
    assert theirs.factorizations == 0


@pytest.mark.parametrize("method", ["central", "trapezoidal", "hermite-simpson"])
def test_the_waypoints(method: str) -> None:
    model = stc.load("particle_waypoints")
    theirs = model.solve(n=20, method=method, optimizer="witkin-kass")
    assert theirs.status == "optimal", theirs.message
    ours = model.solve(n=20, method=method)
    assert theirs.objective == pytest.approx(ours.objective, rel=1e-7)
    assert theirs.row_multipliers == pytest.approx(ours.row_multipliers, rel=1e-3, abs=1e-3)


def test_as_printed_it_rests_beside_the_solution() -> None:
    # Minimise x^2 + 100 y^2 on x + y = 1: the solution is (100/101, 1/101).  H^-1 g = (x, y) has to be a
    # multiple of (1, 1) for the printed method to rest, that is at (1/2, 1/2).
    spec = (
        "constants: n=0; variables: x, y; constraints: x + y = 1; objective: x^2 + 100*y^2; guess: x=3; y=2;"
    )
    right = stc.load(spec).solve(optimizer="witkin-kass")
    assert right.status == "optimal"
    assert (right["x"][0], right["y"][0]) == pytest.approx((100 / 101, 1 / 101), abs=1e-6)
    assert right.row_multipliers == pytest.approx([-200 / 101], rel=1e-5)
    printed = stc.load(spec).solve(optimizer="witkin-kass:printed")
    assert printed.status == "failed"
    assert (printed["x"][0], printed["y"][0]) == pytest.approx((0.5, 0.5))
    assert "plain sum of squares" in printed.message


def test_curved_equations() -> None:
    # On the circle of radius 2 the point nearest to (3, 4) is (6/5, 8/5).
    spec = """constants: n = 0; variables: x, y; guess: x = 2; y = -1;
    constraints: x^2 + y^2 = 4; objective: (x - 3)^2 + (y - 4)^2;"""
    solution = stc.load(spec).solve(optimizer="witkin-kass")
    assert solution.status == "optimal"
    assert (solution["x"][0], solution["y"][0]) == pytest.approx((1.2, 1.6), abs=1e-5)


def test_redundant_equations() -> None:
    spec = (
        "constants: n=0; variables: x, y; constraints: x + y = 1; 2*x + 2*y = 2; x - y = 0; objective: x^2;"
    )
    assert stc.load(spec).solve(optimizer="witkin-kass").objective == pytest.approx(0.25)


@pytest.mark.parametrize("constraint", ["x*y <= 1", "x >= 0", "1 <= x + y <= 2"])
def test_inequalities_are_refused(constraint: str) -> None:
    spec = f"constants: n=0; variables: x, y; constraints: {constraint}; objective: x^2 + y^2;"
    with pytest.raises(stc.UsageError, match="takes equations only"):
        stc.load(spec).solve(optimizer="witkin-kass")


def test_every_ending() -> None:
    bounded = stc.load(
        "constants: n=0; variables: x, y; constraints: x - y = 1; objective: x^2 + y^4; guess: x=5;"
    )
    assert bounded.solve(optimizer="witkin-kass", max_iterations=1).status == "iteration_limit"
    assert bounded.solve(optimizer="witkin-kass", time_limit=1e-9).status == "time_limit"
    assert bounded.solve(optimizer="witkin-kass", callback=lambda record: True).status == "interrupted"

    def pressed(record: object) -> bool:
        raise KeyboardInterrupt

    assert bounded.solve(optimizer="witkin-kass", callback=pressed).status == "interrupted"
    falling = stc.load("constants: n=0; variables: x, y; constraints: x - y = 1; objective: x + y;")
    assert falling.solve(optimizer="witkin-kass").status == "unbounded"
    never = stc.load("constants: n=0; variables: x; constraints: x^2 = -1; objective: x^2;")
    assert never.solve(optimizer="witkin-kass").status == "infeasible"


@given(st.integers(0, 10_000))
def test_conjugate_gradients(seed: int) -> None:
    rng = np.random.default_rng(seed)
    k = int(rng.integers(1, 12))
    rank = int(rng.integers(1, k + 1))
    factor = rng.normal(size=(k, rank))
    matrix = factor @ factor.T
    rhs = matrix @ rng.normal(size=k)
    answer = conjugate_gradients(lambda v: matrix @ v, rhs, 1e-12)
    if np.linalg.cond(factor) < 1e3:
        assert answer.x == pytest.approx(
            np.linalg.pinv(matrix) @ rhs, rel=1e-4, abs=1e-4 * np.abs(answer.x).max()
        )
    assert answer.residual == pytest.approx(
        np.linalg.norm(matrix @ answer.x - rhs) / np.linalg.norm(rhs), abs=1e-6
    )


def test_conjugate_gradients_notice_negative_curvature() -> None:
    matrix = np.diag([2.0, -1.0])
    assert conjugate_gradients(lambda v: matrix @ v, np.array([1.0, 3.0]), 1e-12).indefinite
