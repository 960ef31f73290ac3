"""NLopt's algorithms against closed forms, and every way in which they can end."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import nnls

import stc
from stc.optimizers import SizeWarning, optimizer_names, optimizer_of
from stc.optimizers.dual_estimate import bounded_least_squares
from stc.optimizers.nlopt_algorithms import ALGORITHMS
from stc.optimizers.point_result import judge
from stc.solver import Options, Status

# The least of a quartic bowl around (0.3, 0.4), with y held at 0.1 or less by a bound: (0.3, 0.1).
BOWL = """
constants: n = 0;  variables: x, y;
constraints: -1 <= x <= 2;  -2 <= y <= 0.1;
objective: (x - 0.3)^2 + (y - 0.4)^2 + (x - 0.3)^4 + (y - 0.4)^4;
"""
BOWL_VALUE = 0.3**2 + 0.3**4

# Hock and Schittkowski, problem 14: x = (sqrt(7) - 1)/2, y = (sqrt(7) + 1)/4.
HS14 = """
constants: n = 0;  variables: x, y;
constraints: x = 2*y - 1;  x^2/4 + y^2 <= 1;  -5 <= x <= 5;  -5 <= y <= 5;
objective: (x - 2)^2 + (y - 1)^2;  guess: x = 2; y = 2;
"""
HS14_POINT = (np.sqrt(7) - 1) / 2, (np.sqrt(7) + 1) / 4

# The point of 1 <= x*y <= 2 nearest to (2, 2): on the upper branch, x = y = sqrt(2).
RANGE = """
constants: n = 0;  variables: x, y;
constraints: 1 <= x*y <= 2;  0.1 <= x <= 10;  0.1 <= y <= 10;
objective: (x - 2)^2 + (y - 2)^2;  guess: x = 1; y = 1.2;
"""


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("name", ALGORITHMS)
def test_every_algorithm_finds_the_least_in_a_box(name: str) -> None:
    solution = stc.load(BOWL).solve(optimizer=f"nlopt:{name}", max_iterations=400)
    assert solution.status == "optimal", solution.message
    assert solution.objective == pytest.approx(BOWL_VALUE, rel=1e-7)
    assert (solution["x"][0], solution["y"][0]) == pytest.approx((0.3, 0.1), abs=1e-4)
    # The bound's multiplier balances the slope there.
    assert solution.bound_multipliers[1] == pytest.approx(2 * 0.3 + 4 * 0.3**3, rel=1e-5)
    assert solution.optimizer == f"nlopt:{name}"


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(
    "name", ["slsqp", "auglag", "auglag:tnewton", "auglag:bobyqa", "auglag_eq", "cobyla", "isres"]
)
def test_equations_and_inequalities(name: str) -> None:
    solution = stc.load(HS14).solve(optimizer=f"nlopt:{name}", max_iterations=1000)
    assert solution.status == "optimal", solution.message
    assert (solution["x"][0], solution["y"][0]) == pytest.approx(HS14_POINT, abs=1e-5)
    reference = stc.load(HS14).solve()
    assert solution.row_multipliers == pytest.approx(reference.row_multipliers, rel=1e-4)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("name", ["slsqp", "auglag", "mma", "ccsaq", "cobyla", "isres", "ags"])
def test_ranges_are_split(name: str) -> None:
    solution = stc.load(RANGE).solve(optimizer=f"nlopt:{name}", max_iterations=1000)
    assert solution.status == "optimal", solution.message
    assert solution["x"][0] == pytest.approx(np.sqrt(2), abs=1e-5)
    # 2 (x - 2) + multiplier * y = 0 with x = y = sqrt(2).
    assert solution.row_multipliers == pytest.approx([2 * np.sqrt(2) - 2], rel=1e-4)


def test_a_motion_is_the_same_as_ours() -> None:
    spec = """constants: n = 8, h = 1/n;  variables: x, u;
    constraints: x' = u;  -2 <= u <= 2;  [0]: x;  [n]: x = 1;  x^2 + 0.1*u >= 0;
    objective: integral(u^2 + x^2);  method: trapezoidal;"""
    ours, theirs = stc.load(spec).solve(), stc.load(spec).solve(optimizer="nlopt:slsqp")
    assert theirs.status == "optimal"
    assert theirs.objective == pytest.approx(ours.objective, rel=1e-7)
    assert theirs["x"] == pytest.approx(ours["x"], abs=1e-4)


@pytest.mark.parametrize(
    ("name", "spec", "words"),
    [
        ("nlopt:mma", HS14, "takes no equations"),
        ("nlopt:direct", HS14, "takes no equations"),
        ("nlopt:lbfgs", RANGE, "takes no inequalities"),
        ("nlopt:auglag_eq:lbfgs", RANGE, "takes no inequalities"),
        ("nlopt:direct", BOWL.replace("-2 <=", ""), "needs two finite bounds, and 1 of 2 have not"),
        ("nlopt:slsqp", "constants: n=0; variables: x, y; x*y=1; x=y; x+y=2;", "no more equations than unknowns"),
        ("nlopt:slsq", BOWL, "did you mean `nlopt:slsqp`"),
        ("slsqp", BOWL, "did you mean `nlopt:slsqp`"),
        ("nlopt:slsqp:lbfgs", BOWL, "does not use another algorithm"),
        ("nlopt:auglag:direct", BOWL, "is not a local algorithm"),
        ("nonsense", BOWL, "the optimizers are sqp"),
    ],
)  # fmt: skip
def test_what_an_algorithm_cannot_do_is_a_mistake_in_the_input(name: str, spec: str, words: str) -> None:
    if "constraints:" not in spec:
        spec = spec.replace("variables: x, y;", "variables: x, y; constraints:")
    with pytest.raises(stc.UsageError, match=words):
        stc.load(spec).solve(optimizer=name)


def test_the_space_filling_curve_refuses_many_unknowns() -> None:
    spec = "constants: n = 10, h = 1; variables: x; constraints: -1 <= x <= 1; objective: x^2;"
    with pytest.raises(stc.UsageError, match="takes 10 unknowns at most, and this problem has 11"):
        stc.load(spec).solve(optimizer="nlopt:ags")


INFEASIBLE = "constants: n = 0; variables: x, y; constraints: x^2 + y^2 <= 1; x + y >= 3; objective: x;"
SYMMETRIC = """constants: n = 0; variables: x, y; guess: x = 0; y = 0;
constraints: x^2 + y^2 = 4; objective: x + y;"""
UNBOUNDED = "constants: n = 0; variables: x, y; constraints: x - y <= 1; x >= 0; objective: -x - y;"


@pytest.mark.parametrize("name", ["nlopt:slsqp", "nlopt:auglag", "nlopt:cobyla", "nlopt:mma"])
def test_infeasible_needs_a_stationary_violation(name: str) -> None:
    solution = stc.load(INFEASIBLE).solve(optimizer=name, max_iterations=500)
    assert solution.status == "infeasible"
    # The least sum of squares of both violations lies on the diagonal, x = y: between the circle and the line.
    x = solution["x"][0]
    assert solution["y"][0] == pytest.approx(x, abs=1e-4)
    assert 1 / np.sqrt(2) < x < 1.5


def test_a_start_where_the_violation_is_stationary_is_left() -> None:
    solution = stc.load(SYMMETRIC).solve(optimizer="nlopt:slsqp")
    assert solution.status == "optimal"
    assert abs(solution.objective) == pytest.approx(2 * np.sqrt(2), rel=1e-6)


@pytest.mark.parametrize("name", ["nlopt:slsqp", "nlopt:auglag", "nlopt:cobyla"])
def test_unbounded(name: str) -> None:
    assert stc.load(UNBOUNDED).solve(optimizer=name, max_iterations=200).status == "unbounded"


def test_limits_are_kept() -> None:
    model = stc.load(HS14)
    for name in ("nlopt:slsqp", "nlopt:cobyla", "nlopt:auglag", "nlopt:isres"):
        few = model.solve(optimizer=name, max_iterations=2)
        assert (few.status, few.iterations) == ("iteration_limit", 2), name
        assert model.solve(optimizer=name, time_limit=1e-9).status == "time_limit", name


@pytest.mark.parametrize("name", ["nlopt:slsqp", "nlopt:auglag", "nlopt:cobyla", "nlopt:isres"])
def test_the_callback_and_the_keyboard_stop_a_solve(name: str) -> None:
    seen: list[int] = []

    def after_three(record: object) -> bool:
        seen.append(1)
        return len(seen) == 3

    def pressed(record: object) -> bool:
        raise KeyboardInterrupt

    model = stc.load(HS14)
    assert model.solve(optimizer=name, callback=after_three).status == "interrupted"
    assert len(seen) == 3
    assert model.solve(optimizer=name, callback=pressed).status == "interrupted"


def test_mistakes_in_a_callback_come_through() -> None:
    def wrong(record: object) -> bool:
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        stc.load(HS14).solve(optimizer="nlopt:slsqp", callback=wrong)


def test_dense_methods_warn_before_large_problems() -> None:
    spec = (
        "constants: n = 600, h = 1; variables: x; constraints: [1, n]: x*x[i-1] <= 5; objective: (x - 1)^2;"
    )
    with pytest.warns(SizeWarning, match="keeps dense matrices: 601 unknowns and 600 rows"):
        stc.load(spec).solve(optimizer="nlopt:slsqp", max_iterations=0)
    with pytest.warns(SizeWarning, match="meant for a handful"):
        stc.load(spec).solve(optimizer="nlopt:cobyla", max_iterations=0)
    free = "constants: n = 600, h = 1; variables: x; objective: (x - 1)^2;"
    assert stc.load(free).solve(optimizer="nlopt:lbfgs").status == "optimal"  # and no warning


def test_fixed_unknowns_and_nothing_to_choose() -> None:
    fixed = "constants: n = 0; variables: x, y; constraints: x = 2; x*y >= 3; objective: y^2;"
    solution = stc.load(fixed).solve(optimizer="nlopt:slsqp")
    assert (solution["x"][0], solution["y"][0]) == pytest.approx((2.0, 1.5))
    nothing = "constants: n = 0; variables: x, y; constraints: x = 2; y = 1; x*y >= %s; objective: y^2;"
    assert stc.load(nothing % 1).solve(optimizer="nlopt:slsqp").status == "optimal"
    assert stc.load(nothing % 3).solve(optimizer="nlopt:slsqp").status == "infeasible"


def test_only_points_that_satisfy_the_conditions_are_optimal() -> None:
    model = stc.load(HS14)
    _, transcription = model.transcription()
    bound = transcription.bind()
    best = np.array(HS14_POINT)
    assert judge(bound, best, Options()).optimal
    for step in (1e-3, 1e-4, 1e-5):
        along = best + step * np.array([2.0, 1.0])  # keeps the equation
        assert not judge(bound, along, Options()).optimal


def test_every_name_is_an_optimizer() -> None:
    assert "nlopt:slsqp" in optimizer_names()
    for name in optimizer_names():
        assert callable(optimizer_of(name))


def test_results_judge_themselves_with_the_recovered_multipliers() -> None:
    _, transcription = stc.load(HS14).transcription()
    result = optimizer_of("nlopt:slsqp")(transcription.bind())
    assert result.status is Status.OPTIMAL
    assert result.optimality < 1e-6
    assert result.iterations == len(result.history) - 1


@given(st.integers(0, 10_000))
def test_least_squares_with_signs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, k = rng.integers(1, 10, 2)
    matrix, rhs, free = rng.normal(size=(rows, k)), rng.normal(size=rows), rng.random(k) < 0.3
    if k > 2 and seed % 2:
        matrix[:, 1] = matrix[:, 0]
    where, lower = np.nonzero(np.ones_like(matrix)), np.where(free, -np.inf, 0.0)
    s = bounded_least_squares(*where, matrix.ravel(), matrix.shape, rhs, lower, np.full(k, np.inf))
    assert (s[~free] >= 0.0).all()
    # A free entry is the difference of two that are not negative.
    _, least = nnls(np.hstack([matrix, -matrix[:, free]]), rhs)
    assert np.linalg.norm(matrix @ s - rhs) == pytest.approx(least, abs=1e-9)
