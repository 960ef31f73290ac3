"""Rows that say the same: which of them are kept is decided where the motion goes through."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import stc
from stc.language.model.independence import independent


def _rates(place: np.ndarray) -> np.ndarray:
    """How the velocity of a place of a rigid body changes with the body's velocity and angular velocity: (3, 6)."""
    x, y, z = place
    return np.hstack([np.eye(3), np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])])


def test_rows_of_a_level_sole_hold_it_in_every_way_that_two_points_can() -> None:
    heel, toe = np.array([-0.1, 0.0, -0.05]), np.array([0.2, 0.0, -0.05])
    a, b = 0.3, 0.2
    tilted = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]]) @ np.array(
        [[np.cos(b), -np.sin(b), 0], [np.sin(b), np.cos(b), 0], [0, 0, 1]]
    )
    rows, given = _rates(tilted @ toe), _rates(tilted @ heel)
    seen = _rates(toe), _rates(heel)
    kept = independent(rows, given, seen)
    assert len(kept) == 2
    # Two points leave nothing but the turn about the line through them.
    held = np.vstack([seen[1], seen[0][kept]])
    assert np.linalg.matrix_rank(held) == 5


def test_a_plank_on_two_points_stands(tmp_path: Path) -> None:
    model = """<mujoco><worldbody><geom type="plane" size="2 2 .1"/>
    <body name="leg" pos="0 0 .5"><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
      <joint name="pitch" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 .4" size=".05"/>
      <body name="sole"><joint name="ankle" axis="0 1 0"/>
        <geom type="box" size=".2 .05 .02" pos="0.05 0 -.05"/></body></body>
    </worldbody><actuator><motor name="ankle" joint="ankle"/></actuator></mujoco>"""
    spec = """constants: n = 10, T = 0.5, h = T/n;
model: "plank.xml";
contact:
  heel = point(body.sole, -0.15, 0, -0.07);
  toe = point(body.sole, 0.25, 0, -0.07);
  [0, n]: heel; toe;
poses: lean = keyframe.reference grounded, joint.pitch = 0.1, joint.ankle = -0.1;
constraints: [0]: lean; rest;  [n]: lean; rest;
objective: [0, n]: integral(effort);
"""
    (tmp_path / "plank.xml").write_text(model, encoding="utf-8")
    (tmp_path / "plank.stc").write_text(spec, encoding="utf-8")
    solution = stc.load(tmp_path / "plank.stc").solve(max_iterations=150)
    assert solution.status == "optimal"
