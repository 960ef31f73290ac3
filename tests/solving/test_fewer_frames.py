"""Solving on fewer frames first leads to the solution that solving on all frames leads to, and loses nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import stc
from stc.pipeline import Model
from stc.solver import IterationRecord, Options, Result, Start, Status
from stc.solving.fewer_frames import ITERATIONS, Nested, fewer_frames

PENDULUM = """
constants: n = 400, T = 2, g = 9.81, umax = 14;
variables: th, u;
constraints:
  [0, n]: th'' = u - g*sin(th); -umax <= u <= umax;
  [0]: th = 0; th';
  [n]: th = 1.5; th';
objective: [0, n]: integral(u^2);
definitions: h = T/n;
method: hermite-simpson;
"""


def fewer(text: str, **constants: float) -> dict[str, float] | None:
    model = stc.load(text)
    found = fewer_frames(model.tree, constants, model.problem(**constants))
    return None if found is None else dict(found.constants)


def test_the_solution_is_that_of_all_frames() -> None:
    model = stc.load(PENDULUM)
    nested, direct = model.solve(), model.solve(fewer_first=False)
    assert nested.status == direct.status == "optimal"
    assert nested.n == 400
    assert nested.objective == pytest.approx(direct.objective, rel=1e-8)
    np.testing.assert_allclose(nested["th"], direct["th"], atol=1e-5)
    for block, other in zip(nested.multipliers, direct.multipliers, strict=True):
        np.testing.assert_allclose(block.values, other.values, atol=1e-4)


CRANE = """
constants: n = 400, g = 9.81, most = 3.75;
variables: x, l, th, u, w;
parameters: T;
definitions: h = T/n;
method: trapezoidal;
guess: T = 2.6; l = 1; x = 3*t/T;
constraints:
  0.3 <= T <= 20;
  [0, n]:
    x'' = u; l'' = w; l*th'' + 2*l'*th' + g*sin(th) + u*cos(th);
    0.5 <= l <= 2.2; -most <= u <= most; -3 <= w <= 3;
  [0]: x; x'; l = 1; l'; th; th';
  [n]: x = 3; x'; l = 1.07; l'; th; th';
