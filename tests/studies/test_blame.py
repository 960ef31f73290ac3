"""Who is to blame: conflicts against linear programming, and what stands out against what was put there."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog

import stc
from stc.studies.blame import Blame, blame


def blamed(spec: str, **options: object) -> Blame:
    """The blame for a spec that does not solve."""
    model = stc.load(spec)
    found = blame(model, model.solve(**options))  # type: ignore[arg-type]
    assert found is not None
    return found


# ------------------------------------------------------------- conflicts


def _feasible(matrix: np.ndarray, rhs: np.ndarray, which: tuple[int, ...]) -> bool:
    rows = list(which)
    answer = linprog(np.zeros(matrix.shape[1]), matrix[rows], rhs[rows], bounds=(None, None), method="highs")
    return bool(answer.status == 0)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("seed", range(12))
def test_conflicts_of_linear_inequalities_are_irreducible(seed: int) -> None:
    rng = np.random.default_rng(seed)
    while True:  # whole numbers, some of them zero: bounds and rows, several conflicts at once
        matrix = rng.integers(-2, 3, (7, 3)).astype(float)
        rhs = rng.integers(-4, 3, 7).astype(float)
        if (np.abs(matrix).sum(axis=1) > 0).all() and not _feasible(matrix, rhs, tuple(range(7))):
            break
    statements = [
        " + ".join(f"({a:g})*{name}" for a, name in zip(row, "xyz") if a) + f" <= {b:g}"
        for row, b in zip(matrix, rhs)
    ]
    spec = (
        "constants: n = 0; variables: x, y, z; objective: x^2; constraints:\n" + ";\n".join(statements) + ";"
    )
    found = blamed(spec)
    guilty = tuple(sorted(one.line - 2 for one in found.culprits))
    assert found.minimal
    assert "near here" not in found.summary  # of a convex set it is a proof
    assert not _feasible(matrix, rhs, guilty)
    for fewer in itertools.combinations(guilty, len(guilty) - 1):
        assert _feasible(matrix, rhs, fewer)


CIRCLES = """constants: n = 0;
variables: x, y;
constraints:
  x^2 + y^2 = 1;
  (x - 4)^2 + y^2 = 1;
  x >= -10;
  y <= x + 20;
objective: x;
"""


def test_two_circles_apart() -> None:
    found = blamed(CIRCLES)
    assert [(one.line, one.column) for one in found.culprits] == [(4, 3), (5, 3)]
    # On the other circle the nearest point is 3 away from the centre: 3^2 - 1 is missing.
    assert [one.residual for one in found.culprits] == pytest.approx([8.0, 8.0], rel=1e-6)
    assert "misses by 8 when the others hold" in str(found)


TOO_FAR = """constants: n = 20, h = 1/10;
variables: x, u;
constraints:
  [0, n]: x' = u;
  -1 <= u <= 1;
  [0]: x = 0;
  [n]: x = 3;
  [n/2]: x <= 2;
objective: integral(u^2);
method: trapezoidal;
"""


def test_a_motion_that_cannot_get_there() -> None:
    found = blamed(TOO_FAR)
    assert found.minimal
    missing = {one.statement: one for one in found.culprits}
    assert set(missing) == {"x' = u", "-1 <= u <= 1", "x = 0", "x = 3"}
    # Two seconds at speed one lead to 2: 1 is missing at the end, below; speed 3/2 would do.
    assert (missing["x = 3"].residual, missing["x = 3"].frame) == (pytest.approx(-1.0, rel=1e-6), 20.0)
    assert abs(missing["-1 <= u <= 1"].residual or 0.0) == pytest.approx(0.5, rel=1e-6)


def test_any_one_statement_less_and_the_motion_gets_there() -> None:
    for text in ("[0, n]: x' = u;", "-1 <= u <= 1;", "[0]: x = 0;", "[n]: x = 3;"):
        assert stc.load(TOO_FAR.replace(text, "")).solve().status == "optimal", text


def test_statements_that_say_the_same_are_not_blamed_alone() -> None:
    spec = """constants: n = 3, h = 1; variables: x, y; constraints: x*y + y <= 1; [1, n]: x*y + y <= 1;
    [2]: x*y + y >= 2; objective: x^2 + y^2;"""
    found = blamed(spec)
    assert found.minimal
    assert len(found.culprits) == 2
    assert {one.statement for one in found.culprits} == {"x*y + y <= 1", "x*y + y >= 2"}


def test_a_statement_that_nothing_can_meet() -> None:
    spec = "constants: n = 0; variables: x, y; constraints: x^2 + y^2 = -1; x*y <= 3; objective: x;"
    found = blamed(spec)
    assert found.summary.startswith("This statement cannot hold")
    (only,) = found.culprits
    assert (only.statement, only.residual) == ("x^2 + y^2 = -1", pytest.approx(1.0))


def test_bounds_that_contradict_each_other() -> None:
    found = blamed(
        "constants: n = 2, h = 1; variables: x; constraints: x >= 2;\n[1]: 2*x <= 2; objective: x^2;"
    )
    assert [(one.statement, one.line) for one in found.culprits] == [("x >= 2", 1), ("2*x <= 2", 2)]
    assert [one.frame for one in found.culprits] == [1.0, 1.0]
    # x lacks 1; twice x lacks twice that.
    assert [abs(one.residual or 0.0) for one in found.culprits] == pytest.approx([1.0, 2.0])


SWING_UP = """constants: n = 80, g = 9.81, umax = 3;
variables: q, u;
parameters: T;
definitions: h = T/n;
guess: T = 4; q = pi*t/4;
constraints:
  [0, n]: q'' + g*sin(q) = u; -umax <= u <= umax;
  [0]: q = 0; q' = 0;
  [n]: q = pi; q' = 0;
  1 <= T <= 10;
