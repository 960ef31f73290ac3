"""Controls that alternate from node to node: found, and gone where the remedy is taken; others left alone."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import stc
from stc.cli.main import run

TURNPIKE = """
constants: n = 100, T = 2, h = T/n;
variables: x, u;
constraints:
  [0,n]: x' = u; -1 <= u <= 1;
  [0]: x = 1; [n]: x = 1/2;
objective: [0,n]: integral(x^2);
method: {method};
"""
# Jacobson, Gershwin & Lele (1970): a singular arc of the second order.
SECOND_ORDER = """
constants: n = 100, T = 5, h = T/n;
variables: x1, x2, u;
method: {method};
constraints:
  [0, n]: x1' = x2; x2' = u; -1 <= u <= 1;
  [0]: x1 = 0; x2 = 1;
objective: [0, n]: integral(x1^2 + x2^2);
"""
# Fishing as much as the stock bears (Clark 1976): bang, singular, bang.
FISHING = """
constants: n = 120, T = 10, h = T/n;
variables: x, w, p;
method: {method};
guess: x = 0.6; w = 0.2;
constraints:
  [0, n]: x' = x*(1 - x) - x*w; p' = (1 - 0.3/x)*w*x; 0 <= w <= 1;
  [0]: x = 0.9; p; [n]: x >= 0.5;
objective: [n]: -p;
"""
# Two controls of which only the sum is felt.
SHARED = """
constants: n = 60, T = 3, h = T/n;
variables: x, v, u;
method: {method};
constraints:
  [0, n]: x' = v + u; -1 <= u <= 1; v' = -v;
  [0]: x = 1; v = 0.5; [n]: x = 0.2;
objective: [0, n]: integral(x^2 + 0.5*x^4);
"""
RINGING = [
    (text, method)
    for text in (TURNPIKE, SECOND_ORDER, FISHING, SHARED)
    for method in ("hermite-simpson", "trapezoidal")
]


def names(text):
    return "w" if "w, p" in text else "u"


@pytest.mark.parametrize(("text", "method"), RINGING)
def test_the_remedy_ends_what_is_told_of(text, method):
    text = text.format(method=method)
    solution = stc.load(text).solve()
    control = names(text)
    change = np.abs(np.diff(solution[control]))
    found = solution.ringing()
    if not found:  # nothing rings on this grid: then the control does not alternate either
        second = np.diff(np.sign(np.diff(solution[control])[change > 0.05 * np.ptp(solution[control])]))
        assert (second != 0).sum() < 10
        return
    (one,) = found
    assert one.variable == control
    assert re.search(rf"\b{control}\b", one.statement) and "<text>:" in one.place
    assert one.change > 0.05 * np.ptp(solution[control])
    first, last = one.frames[0]
    assert 0 <= first < last <= solution.n
    cured = stc.load(text.replace("objective:", f"objective: {one.term} ", 1)).solve()
    assert cured.status == "optimal"
    assert cured.ringing() == []
    assert cured.objective == pytest.approx(solution.objective, rel=2e-3)


@pytest.mark.parametrize("method", ["hermite-simpson", "trapezoidal"])
def test_the_singular_arc_of_a_turnpike_is_named(method):
    solution = stc.load(TURNPIKE.format(method=method)).solve()
    assert solution.objective == pytest.approx(3 / 8, rel=1e-3)
    (one,) = solution.ringing()
    assert one.variable == "u" and one.statement == "x' = u" and one.change > 0.5
    assert all(49 <= first < last <= 77 for first, last in one.frames)  # the arc is from 1 s to 1.5 s
    cured = stc.load(TURNPIKE.format(method=method).replace("objective:", f"objective: {one.term}")).solve()
    arc = (cured.time > 1.1) & (cured.time < 1.4)
    assert np.abs(cured["u"][arc]).max() < 0.05  # where it is 0


@pytest.mark.parametrize("method", ["hermite-simpson", "trapezoidal"])
def test_switching_and_swinging_controls_do_not_ring(method):
    switching = """
    constants: n = 60, k = 40;
    parameters: T;
    definitions: h = T/n;
    variables: x, v, u;
    guess: T = 4;
    constraints: [0, n]: x' = v; v' = u - k*x; -1 <= u <= 1; [0]: x = 0.2; v; 0.1 <= T <= 20; [n]: x; v;
    objective: [0]: T;
    """
    assert stc.load(switching).solve(method=method).ringing() == []
    swinging = """
    constants: n = 80, T = 8, h = T/n;
    variables: x, u;
    constraints: [0, n]: x' = u; [0]: x;
    objective: [0, n]: integral((x - sin(7*t))^2 + 1e-6*u^2);
    """
    assert stc.load(swinging).solve(method=method).ringing() == []


def test_the_bundled_motions_do_not_ring():
    for name in (
        "cart_pole_swing_up",
        "arm_reach",
        "luxo_jump",
        "particle_jet",
        "luxo_two_jumps",
        "segment_flip",
    ):
        assert stc.load(name).solve().ringing() == []


def test_the_command_line_tells_it(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "turnpike.stc").write_text(TURNPIKE.format(method="hermite-simpson"))
    assert run(["solve", "turnpike.stc"]) == 0
    told = capsys.readouterr().err
    assert "note: u in `x' = u` (turnpike.stc:5:10) alternates" in told and "integral(" in told
    assert run(["solve", "turnpike.stc", "--json"]) == 0
    record = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert record["ringing"][0]["variable"] == "u" and record["status"] == "optimal"
    assert run(["solve", "cart_pole_swing_up", "--json"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["ringing"] == []
