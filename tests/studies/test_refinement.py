"""Mesh refinement: the error estimates against known errors, which specs can be refined, and the loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stc
from stc.studies.discretisation import estimate
from stc.studies.frames import Spread
from stc.studies.refinement import refine

# x' = x from 1: nothing to optimise, and the solution is exp(t).
GROWTH = """
constants: n = 10, T = 1, h = T/n;
variables: x;
constraints:
  [0, n]: x' = x;
  [0]: x = 1;
objective: [0, n]: integral(x^2);
"""
PHASES = """
constants: n = 40, a = 30;
variables: x, u;
parameters: T1, T2;
definitions: [0, a - 1]: h = T1/a; [a, n]: h = T2/(n - a);
method: hermite-simpson;
guess: T1 = 1; T2 = 1; x = i/n;
constraints:
  [0, n]: x'' = u - x^3;
  [0]: x; x'; T1 = 1; T2 = 3;
  [a]: x = 0.5;
  [n]: x = 1; x';
objective: [0, n]: integral(u^2);
"""


def estimated(text, method, n):
    solution = stc.load(text).solve(method=method, n=n)
    assert solution.status == "optimal"
    problem = solution.origin.problem(method, n=n)
    return estimate(problem, solution), solution


@pytest.mark.parametrize(("method", "order"), [("trapezoidal", 3), ("hermite-simpson", 5)])
def test_local_errors_are_those_of_one_step(method, order):
    """Against exact integration of x' = x over each step, from the step's own start."""
    for n in (8, 16):
        found, solution = estimated(GROWTH, method, n)
        h = 1 / n
        true = np.abs(solution["x"][:-1] * np.exp(h) - solution["x"][1:]) / (1 + solution["x"].max())
        # The integral of the absolute defect is an upper bound of the same order, not the error itself.
        assert np.all(found.local >= 0.9 * true)
        assert np.all(found.local <= 6 * true)
    finer, _ = estimated(GROWTH, method, 16)
    coarse, _ = estimated(GROWTH, method, 8)
    assert np.log2(coarse.local_error / finer.local_error) == pytest.approx(order, abs=0.25)


@pytest.mark.parametrize("method", ["trapezoidal", "hermite-simpson"])
def test_the_quadrature_error_is_that_of_the_methods_curve(method):
    found, solution = estimated(GROWTH, method, 8)
    t = np.linspace(0, 1, 80_001)
    x = solution.at(t)["x"]
    true = np.trapezoid(x**2, t) - solution.objective
    assert found.quadrature.sum() * (1 + solution.objective) == pytest.approx(true, rel=1e-3, abs=1e-9)


def test_central_differences_are_judged_by_wider_ones():
    text = """
    constants: n = 20, h = 1/n;
    variables: x;
    constraints: [0, n]: x'' = -9*x; [0]: x = 1; x' = 0;
    """
    errors = []
    for n in (20, 40):
        found, solution = estimated(text, "central", n)
        h, t = 1 / n, np.linspace(0, 1, n + 1)
        # The truncation error h^2/12 x'''' of the second difference, times h, over 1 + the largest x'.
        size = 1 + np.abs(solution["x'"]).max()
        true = h * h**2 / 12 * 81 * np.abs(np.cos(3 * t)) / size
        local = found.states["x", 1]
        assert local[3:-3] == pytest.approx(0.5 * (true[:-1] + true[1:])[3:-3], abs=0.05 * true.max())
        errors.append(local.max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(3, abs=0.3)


def test_an_exact_motion_has_no_error():
    found, _ = estimated("""
    constants: n = 6, h = 1/n;
    variables: x, u;
    constraints: [0, n]: x'' = u; [0]: x; x'; [n]: x = 1; x';
    objective: [0, n]: integral(u^2);
    """, "hermite-simpson", 6)  # fmt: skip
    assert found.error < 1e-12


def test_a_motion_too_short_for_an_estimate_has_an_infinite_error():
    found, _ = estimated("""
    constants: n = 3, h = 1/n;
    variables: x;
    constraints: [0, n]: x'' = 1; [0]: x; x';
    """, "central", 3)  # fmt: skip
    assert found.local_error == np.inf


@pytest.mark.parametrize("method", ["central", "trapezoidal", "hermite-simpson"])
def test_refining_reaches_the_tolerance_and_the_true_solution(method):
    tolerance = 1e-3 if method != "hermite-simpson" else 1e-6
    result = refine(stc.load("cart_pole_swing_up", n=20), tolerance, method=method)
    assert result.reached
    assert result.levels[-1].error <= tolerance < result.levels[0].error
    assert [level.n % 20 for level in result.levels] == [0] * len(result.levels)
    assert all(level.iterations < result.levels[0].iterations for level in result.levels[1:])
    assert result.solution.n == result.levels[-1].n
    assert result.solution.objective == pytest.approx(58.9217669, rel=20 * tolerance)
    # Where the grid error is gross the guess is solved from as well.
    assert result.effort.factorizations >= sum(level.factorizations for level in result.levels)


def test_a_tolerance_that_is_met_already_takes_one_solve():
    result = refine(stc.load("cart_pole_swing_up"), 1e-2)
    assert result.reached and result.effort.solves == 1


def test_a_solution_at_hand_is_not_solved_again():
    model = stc.load("cart_pole_swing_up", n=20)
    first = model.solve()
    result = refine(model, 1e-4, start=first)
    assert result.effort.solves == len(result.levels) - 1
    assert result.levels[0].objective == first.objective


def test_phases_with_counts_of_their_own_get_what_they_need():
    spread = Spread.of(stc.load(PHASES), None, {})
    assert spread.ends == [("a", 30), ("n", 40)]
    assert spread.finer([1, 4]) == {"a": 30, "n": 70}
    result = refine(stc.load(PHASES), 1e-7)
    assert result.reached
    first, last = result.levels[0].phases, result.levels[-1].phases
    assert last[1] / first[1] > last[0] / first[0]  # the coarse phase was refined more
    uniform = stc.load(PHASES).solve(n=400, a=300)
    assert result.solution.objective == pytest.approx(uniform.objective, rel=1e-6)


def test_counts_that_follow_from_n_keep_their_share():
    text = PHASES.replace("n = 40, a = 30", "n = 40, a = 3*n/4")
    spread = Spread.of(stc.load(text), None, {})
    assert spread.ends == [("a", 30), ("n", 40)]
    assert spread.finer([3, 3]) == {"n": 120}
    assert spread.finer([1, 4]) == {"a": 30, "n": 70}


def test_counts_that_follow_from_another_constant_are_multiplied_by_that():
    text = PHASES.replace("n = 40, a = 30", "k = 10, n = 4*k, a = 3*k")
    spread = Spread.of(stc.load(text), None, {})
    assert spread.ends == [("a", 30), ("n", 40)]
    assert spread.finer([2, 2]) == {"k": 20}
    assert spread.finer([1, 2]) == {"a": 30, "n": 50}
    assert spread.counts({"k": 20}) == [60, 20]


def test_a_step_that_is_a_plain_number_is_divided():
    text = GROWTH.replace("T = 1, h = T/n", "h = 0.1")
    assert Spread.of(stc.load(text), None, {}).finer([2]) == {"n": 20, "h": 0.05}
    result = refine(stc.load(text), 1e-6, method="trapezoidal")
    assert result.reached
    assert result.solution.time[-1] == pytest.approx(1)


def refused(text, factor=2):
    with pytest.raises(stc.UsageError) as caught:
        Spread.of(stc.load(text), None, {}).finer([factor])
    return str(caught.value)


def test_frames_written_as_numbers_are_refused_with_their_place():
    message = refused(GROWTH.replace("[0]: x = 1;", "[0]: x = 1; [4]: x >= 1;"))
    assert (
        "<text>:6:15: " in message
        and "frame 4 of 10 would be frame 4 of 20" in message
        and "4/10*n" in message
    )
    message = refused(GROWTH.replace("[0]: x = 1;", "[0]: x = 1; x[4] >= 1;"))
    assert "frame 4 of 10" in message


def test_a_frame_beside_one_that_scales_is_fine():
    text = GROWTH.replace("[0]: x = 1;", "[0]: x = 1; [1]: x >= 1; [n - 1]: x >= 1; [n/2 + 1]: x >= 1;")
    assert Spread.of(stc.load(text), None, {}).finer([2]) == {"n": 20}


def test_a_motion_that_would_take_longer_is_refused():
    text = """
    constants: n = 10;
    variables: x;
    definitions: h = 0.1;
    constraints: [0, n]: x' = x; [0]: x = 1;
    """
    assert "takes another time" in refused(text)


def test_a_plain_sum_that_would_weigh_more_is_refused():
    text = GROWTH.replace("[0, n]: integral(x^2);", "[0, n]: x^2; [n]: x;")
    assert "write `integral(x^2)`" in refused(text)
    alone = GROWTH.replace("[0, n]: integral(x^2);", "[0, n]: x^2;")
    assert Spread.of(stc.load(alone), None, {}).finer([2]) == {"n": 20}
    weighed = GROWTH.replace("[0, n]: integral(x^2);", "[0, n]: h*x^2; [n]: x;")
    assert Spread.of(stc.load(weighed), None, {}).finer([2]) == {"n": 20}


def test_exponents_are_no_frame_counts():
    text = GROWTH.replace("T = 1,", "T = 1, p = 3,").replace("x' = x;", "x' = x + 0.1*x^p;")
    assert Spread.of(stc.load(text), None, {}).ends == [("n", 10)]


def test_what_cannot_be_refined_says_so():
    with pytest.raises(stc.UsageError, match="one frame only"):
        refine(stc.load("constants: n = 0; variables: x; objective: x^2;"), 1e-3)
    with pytest.raises(stc.UsageError, match="must be positive"):
        refine(stc.load(GROWTH), 0)


def test_an_error_that_does_not_fall_ends_the_loop():
    # A control that switches inside a step, and no jump declared: the error of the objective falls like 1/n.
    text = """
    constants: n = 10, h = 1/n;
    variables: x, u;
    method: trapezoidal;
    constraints: [0, n]: x' = u; [0, n/2]: u = 1; [n/2 + 1, n]: u = -1; [0]: x;
    objective: [0, n]: integral(u^2);
    """
    result = refine(stc.load(text), 1e-9, most_frames=400)
    assert not result.reached
    assert "400 frames" in result.message and "kinks" in result.message
    assert result.solution.status == "optimal"


def test_a_solve_that_fails_ends_the_loop_with_the_last_good_solution():
    model = stc.load("cart_pole_swing_up", n=20)

    def solve(**settings):
        return model.solve(**{**settings, "max_iterations": 0 if settings["constants"] else 100})

    result = refine(model, 1e-9, solve=solve)
    assert not result.reached and "ended iteration_limit" in result.message
    assert result.solution.n == 20


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(
    ("spec", "method", "tolerance"),
    [
        ("arm_reach", "hermite-simpson", 1e-6),
        ("arm_reach", "trapezoidal", 1e-3),
        ("cart_pole_swing_up", "hermite-simpson", 1e-5),
        ("cart_pole_swing_up", "trapezoidal", 1e-3),
        ("luxo_poses", "hermite-simpson", 1e-6),
    ],
)
def test_the_tolerance_is_kept_against_a_far_finer_solve(spec, method, tolerance):
    result = refine(stc.load(spec), tolerance, method=method)
    assert result.reached and result.levels[-1].error <= tolerance
    solution = result.solution
    fine = solution.resolve(n=4 * solution.n, method="hermite-simpson")
    assert fine.status == "optimal"
    assert abs(solution.objective - fine.objective) <= tolerance * (1 + abs(fine.objective))
    there = fine.at_frame(4 * np.arange(solution.n + 1))
    for name, order in solution.trajectories:
        if order == 0 and (name, 1) in solution.trajectories and (name, 1) in fine.trajectories:
            size = 1 + np.abs(there[name]).max()
            assert np.abs(solution[name] - there[name]).max() <= 2 * tolerance * size


class _Solves:
    """The solves of a model, of which those from fewer frames fail."""

    def __init__(self, model: stc.Model, fails: str) -> None:
        self.model, self.fails = model, fails
        self.made: list[tuple[int, bool]] = []

    def __call__(self, **options) -> stc.Solution:
        warm = options.get("warm_start") is not None
        solution = self.model.solve(**options)
        self.made.append((solution.n, warm))
        return replace(solution, status=self.fails) if warm else solution


def test_where_the_coarse_solution_leads_nowhere_the_guess_is_tried() -> None:
    model = stc.load(GROWTH)
    solves = _Solves(model, "failed")
    found = refine(model, 1e-3, solve=solves, method="trapezoidal")
    assert found.reached
    assert solves.made[0] == (10, False) and solves.made[1][1]
    assert solves.made[-1] == (found.solution.n, False) and found.solution.n > 10
    assert found.effort.solves == len(solves.made)


def test_an_interrupted_solve_is_the_last() -> None:
    model = stc.load(GROWTH)
    solves = _Solves(model, "interrupted")
    found = refine(model, 1e-3, solve=solves, method="trapezoidal")
    assert not found.reached
    assert "interrupted" in found.message
    assert [warm for _, warm in solves.made] == [False, True]
    assert found.solution is not None
    assert found.solution.n == solves.made[0][0]


ACROBOT = """
constants:
  n = 40, m2 = {m2}, g = 9.81, umax = {most};
