"""Calls from Python that cannot be carried out say why, and the page about them is true."""

from __future__ import annotations

import copy
import pickle
import re
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stc
from stc.certification import certify
from stc.studies.continuation import continue_to
from stc.studies.multistart import multistart
from stc.studies.refinement import refine
from stc.studies.verified import solve_until_verified
from stc.testing import assert_physical
from stc.validate import validate

PAGE = Path(__file__).parent.parent / "docs" / "python.md"

# The line between (0, 1) and (2, 1): x = t, y = 1.
STRAIGHT = """constants: n = 4, T = 2, h = T/n, speed = 1;
variables: x, y;
parameters: width;
constraints: x' = speed; y' = 0; [0]: x = 0; y = 1; [0]: width = 3;
method: trapezoidal;
"""


@pytest.fixture(scope="module")
def solution() -> stc.Solution:
    return stc.load(STRAIGHT).solve()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda model: model.solve(tolerance=-1), "the tolerance must lie between 1e-14 and 1, not -1"),
        (lambda model: model.solve(tolerance=1e-30), "the tolerance must lie between 1e-14 and 1, not 1e-30"),
        (lambda model: model.solve(tolerance=float("nan")), "between 1e-14 and 1, not nan"),
        (lambda model: model.solve(max_iterations=-1), "max_iterations must be at least 0, not -1"),
        (lambda model: model.solve(time_limit=0), "the time limit must be a positive number of seconds"),
        (lambda model: model.solve(tolerance="1e-3"), "the tolerance must be a number, not '1e-3'"),
        (lambda model: model.solve(max_iterations="9"), "max_iterations must be a number, not '9'"),
        (lambda model: model.solve(max_iterations=2.5), "max_iterations must be a whole number, not 2.5"),
        (lambda model: model.solve(time_limit="5"), "the time limit must be a number, not '5'"),
        (lambda model: model.solve(method=["central"]), r"unknown method \['central'\]"),
        (lambda model: model.solve(optimizer=3), "an optimizer is a name such as `sqp`, not 3"),
        (lambda model: model.solve(callback=3), "the callback must be a function, not 3"),
        (lambda model: model.solve(constants=[1]), r"constants are numbers by name, not \[1\]"),
        (lambda model: model.solve(guess={3: 1}), "the guess is numbers by name, and 3 is not a name"),
        (lambda model: model.solve().resolve(constants=3), "constants are numbers by name, not 3"),
        (lambda model: model.solve().save(3), "the file of a solution must be a path, not 3"),
        (lambda model: continue_to(model, "speed", 1, "2"), "the last value of speed must be a number"),
        (
            lambda model: continue_to(model, "speed", 1, 2, 2.5),
            "number of steps must be a whole number, not 2.5",
        ),
        (lambda model: multistart(model, "3"), "the number of starts must be a number, not '3'"),
        (lambda model: refine(model, "1e-3"), "the error of a refinement must be a number, not '1e-3'"),
        (lambda model: refine(model, 1e-3, time_limit="5"), "the time limit must be a number, not '5'"),
        (lambda model: solve_until_verified(model, "1e-3"), "the drift must be a number, not '1e-3'"),
        (lambda model: model.solve(speed=[1, 2]), r"the constant `speed` needs a number, not \[1, 2\]"),
        (lambda model: model.solve(speed=np.ones(2)), "the constant `speed` needs a number"),
        (lambda model: model.solve(warm_start=3), "a solution is read from a path, not from 3"),
        (
            lambda model: model.solve(guess=[0, 1]),
            r"a guess is numbers by name, a solution, .*, not \[0, 1\]",
        ),
        (lambda model: model.problem(speed=None), "the constant `speed` needs a number, not None"),
        (lambda _: stc.load(STRAIGHT, speed="fast"), "the constant `speed` needs a number, not 'fast'"),  # type: ignore[arg-type]
        (lambda _: stc.load(3), "a spec is a path, a bundled name or its text, not 3"),  # type: ignore[arg-type]
        (lambda _: stc.load(""), "the spec is empty: no path, no name, no text"),
        (lambda _: stc.load(" \n\n"), "the text of the spec is empty"),
        (lambda _: stc.read(3), "a solution is read from a path, not from 3"),  # type: ignore[arg-type]
        (lambda _: validate(3), "a motion is a solution, the path of a saved one, or a spec, not 3"),  # type: ignore[arg-type]
        (lambda model: validate(model), "a model is solved first"),
        (lambda _: validate("particle_waypoints", 3), "the model must be a path, not 3"),  # type: ignore[arg-type]
        (lambda _: validate("particle_waypoints", time_step="1"), "time step of the replay must be a number"),  # type: ignore[arg-type]
        (lambda _: validate("nowhere"), "there is no spec `nowhere`"),
        (lambda _: validate("nowhere.npz"), "there is no solution file nowhere.npz"),
    ],
)
def test_what_cannot_be_meant_is_a_usage_error(call: Callable[[stc.Model], Any], message: str) -> None:
    with pytest.raises(stc.UsageError, match=message):
        call(stc.load(STRAIGHT))