objective: [0]: T;
"""


def test_limits_that_fewer_frames_reach_elsewhere() -> None:
    """Forces at their limits all the time: what is active on fewer frames leaves no positive curvature on all."""
    model = stc.load(CRANE)
    # To the usual tolerance the objective is right to 1.4e-8 only.
    nested, direct = (model.solve(fewer_first=first, tolerance=1e-10) for first in (True, False))
    assert nested.status == direct.status == "optimal"
    assert nested.objective == pytest.approx(direct.objective, rel=1e-8)
    assert nested.iterations <= 50
    # To look for that active set takes more of them than a barrier does.
    assert nested.factorizations <= 60


def test_iterations_and_factorisations_of_all_solves_count() -> None:
    model = stc.load(PENDULUM)
    records: list[IterationRecord] = []
    solution = model.solve(callback=records.append)
    coarse = model.solve(n=50)
    assert solution.iterations > coarse.iterations
    assert solution.factorizations > coarse.factorizations
    far = [r for r in records if r.x is None]
    near = [r for r in records if r.x is not None]
    assert far and near and records == far + near
    assert near[0].iteration == coarse.iterations + 1  # a warm start tells of its first step first
    assert near[-1].iteration == solution.iterations
    assert all(len(r.x) == len(solution.x) for r in near if r.x is not None)


def test_fewer_frames_through_n_alone() -> None:
    assert fewer(PENDULUM) == {"n": 50.0}
    assert fewer(PENDULUM, n=1017) == {"n": 50.0}
    assert fewer(PENDULUM, n=299) is None  # not few enough to be worth it


def test_fewer_frames_through_the_constant_that_others_follow_from() -> None:
    model = stc.load("luxo_jump")
    found = fewer_frames(model.tree, {"k": 16}, model.problem(k=16))
    assert found is not None
    assert found.constants == {"k": 2.0}
    assert found.ratio == 1.0


def test_phases_that_are_shares_of_the_motion_end_at_whole_frames() -> None:
    text = PENDULUM.replace("[0]: th = 0;", "[2*n/5]: th <= 3; [0]: th = 0;")
    assert text != PENDULUM
    assert fewer(text, n=1000) == {"n": 65.0}  # 63 would do, but for the phases
    assert fewer(text, n=1015) == {"n": 65.0}
    assert fewer(PENDULUM, n=1000) == {"n": 50.0}
    assert fewer(PENDULUM, n=505) == {"n": 50.0}
    assert fewer(text, n=505) == {"n": 65.0}
    assert fewer(text, n=385) is None  # 65 are not few enough


def test_fewer_frames_through_several_constants_at_once() -> None:
    text = PENDULUM.replace("n = 400", "a = 200, n = 400").replace(
        "[0]: th = 0;", "[a]: th >= 0; [0]: th = 0;"
    )
    assert fewer(text) == {"a": 25.0, "n": 50.0}


def test_a_step_of_its_own_grows() -> None:
    text = PENDULUM.replace("T = 2", "h = 0.005").replace("definitions: h = T/n;", "")
    assert fewer(text) == {"n": 50.0, "h": 0.04}


@pytest.mark.parametrize(
    "change",
    [
        ("[0]: th = 0;", "[100]: th >= 0; [0]: th = 0;"),  # a frame by its number
        ("h = T/n;", "h = T/400;"),  # takes another time
        ("h = T/n;", "h = T*(1 + n/400)/(2*n);"),  # so does this
    ],
)
def test_another_motion_is_none(change: tuple[str, str]) -> None:
    text = PENDULUM.replace(*change)
    assert text != PENDULUM
    assert fewer(text) is None


def test_a_sum_over_frames_grows_with_them() -> None:
    model = stc.load(PENDULUM.replace("integral(u^2)", "u^2"))
    found = fewer_frames(model.tree, {}, model.problem())
    assert found is not None
    assert found.ratio == pytest.approx(8.0, rel=0.03)
    nested, direct = model.solve(), model.solve(fewer_first=False)
    assert nested.objective == pytest.approx(direct.objective, rel=1e-7)


def test_quadratic_programs_are_solved_at_once() -> None:
    records: list[IterationRecord] = []
    solution = stc.load("particle_waypoints").solve(n=960, callback=records.append)
    assert solution.status == "optimal"
    assert all(r.x is not None for r in records)


def test_a_stop_on_fewer_frames_gives_a_whole_motion() -> None:
    model = stc.load(PENDULUM)
    solution = model.solve(callback=lambda record: record.iteration >= 3)
    assert solution.status == "interrupted"
    assert solution.n == 400
    assert np.ptp(solution["th"]) > 0.1  # what was reached, not the guess


@pytest.mark.parametrize("limit", [0, 2, 4])
def test_the_iteration_limit_is_that_of_all_solves(limit: int) -> None:
    solution = stc.load(PENDULUM).solve(max_iterations=limit)
    assert solution.status == "iteration_limit"
    assert solution.iterations == limit
    assert solution.n == 400


def test_the_time_limit_is_that_of_all_solves() -> None:
    solution = stc.load(PENDULUM).solve(time_limit=1e-9)
    assert solution.status == "time_limit"
    assert solution.n == 400


class Fake:
    """Solves that end as told, and what they were asked."""

    def __init__(self, model: Model, coarse: Result, *fine: Result) -> None:
        self.small, self.answers = model, [coarse, *fine]
        self.asked: list[tuple[Options, Start | None]] = []

    def coarse(self, options: Options, told: object) -> stc.Solution:
        self.asked.append((options, None))
        result = self.answers.pop(0)
        solution = self.small.solve(n=10, max_iterations=0)
        solution.status, solution.objective = str(result.status.value), result.objective
        solution.iterations, solution.factorizations = result.iterations, result.factorizations
        return solution

    def fine(self, options: Options, start: Start | None, told: object) -> Result:
        self.asked.append((options, start))
        return self.answers.pop(0)

    def run(self, options: Options | None = None) -> Result:
        start = Start(np.zeros(1), np.zeros(1), np.zeros(1))
        nested = Nested(self.coarse, lambda _: start, self.fine, options or Options(), None)
        return nested.fewer_first(1.0)

    def helped(self, levels: int) -> Result:
        """From the own guess, with so many numbers of fewer frames to turn to."""
        offers = iter(range(levels))
        start = Start(np.zeros(1), np.zeros(1), np.zeros(1))
        nested = Nested(self.coarse, lambda _: start, self.fine, Options(), None)
        return nested.fewer_for_help(lambda _: next(offers, None) is not None)


def ended(status: Status, objective: float, iterations: int) -> Result:
    none = np.zeros(0)
    return Result(status, none, none, none, objective, 0.0, 0.0, iterations, 2 * iterations, "", [])


@pytest.fixture(scope="module")
def small() -> Model:
    return stc.load(PENDULUM)


def test_a_better_or_equal_solution_is_taken(small: Model) -> None:
    fake = Fake(small, ended(Status.OPTIMAL, 10.0, 7), ended(Status.OPTIMAL, 10.2, 2))
    result = fake.run()
    assert (result.objective, result.iterations, result.factorizations) == (10.2, 9, 18)
    options, start = fake.asked[1]
    assert start is not None and options.warm_start and not options.trusting


def test_a_guess_that_leads_nowhere_is_helped_by_fewer_frames(small: Model) -> None:
    lost, found = ended(Status.FAILED, 5.0, 30), ended(Status.OPTIMAL, 9.0, 4)
    result = Fake(small, lost, ended(Status.OPTIMAL, 10.0, 7), found).helped(3)
    assert (result.status, result.objective, result.iterations) == (Status.OPTIMAL, 9.0, 41)
    # What fails on fewer frames, or from there, is tried with more of them.
    result = Fake(
        small, lost, lost, ended(Status.OPTIMAL, 10.0, 7), lost, ended(Status.OPTIMAL, 9.5, 8), found
    ).helped(3)
    assert (result.status, result.objective, result.iterations) == (Status.OPTIMAL, 9.0, 109)
    result = Fake(small, lost, lost).helped(1)
    assert (result.status, result.objective, result.iterations) == (Status.FAILED, 5.0, 60)


@pytest.mark.parametrize(
    "status", [Status.OPTIMAL, Status.UNBOUNDED, Status.ITERATION_LIMIT, Status.INTERRUPTED]
)
def test_what_needs_no_help_gets_none(small: Model, status: Status) -> None:
    assert Fake(small, ended(status, 5.0, 30)).helped(3).iterations == 30


def test_a_worse_solution_is_compared_with_that_from_the_own_guess(small: Model) -> None:
    answers = [ended(Status.OPTIMAL, 10.0, 7), ended(Status.OPTIMAL, 30.0, 2)]
    fake = Fake(small, *answers, ended(Status.OPTIMAL, 9.0, 20))
    assert fake.run().objective == 9.0
    assert fake.asked[2][1] is None
    fake = Fake(small, *answers, ended(Status.OPTIMAL, 40.0, 20))
    result = fake.run()
    assert (result.objective, result.iterations) == (30.0, 29)
    fake = Fake(small, *answers, ended(Status.FAILED, 0.0, 20))
    assert fake.run().objective == 30.0


@pytest.mark.parametrize("status", [Status.FAILED, Status.INFEASIBLE, Status.ITERATION_LIMIT])
def test_what_fails_on_fewer_frames_is_tried_on_all(small: Model, status: Status) -> None:
    fake = Fake(small, ended(status, 1.0, 7), ended(Status.OPTIMAL, 9.0, 20))
    result = fake.run()
    assert (result.objective, result.iterations) == (9.0, 27)
    assert fake.asked[0][0].max_iterations == ITERATIONS
    assert fake.asked[1] == (replace(Options(), max_iterations=Options().max_iterations - 7), None)


def test_what_fails_from_fewer_frames_is_tried_from_the_own_guess(small: Model) -> None:
    fake = Fake(
        small, ended(Status.OPTIMAL, 1.0, 7), ended(Status.FAILED, 3.0, 4), ended(Status.OPTIMAL, 9.0, 20)
    )
    result = fake.run()
    assert (result.objective, result.iterations, result.factorizations) == (9.0, 31, 62)


def started(text: str, **options: int) -> tuple[list[str], stc.Solution]:
    """Where a solve was: on fewer frames (far) or on all (near), in the order of the iterations."""
    places: list[str] = []

    def told(record: IterationRecord) -> None:
        place = "far" if record.x is None else "near"
        if not places or places[-1] != place:
            places.append(place)

    return places, stc.load(text).solve(callback=told, **options)


@pytest.mark.parametrize("n", [30, 400])
def test_a_prepared_solve_has_nothing_left_to_derive_or_compile(n: int) -> None:
    model = stc.load(PENDULUM)
    model.prepare(n=n)
    solution = model.solve(n=n)
    assert solution.status == "optimal"
    assert len(model._transcriptions) == (2 if n == 400 else 1)
    again = model.solve(n=n)
    assert len(model._transcriptions) == (2 if n == 400 else 1)
    assert again.objective == pytest.approx(solution.objective, rel=1e-8)


LIMITS = [Status.ITERATION_LIMIT, Status.TIME_LIMIT, Status.FAILED]


@pytest.mark.parametrize("status", LIMITS)
@pytest.mark.parametrize(
    ("violation", "objective", "kept"),
    [(0.0, 9.5, 9.5), (0.0, 30.0, 20.0), (0.1, 9.5, 9.5), (50.0, 9.5, 20.0)],
)
def test_the_best_point_of_all_solves_is_kept(
    small: Model, status: Status, violation: float, objective: float, kept: float
) -> None:
    far = 0.0 if violation == 0.0 else 40.0
    first = replace(ended(Status.FAILED, objective, 4), violation=violation)
    last = replace(ended(status, 20.0, 20), violation=far, message="the last one's")
    result = Fake(small, ended(Status.OPTIMAL, 1.0, 7), first, last).run()
    assert (result.status, result.objective) == (status, kept)
    assert (result.iterations, result.factorizations, result.message) == (31, 62, "the last one's")


def test_a_point_that_meets_all_rows_disproves_that_none_does(small: Model) -> None:
    last = replace(ended(Status.INFEASIBLE, 1.0, 20), violation=3.0)
    answers = ended(Status.OPTIMAL, 1.0, 7), ended(Status.FAILED, 30.0, 4)
    result = Fake(small, *answers, last).run()
    assert (result.status, result.objective, result.violation) == (Status.FAILED, 30.0, 0.0)
    assert "No further progress" in result.message
    answers = ended(Status.OPTIMAL, 1.0, 7), replace(ended(Status.FAILED, 30.0, 4), violation=4.0)
    result = Fake(small, *answers, last).run()
    assert (result.status, result.violation) == (Status.INFEASIBLE, 3.0)


def test_a_stop_at_any_time_is_an_interruption() -> None:
    model = stc.load(PENDULUM)
    needed = model.solve().iterations
    for last in range(needed):
        solution = model.solve(callback=lambda record, last=last: record.iteration >= last)
        assert solution.status == "interrupted"
        assert solution.iterations <= last + 1
