"""Geoms that touch although the spec has no contact: they are named, and the growth that they cause excuses nothing."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import nodes, particle, solution_of

from stc.solution import ReplayChannel, Solution
from stc.validate.certificate import certify
from stc.validate.verdict import open_setup, run_replays

BALL = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 0.1"/>
  <body name="particle" pos="0 0 0.1"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
    <geom name="ball" type="sphere" size="0.1" condim="1"/></body></worldbody>
  <actuator><motor name="fx" joint="x"/><motor name="fz" joint="z"/></actuator></mujoco>"""


def dips(folder: Path, lowest: float, phase: float = 0.0, lines: Sequence[ReplayChannel] = ()) -> Solution:
    """A ball that goes aside, and down and up again: 0.2 m above its lowest place, times a cosine."""
    (folder / "ball.xml").write_text(BALL)
    time, w = np.linspace(0, 1, 41), 2 * np.pi
    x = [nodes("trapezoidal", time, lambda t, k=k: (t**2, 2 * t, 2 + 0 * t)[k]) for k in range(3)]
    z = [
        nodes(
            "trapezoidal",
            time,
            lambda t, k=k: w**k * 0.1 * np.cos(w * t + phase + k * np.pi / 2) + (k == 0) * (lowest + 0.1),
        )
        for k in range(3)
    ]
    facts = {"violation": 0.0, "optimality": 0.0, "directory": str(folder)}
    return particle("trapezoidal", time, x, z, model="ball.xml", lines=lines, **facts)


def test_what_touches_is_named_and_excuses_nothing(tmp_path: Path) -> None:
    certificate = certify(dips(tmp_path, -5e-3))
    assert not certificate.passed
    line = "geoms floor and ball touch at t = 0.45 s, which no `contact` line mentions"
    assert line in certificate.notes
    (step,) = certificate.next_steps
    assert step.startswith(line)
    growth = next(m.value for m in certificate.metrics if m.name == "growth of small errors")
    assert growth == pytest.approx(1.0, abs=0.2)  # nothing in a particle's motion is unstable
    assert not any(note.startswith("unstable") for note in certificate.notes)


def test_what_stays_clear_is_not(tmp_path: Path) -> None:
    certificate = certify(dips(tmp_path, 5e-3))
    assert certificate.passed
    assert not any("touch" in note for note in certificate.notes)


def test_what_grazes_in_the_solution_strikes_in_the_replay(tmp_path: Path) -> None:
    """The method's error, 0.1 mm on the way down, takes the ball into the floor: no instability of its motion."""
    certificate = certify(dips(tmp_path, 0.0, np.pi / 2))
    line = "geoms floor and ball come within 1 mm and touch in the replay, not in the solution, at t = "
    assert any(note.startswith(line) for note in certificate.notes)
    assert not any(note.startswith("unstable") for note in certificate.notes)
    if not certificate.passed:
        assert certificate.next_steps[0].startswith(line)


def until(last: float) -> ReplayChannel:
    """The ground presses on the ball with 1 N up to a time in s, and then no more: from there on it swings."""
    force = nodes("trapezoidal", np.linspace(0, 1, 41), lambda t: (t <= last).astype(float))
    return ReplayChannel("contact", ("body", "particle", "fz"), force)


def test_a_foot_that_scrapes_the_floor_while_it_swings_is_named(tmp_path: Path) -> None:
    """The contact line ends at frame 8; the ball is inside the floor around its lowest place, at frame 20."""
    certificate = certify(dips(tmp_path, -5e-3, lines=[until(0.2)]))
    inside = np.flatnonzero(0.1 * np.cos(2 * np.pi * np.linspace(0, 1, 41)) + 0.1 - 5e-3 < 0.0)
    line = (
        f"geoms floor and ball touch in frames {inside[0]} to {inside[-1]}, from t = {inside[0] / 40:.4g} s on, where "
        "the solved contact force on body particle is zero"
    )
    assert not certificate.passed
    assert line in certificate.headline
    (step,) = [step for step in certificate.next_steps if step.startswith(line)]
    assert "clearance" in step and f"`[{inside[0]}, {inside[-1]}]: z >= 0.01;`" in step


@pytest.mark.parametrize(("lowest", "last"), [(5e-3, 0.2), (-5e-3, 1.0)])
def test_one_that_stays_clear_or_is_pressed_is_not(tmp_path: Path, lowest: float, last: float) -> None:
    certificate = certify(dips(tmp_path, lowest, lines=[until(last)]))
    assert certificate.replays.touching == []
    assert "geoms" not in certificate.headline


CART = """<mujoco><worldbody><geom type="plane" size="5 5 .1"/>
  <body name="cart" pos="0 0 1"><joint name="c" type="slide" axis="1 0 0"/>
    <geom type="box" size="0.2 0.2 0.1" mass="2"/></body>
  <body name="far" pos="3 0 0.049"><freejoint/><geom type="sphere" size="0.05" mass="0.1"/></body>
  <body pos="4 0 1"><joint axis="0 1 0"/><geom type="sphere" size="0.05" mass="0.1"/></body></worldbody>
  <actuator><motor name="u" joint="c"/></actuator></mujoco>"""


def test_what_the_spec_does_not_move_may_touch_and_is_named_where_it_has_no_name(tmp_path: Path) -> None:
    (tmp_path / "cart.xml").write_text(CART)
    time = np.linspace(0, 0.5, 11)
    way = [nodes("trapezoidal", time, lambda t, k=k: (t**2, 2 * t, 2 + 0 * t)[k]) for k in range(3)]
    lines = [
        ReplayChannel("joint", ("c",), *way),
        ReplayChannel("actuator", ("u",), nodes("trapezoidal", time, lambda t: 4 + 0 * t)),
    ]
    setup = open_setup(solution_of("trapezoidal", time, {}, lines, model="cart.xml", directory=str(tmp_path)))
    assert run_replays(setup, tracked=False).touching == []
    note = "joints without a `joint` line start at rest in the model's initial position: far, body3"
    assert note in setup.notes()
