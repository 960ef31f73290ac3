"""Statements between the frames, on motions whose curves are known."""

from __future__ import annotations

import numpy as np
import pytest
from closed_form_motions import solution_of

from stc.pipeline import load
from stc.solution import Solution
from stc.solution_restated import problem_of
from stc.statements_between import ELSEWHERE, check_statements
from stc.trajectory import Channel
from stc.validate.limits import BETWEEN_SHARES
from stc.validate.statements import StatementCheck, statement_metrics

SHARES = np.array(BETWEEN_SHARES)


def motion(text: str, method: str = "trapezoidal", **more: object) -> Solution:
    """x = t^2 at four frames from 0 to 3 s, its first derivative 2t; y = 1 everywhere."""
    time = np.arange(4.0)
    mid = time[:-1] + 0.5 if method == "hermite-simpson" else None

    def channel(values: np.ndarray, at_mid: np.ndarray | None) -> Channel:
        return Channel.smooth(values, at_mid)

    trajectories = {
        ("x", 0): channel(time**2, None if mid is None else mid**2),
        ("x", 1): channel(2 * time, None if mid is None else 2 * mid),
        ("y", 0): channel(0 * time + 1, None if mid is None else 0 * mid + 1),
    }
    facts: dict[str, object] = {"constants": {"n": 3.0, "h": 1.0, "c": 2.0}, "source": text, **more}
    return solution_of(method, time, trajectories, [], None, **facts)  # type: ignore[arg-type]


def checked(constraints: str, method: str = "trapezoidal") -> dict[str, StatementCheck]:
    text = f"constants: n = 3, h = 1, c = 2; variables: x, y; constraints: {constraints} method: {method};"
    solution = motion(text, method)
    return {check.text: check for check in check_statements(problem_of(solution), solution)}


def test_an_inequality_is_looked_at_between_the_frames() -> None:
    """x <= 3t - 2 + 0.1 holds at frames 1 and 2, and x = t^2 in between lies farther below."""
    found = checked("[1, 2]: x <= 3*t - 1.9; [1, 2]: x >= 3*t - 2.1;")
    below, above = found["x <= 3*t - 1.9"], found["x >= 3*t - 2.1"]
    assert below.share == 0.0
    # By how much of what is compared there.
    assert above.share == pytest.approx(
        max((3 * t - 2.1 - t**2) / max(t**2, 3 * t - 2.1) for t in 1 + SHARES)
    )
    assert above.time in 1 + SHARES
    assert not above.equality
    assert above.place.startswith("by_hand.stc:1:")


def test_both_bounds_and_both_kinds_of_statement_count() -> None:
    found = checked("-c <= y <= 0.5; y = c/2; y = 1.5;")
    assert found["-c <= y <= 0.5"].share == pytest.approx(0.5 / 2)
    assert found["y = c/2"].share == 0.0
    assert found["y = c/2"].equality
    assert found["y = 1.5"].share == pytest.approx(0.5 / 1.5)


def test_ranges_and_ranged_definitions_are_kept() -> None:
    found = checked("[0, 2]: x <= top; definitions: [0, 0]: top = 1; [1, n]: top = 100; constraints:")
    assert found["x <= top"].share == 0.0
    found = checked("x <= top; definitions: [0, 1]: top = 100; [2, n]: top = 5; constraints:")
    worst = (2 + SHARES[-1]) ** 2
    assert found["x <= top"].share == pytest.approx((worst - 5) / worst)


def test_derivatives_of_the_curve_are_used() -> None:
    found = checked("x' = 2*t; x' <= 5;")
    assert found["x' = 2*t"].share == pytest.approx(0.0, abs=1e-15)
    assert found["x' <= 5"].share == pytest.approx((2 * (2 + SHARES[-1]) - 5) / (2 * (2 + SHARES[-1])))


def test_what_cannot_be_evaluated_is_left_out() -> None:
    """Single frames, other frames, derivatives that the solution does not have."""
    found = checked("[1]: x = 1; [0, 2]: x[i+1] >= x; x >= x[0]; y <= 3;")
    assert list(found) == ["y <= 3"]


def test_states_are_held_against_sizes_nearby_and_distances_against_distances() -> None:
    """x = t^2 goes up to 9, but what it breaks while it is small is not small beside that."""
    found = checked("x >= 0.2; (x - 2)^2 >= 0.25; x - 0.5*x' >= 0; y >= 1.2;")
    places = np.concatenate([step + SHARES for step in range(3)])
    largest = ELSEWHERE * max(places**2)
    assert found["x >= 0.2"].share == pytest.approx((0.2 - min(SHARES) ** 2) / largest)
    away = np.abs(places**2 - 2.0)
    scale = np.maximum(np.maximum(away, 0.5), ELSEWHERE * max(away))
    assert found["(x - 2)^2 >= 0.25"].share == pytest.approx(max((0.5 - away) / scale))
    # x' has no derivative that is known here: it may leap.
    below = max(places - places**2)
    assert found["x - 0.5*x' >= 0"].share == pytest.approx(below / max(places**2))
    assert found["y >= 1.2"].share == pytest.approx(0.2 / 1.2)


@pytest.mark.parametrize("method", ["central", "trapezoidal", "hermite-simpson"])
def test_every_method_is_looked_at(method: str) -> None:
    model = load(
        "constants: n = 6, h = 1/n; variables: x; constraints: [0]: x; x'; [n]: x = 1; x'; [0, n]: x'' >= -7;"
        f"objective: [0, n]: integral(x''^2); method: {method};"
    )
    solution = model.solve()
    (check,) = check_statements(problem_of(solution), solution)
    assert check.text == "x'' >= -7"
    assert check.share < 1e-6


def test_long_motions_are_worked_through_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = checked("x <= 5; y = 1.5;")
    monkeypatch.setattr("stc.statements_between._CHUNK", 1)
    assert checked("x <= 5; y = 1.5;") == whole


def test_the_worst_statements_become_metrics() -> None:
    checks = [
        StatementCheck("a <= 1", "f.stc:1:1", False, 0.5, 0.1),
        StatementCheck("b <= 1", "f.stc:2:1", False, 0.001, 0.2),
        StatementCheck("c <= 1", "f.stc:3:1", False, 0.3, 0.3),
        StatementCheck("d = 1", "f.stc:4:1", True, 0.2, 0.4),
        StatementCheck("e = 1", "f.stc:5:1", True, 0.1, 0.5),
    ]
    metrics = statement_metrics(checks, "hermite-simpson")
    assert [(m.subject, m.verdict) for m in metrics] == [
        ("f.stc:1:1: a <= 1 at t = 0.1 s", "fail"),
        ("f.stc:3:1: c <= 1 at t = 0.3 s", "fail"),
        ("f.stc:4:1: d = 1 at t = 0.4 s", "info"),
    ]
    quiet = statement_metrics([StatementCheck("a <= 1", "f.stc:1:1", False, 0.0, 0.0)], "central")
    assert [(m.subject, m.verdict) for m in quiet] == [("every inequality", "pass")]
    assert statement_metrics([], "central") == []
