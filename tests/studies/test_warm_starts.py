"""Solving on from a solution: what need not be done again, and how few iterations are left."""

from __future__ import annotations

import statistics
from pathlib import Path

import numpy as np
import pytest

import stc
from stc import pipeline
from stc.guesses.values import SolutionValues
from stc.solving import kept_transcriptions
from stc.specs import names as bundled_specs

HOPPER = """
constants: n = 40, a = 16, g = 9.81, top = 1.4;
variables: y, f;
parameters: T1, T2;
definitions: [0, a - 1]: h = T1/a; [a, n]: h = T2/(n - a);
method: trapezoidal;
guess: T1 = 0.5; T2 = 0.5; f = g;
jumps: [a]: f;
constraints:
  [0, n]: y'' = f - g; 0 <= f <= 60;
  [0, a]: 0.5 <= y <= 1;
  [a, n]: f = 0;
  [0]: y = 0.8; y'; 0.1 <= T1 <= 2; 0.1 <= T2 <= 2;
  [a]: y = 1;
  [n]: y = top; y';
objective:
  [0, a]: integral(f^2);
  [0]: 20*T1;
"""


@pytest.fixture
def untouched(monkeypatch):
    """Parsing, elaborating, transcribing and compiling fail the test from when this is called."""

    def seal():
        def refuse(*_args, **_kwargs):
            raise AssertionError("this was to be done once only")

        for name in ("parse", "elaborate", "transcribe", "read_problem"):
            monkeypatch.setattr(pipeline, name, refuse)
        for name in ("elaborate", "transcribe"):
            monkeypatch.setattr(kept_transcriptions, name, refuse)
        monkeypatch.setattr("stc.transcription.transcription.compile_tapes", refuse)
        monkeypatch.setattr("stc.transcription.derive.Group.differentiate", refuse)

    return seal


def test_another_number_is_solved_without_parsing_differentiating_or_compiling(untouched):
    earth = stc.load("particle_waypoints").solve()
    untouched()
    moon = earth.resolve(g=1.62)
    assert moon.status == "optimal"
    assert moon.constants["g"] == 1.62 and earth.constants["g"] == 9.8
    assert moon["fy"] == pytest.approx(moon["y''"] + 1.62, abs=1e-7)
    assert moon.seconds["compile"] == moon.seconds["derive"] == 0.0
    assert moon.resolve(g=9.8).objective == pytest.approx(earth.objective)


def test_constants_that_follow_from_others_follow_without_elaboration(untouched):
    first = stc.load("particle_waypoints").solve()
    untouched()
    assert first.resolve(T=4).time[-1] == pytest.approx(4)


def test_a_solution_from_a_file_is_read_anew_once(tmp_path, untouched):
    stc.load("particle_waypoints", n=20).solve(m=2).save(tmp_path / "a.npz")
    solution = stc.read(tmp_path / "a.npz")
    assert solution.origin is None
    heavier = solution.resolve(m=3)
    assert heavier.n == 20 and heavier.constants["m"] == 3
    untouched()
    again = solution.resolve(g=1)
    assert (again.constants["m"], again.constants["g"]) == (2, 1)


def test_a_step_that_is_not_positive_is_still_a_mistake_of_the_spec():
    solution = stc.load("particle_waypoints").solve()
    with pytest.raises(stc.SpecError, match="step `h`"):
        solution.resolve(T=-1)
    with pytest.raises(stc.UsageError, match="no constant `G`"):
        solution.resolve(G=1)


def is_ground_motion(name):
    """Whether the lamp leaves the ground: the larger problems."""
    return name.startswith("luxo_") and not name.endswith("poses")


def neighbours(solution):
    structural = solution.origin.problem(solution.method).structural
    for name, value in solution.constants.items():
        # A whole turn is not a number to change: a foot that lands tilted does not stand.
        if name not in structural and name != "turn" and value and np.isfinite(value):
            yield name, 1.01 * value


def counts_one_percent_away(spec, most):
    """Iterations of the solves with one constant each changed by a hundredth."""
    solution = stc.load(spec).solve()
    assert solution.status == "optimal"
    counts = []
    for name, value in list(neighbours(solution))[:most]:
        near = solution.resolve(constants={name: value}, time_limit=60)
        assert near.status == "optimal"
        counts.append(near.iterations)
    return counts


def is_of_model(spec):
    """Whether a spec takes its equations from a model: whole robots, which take seconds each."""
    return '\nmodel: "' in stc.load(spec).text


