"""How far contact points move while they stand, along motions that are known in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from closed_form_motions import nodes, solution_of

from stc.solution import ReplayChannel, Solution
from stc.trajectory import Channel
from stc.validate.contact_drift import contact_drift, drift_metrics, drift_notes, slips
from stc.validate.replay import Replay
from stc.validate.verdict import open_setup

MODEL = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
  <body name="crate" pos="0 0 .2"><joint name="x" type="slide" axis="1 0 0"/>
    <joint name="turn" axis="0 0 1"/><geom name="sole" type="box" size=".3 .4 .2" mass="1"/></body>
  <body name="wheel" pos="2 0 .1"><joint name="way" type="slide" axis="1 0 0"/><joint name="roll" axis="0 1 0"/>
    <geom name="tyre" type="sphere" size=".1" mass="1"/></body>
  </worldbody></mujoco>"""

METHOD = "hermite-simpson"
TIME = np.linspace(0.0, 2.0, 21)


def motion(folder: Path, **speeds: float) -> Solution:
    """Joints that move at constant speeds; both bodies are pressed on from frame 5 to frame 15."""
    (folder / "bodies.xml").write_text(MODEL)

    def joint(name: str) -> ReplayChannel:
        speed = speeds.get(name, 0.0)
        curves = (lambda t: speed * t, lambda t: speed + 0 * t, lambda t: 0 * t)
        return ReplayChannel("joint", (name,), *(nodes(METHOD, TIME, curve) for curve in curves))

    frames = np.arange(21)
    acts = ((frames > 5) & (frames < 15)).astype(float)
    inside = ((frames[:-1] >= 5) & (frames[:-1] < 15)).astype(float)
    force = Channel(acts, acts, inside)
    lines = [joint(name) for name in ("x", "turn", "way", "roll")]
    lines += [ReplayChannel("contact", ("geom", geom, "fz"), force) for geom in ("sole", "tyre")]
    return solution_of(METHOD, TIME, {}, lines, model="bodies.xml", directory=str(folder))


def drifts(folder: Path, **speeds: float) -> dict[str, float]:
    stands = contact_drift(open_setup(motion(folder, **speeds)))
    assert {(stand.first, stand.last) for stand in stands} == {(5, 15)}
    return {stand.name: stand.drift for stand in stands}


def test_what_stands_does_not_move(tmp_path: Path) -> None:
    assert max(drifts(tmp_path).values()) < 1e-15


def test_a_crate_that_creeps_is_measured_from_where_it_was_first_pressed_on(tmp_path: Path) -> None:
    assert drifts(tmp_path, x=0.03)["geom.sole"] == pytest.approx(0.03, rel=1e-9)


def test_the_corners_of_a_sole_move_where_it_turns(tmp_path: Path) -> None:
    """A chord of half a radian's thousandth, half a metre from the axis."""
    assert drifts(tmp_path, turn=0.01)["geom.sole"] == pytest.approx(0.5 * 0.01, rel=1e-4)


@pytest.mark.parametrize(("roll", "slip"), [(3.0, 0.0), (2.0, 0.1)])
def test_a_wheel_may_roll_and_what_it_slips_counts(tmp_path: Path, roll: float, slip: float) -> None:
    assert drifts(tmp_path, way=0.3, roll=roll)["geom.tyre"] == pytest.approx(slip, abs=1e-12)


def test_what_moves_too_far_is_told_with_its_frames(tmp_path: Path) -> None:
    stands = contact_drift(open_setup(motion(tmp_path, x=0.03)))
    (sole, tyre) = drift_metrics(stands)
    assert (sole.subject, sole.unit) == ("geom.sole, frames 5 to 15", "m")
    assert tyre.value == 0.0
    (note,) = drift_notes(stands)
    assert note.startswith("geom.sole stands on frames 5 to 15 and moves by 0.03 m until frame 15")
    assert drift_notes(contact_drift(open_setup(motion(tmp_path, x=1e-4)))) == []


def test_a_contact_that_slips_in_a_replay_is_found_with_its_frame(tmp_path: Path) -> None:
    """A crate that slips by 0.3 mm in each frame from frame 5 on, and a wheel that rolls as far: joints in order."""
    setup = open_setup(motion(tmp_path))
    positions, velocities = np.zeros((21, 4)), np.zeros((21, 4))
    positions[:, 0] = positions[:, 2] = 3e-4 * np.clip(np.arange(21) - 5, 0, None)
    positions[:, 3] = positions[:, 2] / 0.1
    velocities[5:] = [3e-3, 0.0, 3e-3, 3e-2]
    replayed = Replay("rk4", 1e-3, positions, velocities, np.zeros((21, 0)), TIME, positions)
    (slip,) = slips(setup, replayed, ())
    assert (slip.name, slip.body, slip.first, slip.frame) == ("geom.sole", "crate", 5, 9)
    velocities[:, 3] = 0.0  # the wheel is braked
    assert [slip.name for slip in slips(setup, replayed, ())] == ["geom.sole", "geom.tyre"]
