"""What blame names is what is wrong: its numbers, put where it says, make the motion pass."""

from __future__ import annotations

import re

import pytest

import stc
from stc.certification import certify

MODEL = """
<mujoco><option gravity="0 0 -9.81"/><worldbody>
<body name="upper"><joint name="hip" axis="0 -1 0" damping="0.2" stiffness="1.5" armature="0.05"/>
<inertial pos="0 0 -0.4" mass="1.2" diaginertia="0.05 0.05 0.01"/>
<body name="lower" pos="0 0 -0.8"><joint name="knee" axis="0 -1 0" damping="0.1" frictionloss="0.3"/>
<inertial pos="0 0 -0.3" mass="0.7" diaginertia="0.03 0.03 0.01"/></body></body></worldbody>
<actuator><motor name="drive" joint="hip" gear="2"/><motor name="bend" joint="knee" gear="3"/></actuator></mujoco>
"""
SPEC = """
constants: n = 80, T = 1, h = T/n, g = 9.81, m1 = 1.2, m2 = 0.7, c1 = 0.4, c2 = 0.3, l1 = 0.8, I1 = 0.05, I2 = 0.03,
  d1 = 0.2, d2 = 0.1, k1 = 1.5, A1 = 0.05, G1 = 2, G2 = 3, F2 = 0.3;
variables: a, e, u1, u2;
definitions:
  x1 = c1*sin(a); z1 = -c1*cos(a); x2 = l1*sin(a) + c2*sin(a + e); z2 = -l1*cos(a) - c2*cos(a + e);
lagrangian:
  m1*(x1'^2 + z1'^2)/2 + I1*a'^2/2 - m1*g*z1 + A1*a'^2/2 - k1*a^2/2;
  m2*(x2'^2 + z2'^2)/2 + I2*(a' + e')^2/2 - m2*g*z2;
forces: a: G1*u1 - d1*a'; e: G2*u2 - d2*e' - F2;
constraints: [0]: a; e; a' = 0.5; e' = 1; [n]: a = 0.7; e = 1.4; a' = 0.5; e' = 1;
objective: [0,n]: integral(u1^2 + u2^2 + 100*(a''^2 + e''^2));
method: hermite-simpson;
replay: model = "two.xml"; joint hip = a; joint knee = e; actuator drive = u1; actuator bend = u2; {lines}
"""
ARMATURES = {"hip": 0.05, "knee": 0.0}


@pytest.fixture
def judged(tmp_path):
    def call(lines="", **constants):
        (tmp_path / "two.xml").write_text(MODEL)
        (tmp_path / "two.stc").write_text(SPEC.format(lines=lines))
        solution = stc.load(tmp_path / "two.stc").solve(**constants)
        assert solution.status == "optimal"
        return certify(solution)

    return call


def line_of(finding):
    """The `set` line that gives the model the number which a finding tells of the spec."""
    told = re.match(r"joint (\w+): (.+): spec ([-\d.e]+), model ([-\d.e]+)", finding)
    joint, term, spec, model = told[1], told[2], float(told[3]), float(told[4])
    if damped := re.fullmatch(r"damping by (\w+)'", term):
        assert damped[1] == joint
        return f"set joint.{joint}.damping = {spec};"
    if term == "dry friction":
        return f"set joint.{joint}.frictionloss = {abs(spec)};"
    if pulled := re.fullmatch(r"force of actuator (\w+)", term):
        return f"set actuator.{pulled[1]}.gear = {abs(spec)};"
    if term == f"mass matrix entry ({joint}, {joint})":
        return f"set joint.{joint}.armature = {ARMATURES[joint] + spec - model:.12g};"
    raise AssertionError(f"no number to set: {finding}")


def test_the_spec_and_its_model_agree(judged):
    assert judged().passed


@pytest.mark.daily_every(8)
@pytest.mark.parametrize(
    ("constant", "value"),
    [("d1", 0.3), ("d2", 0.2), ("F2", 0.5), ("G1", 2.5), ("G2", 4), ("A1", 0.15), ("I1", 0.15), ("d1", 0.05)],
)
def test_giving_the_model_the_number_that_blame_tells_makes_the_motion_pass(judged, constant, value):
    certificate = judged(**{constant: value})
    assert not certificate.passed
    assert any("`set` line" in step for step in certificate.next_steps)
    assert judged(line_of(certificate.findings[0]), **{constant: value}).passed


@pytest.mark.daily_every(8)
@pytest.mark.parametrize(
    ("constant", "value", "joint", "kind"),
    [
        ("m1", 1.4, "hip", "static force|mass matrix"),
        ("m2", 0.8, "knee|hip", "static force|mass matrix"),
        ("c1", 0.45, "hip", "static force|mass matrix"),
        ("c2", 0.35, "knee", "static force|mass matrix"),
        ("l1", 0.9, "knee", "mass matrix"),
        ("I2", 0.05, "knee", "mass matrix"),
        ("k1", 2.5, "hip", "static force"),
        ("g", 9.0, "knee|hip", "static force"),
    ],
)
def test_what_no_number_of_the_model_tells_is_named_where_it_weighs_most(
    judged, constant, value, joint, kind
):
    certificate = judged(**{constant: value})
    assert re.match(rf"joint ({joint}): ({kind})", certificate.headline)
    assert not any("damping" in finding or "friction" in finding for finding in certificate.findings)
