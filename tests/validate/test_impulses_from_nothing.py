"""Impulses at the first and last frame, where no replay goes through the jump: something must be there to give them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import nodes, solution_of

from stc.solution import ReplayChannel, Solution
from stc.trajectory import Channel
from stc.validate import validate
from stc.validate.impacts import velocity_jumps
from stc.validate.setup import prepare

#: A box of 0.4 m by 0.4 m by 0.2 m and 1 kg, whose lowest place for z is at a stop.
BOX = """<mujoco><option gravity="0 0 0" timestep="0.001"/><worldbody>
  <geom name="floor" type="plane" size="5 5 0.1" friction="0.5"/>
  <body name="box" pos="0 0 0.1"><inertial pos="0 0 0" mass="1" diaginertia="0.02 0.04 0.02"/>
    <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1" {stop}/>
    <joint name="p" axis="0 1 0"/>
    <geom type="box" size="0.2 0.2 0.1" friction="0.5" {contact}/></body></worldbody></mujoco>"""

JOINTS = ("x", "z", "p")
BODY = tuple(("body", "box", part) for part in ("fx", "fz", "my"))


def jumps_at(
    folder: Path,
    frame: int,
    jump: tuple[float, float, float],
    lines: tuple[tuple[str, ...], ...] = BODY,
    height: float = 0.0,
    stop: str = "",
    contact: str = "",
) -> Solution:
    """A box at rest until, or that comes to rest after, its velocities jump at the first or last frame."""
    (folder / "box.xml").write_text(BOX.format(stop=stop, contact=contact))
    time = np.linspace(0, 0.1, 6)
    nothing = nodes("trapezoidal", time, lambda t: 0 * t)
    replay = []
    for name, start, change in zip(JOINTS, (0.0, height, 0.0), jump):
        before, after = np.zeros(6), np.zeros(6)
        (after if frame else before)[frame] = change if frame else -change
        position = nodes("trapezoidal", time, lambda t, start=start: start + 0 * t)
        replay.append(ReplayChannel("joint", (name,), position, Channel(before, after), nothing))
    replay += [ReplayChannel("contact", path, nothing) for path in lines]
    return solution_of("trapezoidal", time, {}, replay, model="box.xml", directory=str(folder))


def unfounded(solution: Solution) -> float | None:
    jumps = velocity_jumps(prepare(solution))
    assert jumps is not None
    assert jumps.share.max() < 1e-14  # the lines give any impulse
    return jumps.unfounded


@pytest.mark.parametrize("frame", [0, 5])
@pytest.mark.parametrize("lines", [BODY, (("joint", "z"),)])
def test_what_is_in_the_air_gets_none(tmp_path: Path, frame: int, lines: tuple[tuple[str, ...], ...]) -> None:
    solution = jumps_at(tmp_path, frame, (0.0, 2.0, 0.0), lines, height=0.5)
    assert unfounded(solution) == pytest.approx(1.0)
    row = next(
        m for m in validate(solution).metrics if m.name == "unexplained impulse, no contact point gives it"
    )
    assert row.verdict == "fail"
    assert unfounded(jumps_at(tmp_path, frame, (0.0, 2.0, 0.0), lines)) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("lines", [BODY, (("joint", "z"),)])
def test_the_floor_does_not_pull(tmp_path: Path, lines: tuple[tuple[str, ...], ...]) -> None:
    assert unfounded(jumps_at(tmp_path, 5, (0.0, -1.0, 0.0), lines)) == pytest.approx(1.0)


@pytest.mark.parametrize("lines", [BODY, tuple(("joint", name) for name in JOINTS)])
@pytest.mark.parametrize(
    ("press", "spin", "possible"),
    [
        # 0.04 kg m^2 times the spin, about a middle that is 0.2 m from the edges: at most 0.2 m times the press.
        (1.0, 4.9, True),
        (1.0, 5.1, False),
        (0.0, 5.0, False),
    ],
)
def test_a_moment_is_a_press_off_the_middle(
    tmp_path: Path, lines: tuple[tuple[str, ...], ...], press: float, spin: float, possible: bool
) -> None:
    found = unfounded(jumps_at(tmp_path, 5, (0.0, press, spin), lines))
    assert found is not None
    assert (found < 1e-12) == possible
    assert (found > 1e-3) != possible


@pytest.mark.parametrize(("slip", "possible"), [(0.5, True), (0.51, False)])
def test_in_a_plane_friction_is_exact(tmp_path: Path, slip: float, possible: bool) -> None:
    """At the sole 0.1 m below the middle, which the pitch takes: 0.04 kg m^2 times it."""
    solution = jumps_at(tmp_path, 5, (slip, 1.0, -0.1 * slip / 0.04))
    found = unfounded(solution)
    assert found is not None
    assert (found < 1e-9) == possible


@pytest.mark.parametrize(
    ("height", "change", "possible"), [(0.5, 1.0, True), (0.5, -1.0, False), (0.7, 1.0, False)]
)
def test_a_stop_pushes_away_from_itself(tmp_path: Path, height: float, change: float, possible: bool) -> None:
    stop = 'limited="true" range="0.5 2"'
    found = unfounded(jumps_at(tmp_path, 5, (0.0, change, 0.0), (("joint", "z"),), height, stop))
    assert found == pytest.approx(0.0 if possible else 1.0, abs=1e-12)


def test_where_no_geom_can_touch_that_is_told_alone(tmp_path: Path) -> None:
    solution = jumps_at(tmp_path, 5, (0.0, 1.0, 0.0), contact='contype="0" conaffinity="0"')
    assert unfounded(solution) is None


#: A ball on one slide, on a floor with friction.
BALL = """<mujoco><option timestep="0.001"/><worldbody><geom type="plane" size="5 5 0.1"/>
  <body name="ball" pos="0 0 0.1"><inertial pos="0 0 0" mass="1" diaginertia="0.004 0.004 0.004"/>
    <joint name="z" type="slide" axis="{axis}"/><geom type="sphere" size="0.1"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("axis", ["0 0 1", "0.6 0 0.8"])
