"""More frames until the verdict is passed, and frame numbers as shares of n."""

from __future__ import annotations

from pathlib import Path

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


#: A drone with a parcel on a string.
DRONE = """<mujoco><worldbody><body name="drone" pos="0 0 1"><freejoint/>
  <geom type="box" size=".15 .15 .03" mass="1.2"/>
  <body name="string" pos="0 0 -.03"><joint name="swing" type="ball" damping=".002"/>
    <geom type="capsule" fromto="0 0 0 0 0 -.5" size=".005" mass=".02"/>
    <body pos="0 0 -.55"><geom type="box" size=".05 .05 .05" mass=".3"/></body></body>{sites}</body></worldbody>
  <actuator>{rotors}</actuator></mujoco>"""
DELIVERY = """constants: n = 60, T = 2.5, h = T/n;
model: "drone.xml";
constraints: [0]: keyframe.reference; rest; [n]: keyframe.reference + (2, 0.5, 0.5); rest;
objective: [0, n]: integral(effort);
"""


@pytest.mark.nightly
def test_a_drift_may_rise_while_the_grid_is_coarse(tmp_path: Path) -> None:
    """The drift of the string is 2.5 times its limit with 60 frames, 4.4 times with 120, and 0.6 times with 240."""
    corners = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    sites = "".join(f'<site name="r{k}" pos="{0.15 * x} {0.15 * y} 0"/>' for k, (x, y) in enumerate(corners))
    rotors = "".join(
        f'<motor site="r{k}" gear="0 0 1 0 0 {0.02 * x * y}" ctrlrange="0 8"/>'
        for k, (x, y) in enumerate(corners)
    )
    (tmp_path / "drone.xml").write_text(DRONE.format(sites=sites, rotors=rotors), encoding="utf-8")
    (tmp_path / "delivery.stc").write_text(DELIVERY, encoding="utf-8")
    found = solve_until_passed(stc.load(tmp_path / "delivery.stc"))
    assert found.message == "" and found.solution is not None
    assert validate(found.solution).passed


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