@pytest.mark.slow
@pytest.mark.parametrize(
    "spec", [name for name in bundled_specs() if not (is_ground_motion(name) or is_of_model(name))]
)
def test_one_percent_away_is_three_iterations_in_the_median(spec):
    assert statistics.median(counts_one_percent_away(spec, 8)) <= 3


@pytest.mark.nightly
def test_one_percent_away_is_three_iterations_in_the_median_over_all_specs():
    medians = [statistics.median(counts_one_percent_away(spec, 4)) for spec in bundled_specs()]
    assert statistics.median(medians) <= 3


@pytest.mark.parametrize("method", ["trapezoidal", "hermite-simpson"])
def test_other_frames_and_methods_start_from_resampled_multipliers(method):
    coarse = stc.load("cart_pole_swing_up", n=30).solve()
    fine = coarse.resolve(n=60, method=method)
    cold = stc.load("cart_pole_swing_up").solve(n=60, method=method)
    assert fine.status == "optimal"
    assert fine.iterations <= 3 < cold.iterations
    assert fine.objective == pytest.approx(cold.objective, rel=1e-7)


PLAIN_SUM = """
constants: n = 40, h = 1/n;
variables: x, u;
method: trapezoidal;
constraints:
  [0, n]: x'' = u + x^3;
  [0]: x; x';
  [n]: x = 1; x' = 1;
objective: [0, n]: u^2;
"""


def test_the_multipliers_of_a_plain_sum_grow_with_the_frames():
    coarse = stc.load(PLAIN_SUM).solve()
    model = coarse.origin
    problem, transcription = model.transcription(None, n=80)
    start = model._start(coarse, transcription, problem)
    fine = coarse.resolve(n=80)
    assert fine.objective == pytest.approx(2 * coarse.objective, rel=0.03)
    size = np.linalg.norm(fine.row_multipliers)
    assert np.linalg.norm(start.row_multipliers - fine.row_multipliers) <= 0.05 * size
    assert fine.iterations <= 2


@pytest.mark.parametrize(
    ("spec", "method"),
    [
        ("cart_pole_swing_up", "central"),
        ("cart_pole_swing_up", "trapezoidal"),
        ("cart_pole_swing_up", "hermite-simpson"),
        ("particle_jet", "trapezoidal"),
        ("particle_jet", "hermite-simpson"),
    ],
)
def test_resampled_multipliers_are_near_those_of_the_finer_solution(spec, method):
    coarse = stc.load(spec).solve(n=60, method=method)
    fine = coarse.resolve(n=120)
    model = coarse.origin
    problem, transcription = model.transcription(method, n=120)
    start = model._start(coarse, transcription, problem)
    for given, found in (
        (start.row_multipliers, fine.row_multipliers),
        (start.bound_multipliers, fine.bound_multipliers),
    ):
        if np.abs(found).max(initial=0) < 1e-6:
            continue
        free = np.ones(len(found), bool)
        if len(found) == len(fine.x):  # what holds a pinned unknown says nothing about a density
            bound = transcription.bind(problem.constants, check=False)
            free = bound.x_lower < bound.x_upper
        size = np.linalg.norm(found[free])
        assert np.linalg.norm(given[free] - found[free]) <= 0.12 * size + 1e-6


def test_free_durations_and_jumps_carry_over():
    coarse = stc.load(HOPPER).solve()
    assert coarse.status == "optimal"
    fine = coarse.resolve(n=80, a=32)
    assert fine.status == "optimal"
    assert fine.iterations <= 4
    assert fine.parameters["T2"] == pytest.approx(np.sqrt(2 * (1.4 - 1) / 9.81), rel=1e-3)


def test_a_start_that_was_not_optimal_gives_its_values_only():
    model = stc.load("cart_pole_swing_up")
    stopped = model.solve(max_iterations=3)
    assert stopped.status == "iteration_limit"
    problem, transcription = model.transcription()
    assert model._start(stopped, transcription, problem).row_multipliers is None
    assert stopped.resolve().status == "optimal"


def test_a_solution_is_a_guess_whose_frames_keep_their_share():
    solution = stc.load("particle_waypoints").solve(n=12)
    values = SolutionValues(solution).values("x", 0, np.linspace(0, 2, 25))
    assert values[0][::2] == pytest.approx(solution["x"], abs=1e-12)
    assert values[2] == pytest.approx(solution.at(np.linspace(0, 2, 49)[1::2])["x"])


def test_a_warm_start_file_is_used(tmp_path: Path):
    stc.load("cart_pole_swing_up").solve().save(tmp_path / "a.npz")
    warm = stc.load("cart_pole_swing_up").solve(g=9.9, warm_start=tmp_path / "a.npz")
    assert warm.status == "optimal" and warm.iterations <= 3
