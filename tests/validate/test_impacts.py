"""Impulses that a contact can give: they press, and lie in the cone of the friction of what is touched."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import particle

from stc.solution import ReplayChannel, Solution
from stc.trajectory import Channel
from stc.validate import validate
from stc.validate.impacts import velocity_jumps
from stc.validate.setup import prepare

MODEL = """<mujoco><option gravity="0 0 0" timestep="0.002"/><worldbody>
  <geom type="plane" size="5 5 0.1" friction="0.5"/>{more}
  <body name="particle" pos="0 0 {height}"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
    <geom type="sphere" size="0.1" friction="0.5" condim="{condim}"/></body></worldbody>
  <actuator><motor name="fx" joint="x"/><motor name="fz" joint="z"/></actuator></mujoco>"""


def struck(
    folder: Path, before: tuple[float, float], after: tuple[float, float], more: str = "", height: float = 0.1
) -> Solution:
    """A ball that moves steadily, is struck once it is where the model has it, and moves steadily again."""
    condim = 1 if "condim" in more else 3
    (folder / "ball.xml").write_text(MODEL.format(more=more, height=height, condim=condim))
    time, hit = np.linspace(0, 0.2, 9), 4
    ahead = time - time[hit]
    nothing = Channel.smooth(0 * time)
    coordinates = []
    for u, v in zip(before, after):
        earlier = np.arange(9) < hit
        rate = Channel(np.where(np.arange(9) <= hit, u, v), np.where(earlier, u, v))
        coordinates.append([Channel.smooth(np.where(earlier, u, v) * ahead), rate, nothing])
    lines = [ReplayChannel("contact", ("body", "particle", part), nothing) for part in ("fx", "fz")]
    x, z = coordinates
    return particle("trapezoidal", time, x, z, g=0.0, lines=lines, model="ball.xml", directory=str(folder))


@pytest.mark.parametrize(
    ("before", "after", "outside"),
    [
        ((0.0, -2.0), (0.0, 1.0), 0.0),  # bounces
        ((2.0, -2.0), (0.6, 1.0), 0.0),  # loses 1.4 along the floor to a press of 3
        ((0.0, 0.0), (0.0, -1.0), 1.0),  # is pulled down
        ((0.0, 2.0), (0.0, 1.0), 1.0 / 2.0),  # is held back on its way up
        # Loses 1 along the floor to a press of 1: the nearest impulse in the cone is (0.6, 1.2).
        ((2.0, -1.0), (1.0, 0.0), 0.4 / 2.0),
        (
            (2.0, 0.0),
            (1.0, 0.0),
            1.0 / 2.0 * 0.8,
        ),  # slides and slows down with no press: (0.2, 0.4) is nearest
    ],
)
def test_the_floor_presses_and_rubs(
    tmp_path: Path, before: tuple[float, float], after: tuple[float, float], outside: float
) -> None:
    jumps = velocity_jumps(prepare(struck(tmp_path, before, after)))
    assert jumps is not None
    assert jumps.share.max() < 1e-14  # the two lines together give any impulse
    assert jumps.outside_share == pytest.approx(outside, abs=1e-12)


def test_a_wall_takes_what_the_floor_does_not(tmp_path: Path) -> None:
    wall = '<geom type="box" pos="0.2 0 0.5" size="0.1 1 0.6" friction="0.5"/>'
    jumps = velocity_jumps(prepare(struck(tmp_path, (2.0, -1.0), (0.0, 0.0), wall)))
    assert jumps is not None and jumps.outside_share == pytest.approx(0.0, abs=1e-12)


def test_without_friction_nothing_is_lost_along_the_floor(tmp_path: Path) -> None:
    ice = '<geom type="plane" size="5 5 0.1" friction="0.5" condim="1" pos="0 0 -1"/>'
    solution = struck(tmp_path, (2.0, -1.0), (1.9, 0.0), ice)
    model = (tmp_path / "ball.xml").read_text()
    (tmp_path / "ball.xml").write_text(model.replace('friction="0.5"/>', 'friction="0.5" condim="1"/>', 1))
    jumps = velocity_jumps(prepare(solution))
    assert jumps is not None and jumps.outside_share == pytest.approx(0.1 / 2.0)


def test_where_nothing_is_touched_nothing_is_said(tmp_path: Path) -> None:
    jumps = velocity_jumps(prepare(struck(tmp_path, (0.0, -1.0), (0.0, -2.0), height=1.0)))
    assert jumps is not None and jumps.outside_share is None


def test_a_force_at_a_site_is_one_on_its_body(tmp_path: Path) -> None:
    """The ball is pulled down at a site of its own."""
    solution = struck(tmp_path, (0.0, 0.0), (0.0, -1.0))
    model = (tmp_path / "ball.xml").read_text()
    (tmp_path / "ball.xml").write_text(
        model.replace("</body>", '<site name="sole" pos="0 0 -0.1"/></body>', 1)
    )
    solution.replay = [
        ReplayChannel("contact", ("site", "sole", line.path[2]), line.value)
        if line.kind == "contact"
        else line
        for line in solution.replay
    ]
    jumps = velocity_jumps(prepare(solution))
    assert jumps is not None and jumps.outside_share == pytest.approx(1.0)


def test_a_pulling_impulse_fails_the_motion(tmp_path: Path) -> None:
    report = validate(struck(tmp_path, (0.0, 2.0), (0.0, 1.0)), tracked=False)
    verdicts = {m.subject: m.verdict for m in report.metrics if m.name.startswith("unexplained impulse")}
    assert verdicts == {"joint x": "pass", "joint z": "pass", "all contacts": "fail"}
