"""Warnings of poses at rest: a lever on a foot, whose moments and centre of mass are known in closed form."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from .bodies import load

FOOT, LEVER, LENGTH, G = 2.0, 3.0, 0.5, 9.81  # kg, kg, m, m/s^2
REACH = 0.1  # m from the ankle to the heel and to the toe


def lever(most: float, joint: str = "", gear: float = 10.0) -> str:
    """A point mass on a light lever, whose ankle's motor gives ``most`` N m, on a foot with four corners."""
    return f"""<mujoco><compiler autolimits="true"/><option gravity="0 0 {-G}"/>
      <worldbody><geom name="floor" type="plane" size="5 5 1"/>
        <body name="foot" pos="0 0 0.02"><freejoint name="root"/>
          <geom name="sole" type="box" size="{REACH} 0.05 0.02" mass="{FOOT}"/>
          <body name="lever"><joint name="ankle" axis="0 1 0" {joint}/>
            <inertial pos="0 0 {LENGTH}" mass="{LEVER}" diaginertia="1e-3 1e-3 1e-3"/></body></body></worldbody>
      <actuator><motor name="ankle" joint="ankle" gear="{gear}" ctrlrange="{-most / gear} {most / gear}"/></actuator>
    </mujoco>"""


SPEC = """constants: n = 10, T = 0.5, h = T/n, lean = {lean};
contact: {contact}
poses: lean_over = keyframe.reference, joint.ankle = lean;
constraints: [0]: lean_over; {rest} [n]: joint.ankle = 0.3;"""
SOLE = "sole = foot(geom.sole); [0, n]: sole;"
POINTS = "".join(
    f"c{k} = point(body.foot, {x}, {y}, -0.02), friction = 0.5; "
    for k, (x, y) in enumerate(((REACH, 0.05), (REACH, -0.05), (-REACH, 0.05), (-REACH, -0.05)))
)
STANDING = {
    "a sole": SOLE,
    "points": POINTS + "[0, n]: c0; c1; c2; c3;",
    "free points": POINTS + "free: c0; c1; c2; c3;",
}


def told(folder: Path, model: str, lean: float, contact: str = SOLE, rest: str = "rest;") -> list[str]:
    """The warnings of a page that begins with the lever leaning over, in rad."""
    page = load(folder, model, SPEC.format(lean=lean, contact=contact, rest=rest))
    return [warning.message for warning in page.problem().warnings]


@pytest.mark.parametrize("contact", STANDING.values(), ids=STANDING)
def test_a_motor_is_told_of_by_the_moment_that_it_lacks(tmp_path: Path, contact: str) -> None:
    needed = LEVER * G * LENGTH * math.sin(0.3)
    assert told(tmp_path, lever(1.1 * needed), 0.3, contact) == []
    (message,) = told(tmp_path, lever(0.5 * needed), 0.3, contact)
    assert message == (
        f"`actuator.ankle` cannot hold this pose at rest: it needs {needed:.3g} N m and has {0.5 * needed:.3g} N m"
    )


@pytest.mark.parametrize("contact", STANDING.values(), ids=STANDING)
def test_a_centre_of_mass_is_told_of_that_is_beside_what_stands(tmp_path: Path, contact: str) -> None:
    def beside(lean: float) -> float:
        return LEVER * LENGTH * abs(math.sin(lean)) / (FOOT + LEVER) - REACH

    lean = -math.asin((REACH + 0.03) * (FOOT + LEVER) / (LEVER * LENGTH))
    assert beside(lean) == pytest.approx(0.03)
    (message,) = told(tmp_path, lever(1e3), lean, contact)
    assert "centre of mass is 30 mm beside" in message
    assert "by (-30, 0) mm" in message
    assert beside(0.3) < -0.01
    assert told(tmp_path, lever(1e3), 0.3, contact) == []


def test_nothing_is_said_where_a_spring_helps_or_nothing_is_at_rest(tmp_path: Path) -> None:
    needed = LEVER * G * LENGTH * math.sin(0.3)
    weak = 0.5 * needed
    assert len(told(tmp_path, lever(weak), 0.3)) == 1
    assert told(tmp_path, lever(weak), 0.3, rest="") == []
    assert told(tmp_path, lever(weak, f'stiffness="{0.6 * needed / 0.3}" springref="0"'), 0.3) == []
    assert told(tmp_path, lever(weak, f'frictionloss="{0.6 * needed}"'), 0.3) == []
    assert told(tmp_path, lever(weak), 0.3, contact="sole = foot(geom.sole); [n, n]: sole;") == []
