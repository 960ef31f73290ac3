"""What statements cost, against solving again with each of them moved a little."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import stc
from stc.studies.explain import explain, frames_in_words

STEP = 1e-4

# Each statement has a constant of its own that moves its end, so that solving again measures what it costs.
POINT = """constants: n = 0, a = 0, b = 0, c = 0, d = 0, e = 0;
variables: x, y, z;
constraints:
  x^2 + y^2 <= 2 + a;
  2*x >= 2 + b;
  y - z = c;
  -z <= 5 + d;
  -1 <= x*z <= 0.5 + e;
objective: (x - 3)^2 + (y - 4)^2 + z;
"""

SLIDE = """constants: n = 8, h = 1/n, a = 0, b = 0, c = 0, d = 0, e = 0;
variables: x, v, u;
constraints:
  [0, n]: x' = v + a;
  v' = u - 0.3*v^2 + b;
  -6 <= u <= 6 + c;
  [0]: x; v;
  [n]: x = 1 + d; v;
  [2, 6]: v^2 + 0.1*u <= 2 + e;
objective: integral(u^2);
method: hermite-simpson;
"""


def measured(model: stc.Model, name: str, sign: float) -> float:
    """The change of the least objective per unit, by central differences of two more solves."""
    ends = [model.solve(tolerance=1e-10, **{name: sign * s * STEP}).objective for s in (1.0, -1.0)]
    return float((ends[0] - ends[1]) / (2 * STEP))


@pytest.mark.parametrize(
    ("spec", "constants"),
    [
        (
            POINT,
            {"x^2 + y^2 <= 2 + a": "a", "2*x >= 2 + b": "b", "y - z = c": "c", "-1 <= x*z <= 0.5 + e": "e"},
        ),
        (
            SLIDE,
            {
                "x' = v + a": "a",
                "v' = u - 0.3*v^2 + b": "b",
                "-6 <= u <= 6 + c": "c",
                "x = 1 + d": "d",
                "v^2 + 0.1*u <= 2 + e": "e",
            },
        ),
    ],
    ids=["point", "slide"],
)
def test_sensitivities_are_what_solving_again_shows(spec: str, constants: dict[str, str]) -> None:
    model = stc.load(spec)
    found = explain(model, model.solve(tolerance=1e-10))
    costs = {(one.statement, one.end): one.change for one in found.sensitivities}
    tested = 0
    for statement, name in constants.items():
        for end, sign in (("equality", 1.0), ("upper", 1.0), ("lower", -1.0)):
            if (statement, end) in costs and not (end == "lower" and "<=" in statement):
                assert costs[statement, end] == pytest.approx(measured(model, name, sign), rel=2e-3), (
                    statement
                )
                tested += 1
    assert tested >= 3


def test_what_costs_nothing_is_left_out() -> None:
    model = stc.load(POINT)
    found = explain(model, model.solve())
    assert "-z <= 5 + d" not in {one.statement for one in found.sensitivities + found.active}
    assert all(one.change <= 0.0 for one in found.active)
    sizes = [abs(one.change) for one in found.sensitivities]
    assert sizes == sorted(sizes, reverse=True)


def test_active_frames_are_where_the_end_is_reached() -> None:
    model = stc.load(SLIDE)
    solution = model.solve()
    found = {(one.statement, one.end): one for one in explain(model, solution).active}
    active = found["-6 <= u <= 6 + c", "upper"]
    u = solution.channel("u")
    at_end = {float(k) for k in range(9) if abs(u.after[k] - 6) < 1e-6}
    assert u.mid is not None
    at_end |= {k + 0.5 for k in range(8) if abs(u.mid[k] - 6) < 1e-6}
    assert set(active.frames) == at_end
    assert active.frame in at_end


def test_an_inequality_that_touches_and_costs_nothing() -> None:
    model = stc.load("constants: n = 0; variables: x; constraints: x >= 1; objective: (x - 1)^2;")
    (only,) = explain(model, model.solve()).active
    assert only.weakly
    assert only.change == pytest.approx(0.0, abs=1e-6)


def test_the_tighter_of_two_bounds_costs() -> None:
    model = stc.load("constants: n = 0; variables: x; constraints: x >= 1; 3*x >= 6; objective: x^2;")
    found = explain(model, model.solve())
    # x = 2; 3x may be 5 instead of 6: x^2 falls by 2x/3.
    assert [(one.statement, one.change) for one in found.sensitivities] == [
        ("3*x >= 6", pytest.approx(-4 / 3, rel=1e-6))
    ]


def test_only_optimal_solutions_are_explained() -> None:
    model = stc.load(POINT)
    with pytest.raises(stc.UsageError, match="only an optimal solution"):
        explain(model, model.solve(max_iterations=0))


def test_frames_in_words() -> None:
    assert frames_in_words([0, 0.5, 1, 1.5, 7, 9]) == "0-1.5, 7, 9"
    assert frames_in_words(range(0, 20, 2)) == "0, 2, 4, 6, ..."


def test_explain_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from stc.cli.main import run

    monkeypatch.chdir(tmp_path)
    Path("point.stc").write_text(POINT)
    assert run(["solve", "point.stc", "--explain"]) == 0
    out = capsys.readouterr().out
    assert "Active inequalities" in out
    assert "point.stc:4:3" in out
    assert run(["solve", "point.stc", "--explain", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert {one["statement"] for one in record["active"]} >= {"x^2 + y^2 <= 2 + a"}
    assert record["sensitivities"][0]["change"] == pytest.approx(
        explain(stc.load(POINT), stc.load(POINT).solve()).sensitivities[0].change, rel=1e-6
    )