objective: [0]: T;
method: trapezoidal;
"""


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("umax", [0.1, 0.3])
def test_statements_that_a_motion_at_rest_meets_are_not_called_a_conflict(umax: float) -> None:
    model = stc.load(SWING_UP)
    found = blame(model, model.solve(umax=umax))
    assert found is not None and "cannot hold together" in found.summary
    # Hanging still for a second meets all statements but the one that asks for the top, which stands in every conflict.
    assert "q = pi" in {one.statement for one in found.culprits}
    # What misses by nothing when the others hold would show that all of them can.
    missed = {one.statement: one for one in found.culprits if one.residual is not None}
    assert len(missed) >= 4
    assert all(abs(one.residual or 0.0) > 1e-3 for one in missed.values())
    assert all(one.frame is None for name, one in missed.items() if "T" in name)


@pytest.mark.nightly
def test_a_limit_that_is_named_is_enough_when_it_gives_way_by_the_amount_named() -> None:
    """In 0.3 s the cart cannot swing its pendulum up with 20 N; the time is not enough for a minimal set."""
    model = stc.load("cart_pole_swing_up")
    found = blame(model, model.solve(T=0.3), time_limit=2.0)
    assert found is not None
    (lack,) = [abs(one.residual or 0.0) for one in found.culprits if one.statement == "-umax <= u <= umax"]
    assert model.solve(T=0.3, umax=20 + 1.01 * lack).status == "optimal"
    assert model.solve(T=0.3, umax=20 + 0.9 * lack).status == "infeasible"


def test_the_search_keeps_to_its_time() -> None:
    model = stc.load(TOO_FAR)
    solution = model.solve()
    found = blame(model, solution, time_limit=1e-6)
    assert found is not None
    assert found.seconds < 2.0
    assert found.minimal is not True


def test_nothing_to_blame() -> None:
    model = stc.load("constants: n = 0; variables: x; objective: (x - 1)^2;")
    assert blame(model, model.solve()) is None


# -------------------------------------------------------------- standouts


def _kinds(found: Blame, kind: str) -> list[str]:
    return [one.statement for one in found.culprits if one.kind == kind]


def test_the_worst_residual_and_its_frame() -> None:
    spec = """constants: n = 10, h = 1; variables: x, y; guess: x = 1; y = 1; [7]: y = 100;
    constraints: x*y = 1; x + y <= 50; objective: x^2 + y^2;"""
    found = blamed(spec, max_iterations=0)
    assert _kinds(found, "residual") == ["x*y = 1", "x + y <= 50"]
    assert [(one.residual, one.frame) for one in found.culprits[:2]] == [(99.0, 7.0), (51.0, 7.0)]


def test_dependent_statements() -> None:
    spec = """constants: n = 0; variables: x, y, z; guess: x = 2; y = 0.5; z = 1;
    constraints: x*y = 1; x^2*y^2 = 1; x + z = 7; y - z^2 = 3; objective: x^2 + 3*y^2;"""
    # Where both hold, the second one's gradient is twice the first one's.
    found = blamed(spec, max_iterations=0)
    assert set(_kinds(found, "dependent")) == {"x*y = 1", "x^2*y^2 = 1"}


def test_independent_statements_are_not_called_dependent() -> None:
    spec = """constants: n = 40, h = 1; variables: x, y; guess: x = 1; y = 2;
    constraints: [1, n]: x*y = x[i-1]; [0]: x = 1; objective: x^2 + 3*y^2;"""
    assert _kinds(blamed(spec, max_iterations=0), "dependent") == []


def test_a_statement_without_slope() -> None:
    spec = """constants: n = 0; variables: x, y; guess: x = 0; y = 0;
    constraints: x^2 + y^2 = 0; x + y <= 3; objective: x;"""
    assert _kinds(blamed(spec, max_iterations=0), "dependent") == ["x^2 + y^2 = 0"]


def test_values_that_end_nearby() -> None:
    spec = """constants: n = 4, h = 1; variables: x, y; guess: x = 1; [2]: x = 0.001;
    constraints: log(x) + y = 1; x + y >= -5; objective: x^2 + y^2;"""
    found = blamed(spec, max_iterations=0)
    (only,) = [one for one in found.culprits if one.kind == "undefined"]
    assert (only.statement, only.frame) == ("log(x) + y = 1", 2.0)


# ------------------------------------------------------------ command line


def test_the_command_line_names_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import json

    from stc.cli.main import run

    monkeypatch.chdir(tmp_path)
    Path("circles.stc").write_text(CIRCLES)
    assert run(["solve", "circles.stc"]) == 1
    out = capsys.readouterr().out
    assert "These 2 statements cannot hold together, at least near here; without" in out
    assert "circles.stc:4:3: `x^2 + y^2 = 1` misses by 8 when the others hold" in out
    assert run(["solve", "circles.stc", "--json"]) == 1
    record = json.loads(capsys.readouterr().out)
    assert record["blame"]["minimal"] is True
    assert [one["line"] for one in record["blame"]["culprits"]] == [4, 5]


def test_a_solve_that_ends_with_all_statements_met_is_told_to_go_on() -> None:
    spec = """constants: n = 10, T = 1, h = T/n; variables: x, u;
      constraints: [0, n]: x' = u; [0]: x = 0; [n]: x = 1; objective: [0, n]: integral(exp(u^2) + u^4);"""
    found = blamed(spec, max_iterations=2)
    assert not found.culprits
    assert found.summary.startswith("All statements hold where the solve ended")
