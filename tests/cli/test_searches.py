"""``--continue``, ``--starts``, ``--refine``, ``--guess-from`` and ``--until-verified``, from the outside."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import stc
from stc import specs

Stc = Callable[..., tuple[int, str, str]]

CIRCLE = """
constants: n = 0, s = 0;
variables: x, y;
guess: x = 1; y = -1;
constraints: x^2 + y^2 = 1; x + y = s;
objective: y^2;
"""


@pytest.fixture
def stc_(stc_: Stc) -> Stc:
    """Runs a command line in a folder with ``circle.stc``."""
    Path("circle.stc").write_text(CIRCLE)
    return stc_


def rows(out: str) -> list[list[str]]:
    """The table above the result."""
    return [line.split() for line in out.split("\n\n")[0].splitlines()]


def test_a_walk_shows_every_solve_and_saves_the_last(stc_: Stc) -> None:
    status, out, err = stc_("solve", "particle_jet", "--continue", "g=0:9.8:2")
    assert (status, err) == (0, "")
    table = rows(out)
    assert table[0] == ["g", "status", "objective", "iterations"]
    assert [row[:2] for row in table[1:]] == [["0", "optimal"], ["4.9", "optimal"], ["9.8", "optimal"]]
    assert "in all       3 solves, " in out
    assert stc.read("particle_jet.npz").constants["g"] == 9.8


def test_an_exported_table_is_a_guess(stc_: Stc) -> None:
    assert stc_("solve", "particle_jet")[0] == 0
    assert stc_("export", "particle_jet.npz", "--format", "csv", "-o", "table.csv", "--rate", "37")[0] == 0
    assert Path("table.csv").read_text().split(",")[0] == "time"
    options = ("--guess-from", "table.csv", "--max-iterations", "0", "-o", "guess.npz")
    status, _, err = stc_("solve", "particle_jet", *options)
    assert (status, err) == (1, "")  # the time is not an unknown name, and no other time than the motion's
    solved, guessed = stc.read("particle_jet.npz"), stc.read("guess.npz")
    # Between the rows the table is linear.
    assert guessed["x"] == pytest.approx(solved["x"], abs=1e-2 * np.ptp(solved["x"]))


@pytest.mark.slow
def test_a_walk_that_stops_says_where_and_saves_the_last_good_solution(stc_: Stc) -> None:
    status, out, err = stc_("solve", "circle.stc", "--continue", "s=1.4:1.6:1", "-o", "a.npz", "--json")
    assert (status, err) == (1, "")
    saved = stc.read("a.npz")
    assert saved.status == "optimal"
    assert saved.constants["s"] == pytest.approx(np.sqrt(2), abs=2e-3)
    record = json.loads(out)
    assert record["status"] == "infeasible"
    assert "stopped at s = 1.41" in record["message"] and "ended infeasible" in record["message"]
    assert record["continuation"]["reached"] == saved.constants["s"]
    assert record["iterations"] == sum(step["iterations"] for step in record["continuation"]["steps"])


def test_starts_are_counted_by_the_optimum_they_lead_to(stc_: Stc) -> None:
    words = ("solve", "cart_pole_swing_up", "--set", "n=20", "--starts", "3", "--seed", "5")
    status, out, err = stc_(*words)
    assert status == 0, err
    table = rows(out)
    assert table[0][:2] == ["objective", "count"]
    assert sum(int(row[1]) for row in table[1:]) == 3
    best = stc.read("cart_pole_swing_up.npz")
    assert best.objective == pytest.approx(float(table[1][0]))
    # Seeded, and the same whatever the number of processes is.
    status, again, _ = stc_(*words, "--workers", "2", "-o", "again.npz")
    assert (status, rows(again)) == (0, table)
    np.testing.assert_array_equal(stc.read("again.npz").x, best.x)


def test_refining_ends_below_the_tolerance_or_says_why_not(stc_: Stc) -> None:
    status, out, err = stc_("solve", "cart_pole_swing_up", "--set", "n=20", "--refine", "1e-5")
    assert (status, err) == (0, "")
    table = rows(out)
    assert table[0] == ["n", "objective", "error", "iterations"]
    assert float(table[-1][2]) <= 1e-5 < float(table[1][2])
    assert stc.read("cart_pole_swing_up.npz").n == int(table[-1][0])

    path = specs.locate("cart_pole_swing_up")
    assert path is not None
    Path("fixed.stc").write_text(path.read_text().replace("  [0]: x; a;", "  [n - 7]: x <= 2; [0]: x; a;"))
    status, out, err = stc_("solve", "fixed.stc", "--refine", "1e-5")
    assert status == 1
    assert "note: --refine 1e-05 was not reached: the error is" in err
    assert "frame 43 of 50 would be frame " in err and "fixed.stc:" in err
    assert stc.read("fixed.npz").status == "optimal"


def test_searches_follow_each_other(stc_: Stc) -> None:
    words = ("--set", "n=20", "--continue", "umax=20:15:2", "--refine", "1e-4", "--json")
    status, out, _ = stc_("solve", "cart_pole_swing_up", *words)
    record = json.loads(out)
    assert status == 0
    assert record["continuation"]["arrived"] and record["refinement"]["reached"]
    levels = record["refinement"]["levels"]
    assert levels[0]["objective"] == record["continuation"]["steps"][-1]["objective"]
    assert stc.read("cart_pole_swing_up.npz").constants["umax"] == 15


def test_a_guess_is_read_by_name(stc_: Stc) -> None:
    t = np.linspace(0, 2, 51)
    table = np.column_stack([t, t / 2, np.pi * t / 2])
    np.savetxt("a.csv", table, delimiter=",", header="t,x,a", comments="")
    status, _, err = stc_("solve", "cart_pole_swing_up", "--guess-from", "a.csv")
    assert (status, err) == (0, "")
    np.savetxt("b.csv", table[:20], delimiter=",", header="t,x,a", comments="")
    status, _, err = stc_("solve", "cart_pole_swing_up", "--guess-from", "b.csv", "--max-iterations", "0")
    assert err.count("`b.csv` covers t = 0 to 0.76, the motion 0 to 2") == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--continue", "g=0"), "NAME=FIRST:LAST:STEPS"),
        (("--continue", "g=0:1:1.5"), "must be a whole number"),
        (("--continue", "g=0:1:inf"), "must be a whole number"),
        (("--continue", "g=1:inf"), "from one number to another, not from 1 to inf"),
        (("--continue", "g=-inf:0:3"), "from one number to another, not from -inf to 0"),
        (("--continue", "g=0:x"), "is not a number"),
        (("--continue", "G=0:1"), "no constant `G`\n  did you mean `g`?"),
        (("--continue", "g=1:1"), "goes nowhere"),
        (("--continue", "n=50:0"), "division by zero"),
        (("--continue", "n=20.5:30"), "has to be a whole number"),
        (("--continue", "g=0:1", "--set", "g=3"), "both give values to g"),
        (("--continue", "g=0:1", "--starts", "2"), "both choose the starts"),
        (("--starts", "0"), "at least 1"),
        (("--starts", "2", "--seed", "-1"), "0 or more"),
        (("--seed", "1"), "--seed can only be used with --starts"),
        (("--workers", "2"), "--workers can only be used with --starts"),
        (("--starts", "2", "--workers", "0"), "--workers must be at least 1"),
        (("--starts", "2", "--workers", "2", "--profile"), "--profile measures this process"),
        (("--starts", "2", "--warm-start", "a.npz"), "give one of them"),
        (("--guess-from", "a.csv", "--warm-start", "a.npz"), "give one of them"),
        (("--guess-from", "a.csv"), "no file `a.csv`"),
        (("--refine", "0"), "positive tolerance"),
    ],
)
def test_options_that_cannot_be_meant_are_refused(stc_: Stc, words: tuple[str, ...], message: str) -> None:
    status, out, err = stc_("solve", "cart_pole_swing_up", *words)
    assert (status, out) == (2, "")
    assert message in err
    assert not Path("cart_pole_swing_up.npz").exists()


def test_one_frame_cannot_be_refined(stc_: Stc) -> None:
    status, _, err = stc_("solve", "circle.stc", "--refine", "1e-3")
    assert status == 2
    assert "one frame only" in err


@pytest.mark.slow
def test_a_motion_is_run_until_it_is_verified(stc_: Stc) -> None:
    status, out, err = stc_(
        "run", "particle_waypoints", "--set", "n=8", "--set", "T=0.5", "--until-verified", "1e-9"
    )
    assert (status, err) == (0, "")
    assert rows(out)[0] == ["n", "objective", "drift", "of", "judged", "by", "iterations"]
    assert "in all       1 solve, " in out and "\npassed: " in out
    path = specs.locate("particle_waypoints")
    assert path is not None
    Path("wrong.stc").write_text(
        path.read_text()
        .replace("m*x'' = fx", "m*x'' = 1.1*fx")
        .replace("n = 60", "n = 8")
        .replace("T = 2", "T = 0.5")
    )
    status, out, err = stc_("run", "wrong.stc", "--until-verified", "1e-9")
    assert status == 1
    assert (
        "note: --until-verified 1e-09 was not reached: the equations of motion differ from the model's" in err
    )
    assert len(rows(out)) == 2
    status, _, err = stc_("run", "wrong.stc", "--until-verified", "1e-3", "--refine", "1e-3")
    assert (status, "give one of them" in err) == (2, True)
    status, out, err = stc_(
        "run", "particle_waypoints", "--set", "n=8", "--set", "T=0.5", "--until-verified", "1e-99"
    )
    assert status == 1
    assert "\npassed: " in out
    assert err.rstrip().endswith("note: the motion passed, but the search did not reach its goal")
    assert stc_("run", "wrong.stc", "--until-verified", "-1")[0] == 2


@pytest.mark.slow
def test_a_motion_is_run_until_it_passes(stc_: Stc) -> None:
    path = specs.locate("arm_reach")
    assert path is not None
    text = path.read_text().replace("n = 60", "n = 16").replace("[n]:", "[16]:")
    Path("reach.stc").write_text(text)
    status, out, _ = stc_("run", "reach.stc", "--until-passed")
    assert status == 0 and "\npassed: " in out
    assert [row[0] for row in rows(out)] == ["n", "16", "32"]
    # The file states the frames as shares, and is up to date nevertheless, until the spec is changed.
    assert stc_("validate", "reach.npz")[0] == 0
    Path("reach.stc").write_text(text.replace("[16]:", "[15]:"))
    status, out, err = stc_("validate", "reach.npz")
    assert status == 1 and "has changed since" in out + err
    assert stc_("run", "reach.stc", "--until-passed", "--refine", "1e-3")[0] == 2
