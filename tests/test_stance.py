"""The stance of a model: whether its motors hold a pose, and what of its feet touches the floor."""

from __future__ import annotations

import pytest

from stc.mechanism.read import read_model
from stc.stance import Stance

LIFT = """<mujoco><option gravity="0 0 -10"/><worldbody><geom type="plane" size="5 5 1"/>
  <body name="base" pos="0 0 .1"><joint type="slide" axis="0 0 1"/><joint type="slide" axis="1 0 0"/>
    <geom name="wheel" size=".1" mass="1"/>
    <body name="arm"><joint name="lift" axis="0 -1 0" stiffness="{spring}" springref="90"/>
      <geom size=".01" pos=".5 0 .4" mass="2" contype="0" conaffinity="0"/></body></body></worldbody>
  <actuator><motor joint="lift" ctrlrange="-1 1" gear="{gear}"/></actuator></mujoco>"""


@pytest.mark.parametrize(("spring", "gear", "held"), [(0, 10.1, True), (0, 9.9, False), (1, 8.5, True)])
def test_a_pose_is_held_by_motors_that_are_strong_enough(spring: float, gear: float, held: bool) -> None:
    """A weight of 20 N at 0.5 m takes 10 N m, less what a spring gives."""
    stance = Stance(read_model("lift.xml", text=LIFT.format(spring=spring, gear=gear)), [0.0, 0.0, 0.0])
    assert stance.holds(stance.start, stance.lowest(1e-3)) == held


def test_a_pose_is_held_by_friction_only_as_far_as_it_goes() -> None:
    """On a slope of which the tangent is the coefficient, and on one that is a little steeper."""
    for slope, held in ((0.49, True), (0.51, False)):
        text = f"""<mujoco><option gravity="{10 * slope} 0 -10"/><worldbody>
          <geom type="plane" size="5 5 1" friction=".5"/><body name="b"><joint type="slide" axis="0 0 1"/>
          <joint type="slide" axis="1 0 0"/><geom size=".1" friction=".5"/></body></worldbody></mujoco>"""
        stance = Stance(read_model("block.xml", text=text), [0.1, 0.0])
        assert stance.holds(stance.start, stance.lowest(1e-3)) == held


def test_a_sole_holds_by_its_edge() -> None:
    """A weight beside the middle of a box, above its sole and beyond that."""
    for beside, held in ((0.09, True), (0.11, False)):
        text = f"""<mujoco><worldbody><geom type="plane" size="5 5 1"/><body name="b" pos="0 0 .05"><freejoint/>
          <inertial pos="{beside} 0 .1" mass="1" diaginertia=".1 .1 .1"/>
          <geom name="sole" type="box" size=".1 .1 .05"/></body></worldbody></mujoco>"""
        model = read_model("sole.xml", text=text)
        stance = Stance(model, model.start)
        assert [spot.written for spot in stance.lowest(1e-3)] == ["foot(geom.sole)"]
        assert stance.holds(stance.start, stance.lowest(1e-3)) == held


FOOT = """<mujoco><worldbody><geom type="plane" size="5 5 1"/><body name="leg" pos="0 0 .3"><freejoint/>
  <geom size=".05"/><body name="foot" pos="0 0 -.2"><joint name="shift" type="slide"
    axis="1 0 0"/><joint name="ankle" axis="0 1 0" range="-60 60"/>
    <geom name="heel" size=".02" pos="-.05 0 -.05"/>
    <body name="toes" pos=".1 0 -.05"><joint name="toe" axis="0 1 0" range="-60 60"/>
      <geom name="left" size=".02" pos=".03 .03 -.02"/><geom name="right" size=".02" pos=".03 -.03 -.02"/></body>
  </body></body></worldbody><actuator><motor joint="ankle"/><motor joint="toe"/></actuator></mujoco>"""


def test_a_foot_stands_on_its_toes_or_on_the_whole_of_it() -> None:
    model = read_model("foot.xml", text=FOOT)
    stance = Stance(model, model.start)
    assert [spot.written for spot in stance.lowest(0.1)] == ["point(geom.left)", "point(geom.right)"]
    whole = {"point(geom.heel)", "point(geom.left)", "point(geom.right)"}
    assert {spot.written for spot in stance.lowest(0.1, whole=True)} == whole
    q, spots = stance.standing(0.1, whole=True)
    assert {spot.written for spot in spots} == whole
    assert q is not None
    places, centre = stance.seen(q[:, None], spots)
    assert places[2, :, 0] - places[2, 0, 0] == pytest.approx(0.0, abs=1e-6)
    assert centre[:2, 0] == pytest.approx(places[:2, :, 0].mean(axis=1), abs=1e-6)
