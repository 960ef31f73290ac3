"""Rows that say the same: which of them are kept is decided where the motion goes through."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stc
from stc.language.model.independence import independent
from stc.validate import validate


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


def _on_planar_legs(legs: dict[str, tuple[float, float]]) -> str:
    """A trunk with a free root on legs that have a hip and a knee, none of which can spread."""
    limbs, motors = "", ""
    for name, (x, y) in legs.items():
        limbs += f"""<body name="thigh_{name}" pos="{x} {y} -.02"><joint name="hip_{name}" range="-90 90"/>
          <geom type="capsule" fromto="0 0 0 0 0 -.18" size=".03" mass=".5"/>
          <body name="shin_{name}" pos="0 0 -.18"><joint name="knee_{name}" range="0 140"/>
            <geom type="capsule" fromto="0 0 0 0 0 -.18" size=".02" mass=".3"/>
            <geom name="{name}" type="sphere" pos="0 0 -.18" size=".03" mass=".1"/></body></body>"""
        motors += f'<motor joint="hip_{name}" name="hip_{name}" ctrlrange="-40 40"/>'
        motors += f'<motor joint="knee_{name}" name="knee_{name}" ctrlrange="-40 40"/>'
    return f"""<mujoco><option cone="elliptic" impratio="100" timestep="0.001"/>
      <default><joint axis="0 1 0" armature="0.005" damping="0.05"/>
        <geom friction="0.8 0.005 0.0001" solref="0.0004 1"/></default>
      <worldbody><geom type="plane" size="5 5 .1"/><body pos="0 0 .42"><freejoint name="root"/>
        <geom type="capsule" fromto="-.12 0 0 .12 0 0" size=".06" mass="3"/>{limbs}</body></worldbody>
      <actuator>{motors}</actuator></mujoco>"""


@pytest.mark.nightly
@pytest.mark.parametrize(("hips", "far"), [((0.0,), 0.1), ((-0.2, 0.2), 0.12)], ids=["two feet", "four feet"])
def test_robots_hop_whose_legs_hold_their_feet_apart(
    hips: tuple[float, ...], far: float, tmp_path: Path
) -> None:
    """Where both feet of a pair stand, no motion of the legs can move them apart: one holds the other across."""
    legs = {
        f"{side}{k}": (x, 0.07 * sign) for k, x in enumerate(hips) for side, sign in (("l", 1), ("r", -1))
    }
    stand = "".join(f", joint.hip_{leg} = -0.385, joint.knee_{leg} = 0.7" for leg in legs)
    spec = f"""constants: n = 72, T = 1.2, h = T/n;
model: "robot.xml";
contact:
  {" ".join(f"{leg} = point(geom.{leg}), friction = 0.7, landing = 5, sudden;" for leg in legs)}
  [0, 5*n/12]: {" ".join(f"{leg};" for leg in legs)}
  [7*n/12, n]: {" ".join(f"{leg};" for leg in legs)}
poses: stand = keyframe.reference{stand};
constraints: [0]: stand grounded; rest;  [n]: stand + ({far}, 0, 0) grounded; rest;
objective: [0, n]: integral(effort); integral(1e-4*joint.*''^2);
"""
    (tmp_path / "robot.xml").write_text(_on_planar_legs(legs), encoding="utf-8")
    (tmp_path / "hop.stc").write_text(spec, encoding="utf-8")
    solution = stc.load(tmp_path / "hop.stc").solve(max_iterations=150)
    assert solution.status == "optimal"
    assert validate(solution).passed