def test_an_empty_file_is_told_to_be_empty(tmp_path: Path) -> None:
    (tmp_path / "nothing.stc").write_text(" \n")
    with pytest.raises(stc.UsageError, match=r"nothing\.stc is empty"):
        stc.load(tmp_path / "nothing.stc")


def test_numbers_of_any_kind_are_numbers() -> None:
    model = stc.load(STRAIGHT)
    for two in (2, np.float32(2), np.array(2.0)):
        assert model.solve(speed=two)["x"][-1] == pytest.approx(4.0)


def test_a_solution_is_a_guess(solution: stc.Solution, tmp_path: Path) -> None:
    solution.save(tmp_path / "straight.npz")
    model = stc.load(STRAIGHT)
    given, read = (model.solve(n=8, speed=2, guess=guess) for guess in (solution, tmp_path / "straight.npz"))
    assert given.status == "optimal"
    np.testing.assert_array_equal(given.x, read.x)


@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda thing: pickle.loads(pickle.dumps(thing))]
)
def test_motions_and_models_go_to_other_processes(
    solution: stc.Solution, copied: Callable[[Any], Any]
) -> None:
    """What a pool of workers takes and gives back: compiled code stays behind, and all that it was made from goes."""
    again = copied(solution)
    np.testing.assert_array_equal(again["x'"], solution["x'"])
    assert [block.label for block in again.multipliers] == [block.label for block in solution.multipliers]
    assert (again.sha256, again.constants, again.overrides) == (solution.sha256, solution.constants, {})
    np.testing.assert_array_equal(again.resolve(speed=2)["x"], solution.resolve(speed=2)["x"])

    model = stc.load(STRAIGHT, speed=3)
    model.solve()
    np.testing.assert_array_equal(copied(model).solve()["x"], model.solve()["x"])


def test_times_and_frames_are_numbers(solution: stc.Solution) -> None:
    with pytest.raises(stc.UsageError, match="a time is a number of seconds, or an array, not 'a'"):
        solution.at("a")
    with pytest.raises(stc.UsageError, match="a frame is given by its index, or an array, not"):
        solution.at_frame([[1, 2], [3]])  # type: ignore[list-item]


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("q", "the solution of text has no q; it has x, y, width"),
        ("widht", "has no widht; did you mean width?"),
        ("widht'", "has no widht'; did you mean width?"),
        ("xx'", "has no xx'; did you mean x'?"),
        ("x" + 3 * "'", "no such derivative is used (it has x, x')"),
    ],
)
def test_unknown_names_offer_what_is_near_or_what_there_is(
    solution: stc.Solution, name: str, message: str
) -> None:
    with pytest.raises(KeyError) as caught:
        solution[name]
    assert message in str(caught.value)


def test_a_spec_is_solved_to_be_validated() -> None:
    report = validate("particle_waypoints")
    assert report.passed and report.spec == "particle_waypoints"
    solution = stc.load("particle_waypoints").solve()
    assert report.to_dict()["metrics"] == validate(solution).to_dict()["metrics"]
    assert certify("particle_waypoints").passed
    assert assert_physical("particle_waypoints", limits={"open-loop drift": 1e-6}).passed
    with pytest.raises(AssertionError, match="there is no spec `nowhere`"):
        assert_physical("nowhere")


def test_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (block,) = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    names: dict[str, Any] = {}
    exec(block, names)
    assert names["solution"].variables == ["x", "a", "u"]
    assert names["again"].constants["umax"] == 20.0


def test_the_page_names_all_that_a_solution_has(solution: stc.Solution) -> None:
    section = PAGE.read_text().split("## `Solution`")[1]
    # Of use to those who write files alone.
    beside = {"trajectories", "stc_version", "origin"}
    missing = [one.name for one in fields(solution) if f"`{one.name}" not in section]
    assert set(missing) <= beside
    for name in set(re.findall(r"^\| `(\w+)", section, re.MULTILINE)) - {"solution"}:
        assert hasattr(solution, name), name


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_lines_of_a_text_end_as_those_of_files_may(ending: str) -> None:
    lines = [
        "constants: n = 0; # nothing but this",
        "variables: x;",
        "constraints: x = 4;",
        "objective: x^2;",
    ]
    solution = stc.load(ending.join(lines)).solve()
    assert solution.objective == pytest.approx(16.0)
    assert solution.source == "\n".join(lines)
