"""More frames until the verdict is passed, and frame numbers as shares of n."""

from __future__ import annotations

import pytest
from planted_faults import text_of

import stc
from stc.studies.frames import Spread, in_shares
from stc.studies.passing import solve_until_passed
from stc.validate import validate


def test_frames_are_added_until_the_motion_passes() -> None:
    found = solve_until_passed(stc.load("arm_reach", n=16))
    assert found.message == "" and found.solution is not None
    assert validate(found.solution).passed
    assert [one.excess > 1.0 for one in found.attempts] == [True] * (len(found.attempts) - 1) + [False]
    assert found.effort.solves == len(found.attempts) == 2


def test_plain_frame_numbers_keep_their_share() -> None:
    text = text_of("arm_reach").replace("n = 60", "n = 16")
    assert "[n]:" in text
    found = solve_until_passed(stc.load(text.replace("[n]:", "[16]:")))
    same = solve_until_passed(stc.load(text))
    assert found.message == same.message == ""
    assert found.solution is not None and same.solution is not None
    assert found.solution.n == same.solution.n > 16
    assert found.solution.objective == pytest.approx(same.solution.objective, rel=1e-9)


def test_what_frames_cannot_correct_ends_it() -> None:
    wrong = text_of("arm_reach_by_hand").replace("(I2 + m2*d2^2)*a2''", "(2*I2 + m2*d2^2)*a2''")
    found = solve_until_passed(stc.load(wrong, n=16))
    assert "more frames cannot correct" in found.message and "inverse-dynamics" in found.message
    assert len(found.attempts) == 1


def test_a_motion_that_passes_is_solved_once() -> None:
    model = stc.load("arm_reach")
    found = solve_until_passed(model, start=model.solve())
    assert (found.message, found.effort.solves) == ("", 0)


def test_shares_are_written_for_plain_numbers_alone() -> None:
    text = """constants: n = 20, h = 0.1;
variables: x, y;
constraints:
  [0]: x; y;  [1]: x >= 0;                    # 5 is no frame here
  for k in 4..5: [5]: y >= {k};
  [ 5, 15 ]: x >= 5;  x[5] <= 10 + y[n - 5];  [20]: x = 20;
objective: [0, n]: integral(x''^2 + y''^2);
"""
    model = in_shares(stc.load(text))
    assert model.text.splitlines()[3:6] == [
        "  [0]: x; y;  [1]: x >= 0;                    # 5 is no frame here",
        "  for k in 4..5: [5*n/20]: y >= {k};",
        "  [ 5*n/20, 15*n/20 ]: x >= 5;  x[5*n/20] <= 10 + y[n - 5];  [20*n/20]: x = 20;",
    ]
    assert in_shares(model) is model


def test_a_spec_in_shares_states_the_same_motion_on_more_frames() -> None:
    text = """constants: n = 10, T = 1, h = T/n;
variables: x;
constraints: [0]: x; x';  [4]: x = 1;  [n]: x';
objective: [0, n]: integral(x''^2);
method: hermite-simpson;
"""
    coarse, model = stc.load(text).solve(), in_shares(stc.load(text))
    assert Spread.of(model, None, {}).finer([3]) == {"n": 30}
    fine = model.solve(n=30)
    # The optimum is a cubic on either side of the waypoint, which the method has exactly.
    assert fine["x"][12] == pytest.approx(1.0, abs=1e-9)
    assert fine.objective == pytest.approx(coarse.objective, rel=1e-9)