parameters: T;
definitions: h = T/n;
  x1 = 0.5*sin(a); z1 = -0.5*cos(a); x2 = sin(a) + sin(a+e); z2 = -cos(a) - cos(a+e);
variables: a, e, u;
lagrangian:
  (x1'^2+z1'^2)/2 + 0.083*a'^2/2 - g*z1;
  m2*(x2'^2+z2'^2)/2 + 0.33*(a'+e')^2/2 - m2*g*z2;
forces: a: -0.1*a'; e: u - 0.1*e';
constraints:
  [0]: a; e; a'; e'; 2 <= T <= 10;
  [n]: a = pi; e; a'; e';
  [0,n]: -umax <= u <= umax;
objective: [0,n]: integral(10*u^2); [0]: T;
guess: T = {guess}; a = pi*t/T;
method: hermite-simpson;
"""


@pytest.mark.daily_every(3)
@pytest.mark.parametrize(("m2", "most", "guess"), [(1.1, 9, 5), (0.9, 7, 6), (1, 10, 4)])
def test_a_motion_that_only_a_coarse_grid_has_is_no_guess(m2, most, guess) -> None:
    """An acrobot on 40 frames swings up for a fraction of the effort that it takes; finer grids know better."""
    model = stc.load(ACROBOT.format(m2=m2, most=most, guess=guess))
    found = refine(model, 4e-3, time_limit=60)
    assert found.solution is not None and found.solution.status == "optimal"
    assert found.levels[0].grid_error > 0.1
    assert not found.solution.grid_error().gross
    assert found.solution.n == found.best.n > 40
    assert f"n = {found.levels[0].n}" in found.remark
    # What is kept is no worse than any other motion that was found on the way and is one.
    sound = [
        level.objective for level in found.levels if level.status == "optimal" and level.grid_error < 0.01
    ]
    assert found.solution.objective <= min(sound) * 1.02


@pytest.mark.nightly
def test_a_flat_valley_is_followed_to_its_end() -> None:
    """On 400 frames an optimum of the grid's own lies in a valley along which the cost falls by 0.06 %, at 348.75.

    On finer ones the motion goes on from there to 348.53, which a solve on 480 frames has, too.
    """
    found = refine(stc.load(ACROBOT.format(m2=1, most=8, guess=4.5)), 1e-5, time_limit=120)
    assert found.solution is not None and found.solution.objective <= 348.54
    assert found.reached or found.best.grid_error < 1e-4, found.message


def test_the_best_answer_is_kept_where_finer_solves_find_none() -> None:
    model = stc.load("cart_pole_swing_up", n=40)
    first = model.solve()

    def solve(**options):
        solution = model.solve(**options)
        return solution if solution.n <= 80 else replace(solution, status="iteration_limit")

    found = refine(model, 1e-9, start=first, solve=solve)
    assert not found.reached and "iteration_limit" in found.message
    assert found.solution.status == "optimal" and found.solution.n == found.best.n
    assert found.best is not found.levels[-1]
    assert f"kept is that with n = {found.best.n}" in found.remark
    assert found.to_dict()["kept"] == found.best.n


def test_a_worse_optimum_on_more_frames_is_not_kept() -> None:
    model = stc.load("cart_pole_swing_up", n=40)
    first = model.solve()

    def solve(**options):
        solution = model.solve(**options)
        return replace(solution, objective=1.5 * solution.objective)

    found = refine(model, 1e-9, start=first, solve=solve)
    assert not found.reached and "another optimum" in found.message
    assert found.solution is first
