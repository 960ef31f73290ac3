"""Contacts with bodies that slide: each pushes the other, by closed forms and in MuJoCo."""

from __future__ import annotations

from pathlib import Path

import pytest

from stc.errors import SpecError
from stc.validate import validate

from .bodies import load

G, FORCE = 9.81, 40.0
STRIKER, STRUCK, PUSH = 0.5, 1.5, 5.0
STIFF = 'solref=".0004 1" friction=".5 .005 .0001"'
OPTION = '<option timestep="1e-4" integrator="RK4" impratio="10"/>'
#: Two bodies on rails. A motor pushes the first, whose ball is 0.4 m from the other one's face.
CARTS = f"""<mujoco><compiler angle="radian"/>{OPTION}<worldbody>
  <body name="striker" pos="-.6 0 0"><joint name="a" type="slide" axis="1 0 0"/>
    <geom name="ball" type="sphere" size=".1" mass="{STRIKER}" {STIFF}/></body>
  <body name="struck"><joint name="b" type="slide" axis="1 0 0"/>
    <geom name="block" type="box" size=".1 .1 .1" mass="{STRUCK}" {STIFF}/>
    <site name="face" pos="-.1 0 0" zaxis="-1 0 0"/></body></worldbody>
  <actuator><motor name="push" joint="a"/></actuator></mujoco>"""
COLLISION = f"""constants: n = 40, T = 0.4, h = T/n, F = {PUSH};
contact: ball = point(geom.ball);
  [n/2, n]: ball on site.face;
constraints: [0]: joint.a = 0; joint.b = 0; joint.b'; [0, n]: actuator.push = F;
"""
#: A ball on a platform that a motor lifts.
LIFT = f"""<mujoco><compiler angle="radian"/>{OPTION}<worldbody>
  <body name="table"><joint name="lift" type="slide" axis="0 0 1"/>
    <geom name="table" type="box" size="1 1 .1" mass="2" {STIFF}/></body>
  <body name="cargo" pos="0 0 .2"><joint name="z" type="slide" axis="0 0 1"/>
    <geom name="cargo" type="sphere" size=".1" mass="1" {STIFF}/></body></worldbody>
  <actuator><motor name="lift" joint="lift"/></actuator></mujoco>"""
CARRIED = f"""constants: n = 20, T = 0.5, h = T/n, F = {FORCE};
contact: cargo = point(geom.cargo);
  [0, n]: cargo on geom.table;
constraints: [0]: joint.lift = 0; joint.lift'; joint.z = 0; [0, n]: actuator.lift = F;
"""
#: A ball thrown along a floor without friction.
PUCK = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
  <body name="puck" pos="0 0 .1"><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
    <geom name="puck" type="sphere" size=".1" mass="1"/></body></worldbody></mujoco>"""


def test_a_collision_keeps_the_momentum(tmp_path: Path) -> None:
    """It begins so fast that it meets the other after 0.2 s; then both move on together: m v = (m + M) v'."""
    solution = load(tmp_path, CARTS, COLLISION).solve()
    assert solution.status == "optimal"
    half, mass = 0.2, STRIKER + STRUCK
    begin = 0.4 / half - PUSH / STRIKER * half / 2.0
    together = STRIKER * (begin + PUSH / STRIKER * half) / mass
    assert solution["joint.a'"][0] == pytest.approx(begin, rel=1e-9)
    for joint in ("a", "b"):
        assert solution[f"joint.{joint}'"][-1] == pytest.approx(together + PUSH / mass * half, rel=1e-9)
    assert solution["ball_fx"][-10:] == pytest.approx(-PUSH * STRUCK / mass, rel=1e-9)


def test_what_is_carried_presses_as_much_as_it_is_accelerated(tmp_path: Path) -> None:
    """The whole is lifted by F - (m + M) g, and the cargo alone by its contact: m F/(m + M)."""
    solution = load(tmp_path, LIFT, CARRIED).solve()
    assert solution.status == "optimal"
    assert solution["cargo_fz"] == pytest.approx(FORCE / 3.0, rel=1e-9)
    assert solution["joint.z"][-1] == pytest.approx((FORCE / 3.0 - G) * 0.5**2 / 2.0, rel=1e-9)
    assert validate(solution).passed


@pytest.mark.parametrize("stated", ["[0, n]: puck;", "free: puck;"])
def test_a_point_without_friction_glides(tmp_path: Path, stated: str) -> None:
    """Nothing acts along the floor, and nothing holds the point there."""
    spec = f"""constants: n = 20, T = 1, h = T/n; contact: puck = point(geom.puck), friction = 0; {stated}
      constraints: [0]: joint.x = 0; joint.x' = 1; joint.z = 0; joint.z' = 0;"""
    solution = load(tmp_path, PUCK, spec).solve()
    assert solution.status == "optimal"
    assert solution["joint.x"] == pytest.approx(solution.time, abs=1e-6)
    assert solution["puck_fz"][1:] == pytest.approx(G, rel=1e-4)


#: What is wrong, and what is told of it.
WRONG = {
    "[n/2, n]: ball on site.fase;": "the model has no site `fase`",
    "[n/2, n]: ball on body.struck;": "`body.struck` is not a surface",
    "[0, 5]: ball; [n/2, n]: ball on site.face;": "`ball` stands on what moves, and on another surface as well",
    "hook = pin(geom.ball); [n/2, n]: hook on site.face;": "a pin holds on to the world",
}


@pytest.mark.parametrize("written", WRONG)
def test_mistakes_are_told_of(tmp_path: Path, written: str) -> None:
    with pytest.raises(SpecError, match=WRONG[written]):
        load(tmp_path, CARTS, COLLISION.replace("[n/2, n]: ball on site.face;", written)).problem()


def test_a_site_that_turns_is_told(tmp_path: Path) -> None:
    model = CARTS.replace('name="b" type="slide" axis="1 0 0"', 'name="b" axis="0 0 1"')
    with pytest.raises(SpecError, match="the site `face` turns"):
        load(tmp_path, model, COLLISION).problem()