@pytest.mark.parametrize(("height", "possible"), [(0.0, True), (0.4, False)])
def test_a_model_may_have_one_coordinate(tmp_path: Path, axis: str, height: float, possible: bool) -> None:
    (tmp_path / "box.xml").write_text(BALL.format(axis=axis))
    time = np.linspace(0, 0.1, 6)
    nothing = nodes("trapezoidal", time, lambda t: 0 * t)
    position = nodes("trapezoidal", time, lambda t: height + 0 * t)
    before, after = np.zeros(6), np.zeros(6)
    before[0] = -1.0
    replay = [ReplayChannel("joint", ("z",), position, Channel(before, after), nothing)]
    replay.append(ReplayChannel("contact", ("body", "ball", "fz"), nothing))
    found = unfounded(solution_of("trapezoidal", time, {}, replay, model="box.xml", directory=str(tmp_path)))
    assert found == pytest.approx(0.0 if possible else 1.0, abs=1e-9)


#: A weight on a rope that hangs from 2 m above, 1 m long.
ROPE = """<mujoco><worldbody><geom type="plane" size="5 5 0.1"/><site name="top" pos="0 0 2"/>
  <body name="b" pos="0 0 1"><inertial pos="0 0 0" mass="1" diaginertia="0.004 0.004 0.004"/>
    <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/><site name="ring"/></body>
  </worldbody><tendon><spatial limited="true" range="0 1"><site site="top"/><site site="ring"/></spatial></tendon>
  </mujoco>"""


@pytest.mark.parametrize(
    ("place", "change", "possible"),
    [
        ((0.0, 0.0), (0.0, 1.0), True),
        ((0.0, 0.0), (0.0, -1.0), False),
        ((0.0, 0.1), (0.0, 1.0), False),
        ((0.6, 0.2), (-0.6, 0.8), True),
        ((0.6, 0.2), (0.6, 0.8), False),
    ],
)
def test_a_taut_rope_pulls(
    tmp_path: Path, place: tuple[float, float], change: tuple[float, float], possible: bool
) -> None:
    (tmp_path / "box.xml").write_text(ROPE)
    time = np.linspace(0, 0.1, 6)
    nothing = nodes("trapezoidal", time, lambda t: 0 * t)
    replay = []
    for name, start, jump in zip("xz", place, change):
        position = nodes("trapezoidal", time, lambda t, start=start: start + 0 * t)
        rate = np.zeros(6)
        rate[5] = jump
        replay.append(ReplayChannel("joint", (name,), position, Channel(np.zeros(6), rate), nothing))
    replay += [ReplayChannel("contact", ("joint", name), nothing) for name in "xz"]
    found = unfounded(solution_of("trapezoidal", time, {}, replay, model="box.xml", directory=str(tmp_path)))
    assert found is not None
    assert (found < 1e-9) == possible
    assert (found > 1e-1) != possible
