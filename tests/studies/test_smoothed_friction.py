"""Dry friction that a spec smooths is called that, and what is advised makes the motion pass."""

from __future__ import annotations

import re

import pytest

import stc
from stc.certification import certify

MODEL = """
<mujoco><option gravity="0 0 0"/><worldbody><body name="a">
<joint name="q" axis="0 -1 0" damping="0.1" {friction}/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
</body></worldbody><actuator><motor name="m" joint="q"/></actuator></mujoco>
"""
SPEC = """
constants: n = 40, T = 1, h = T/n;
variables: q, u;
constraints: [0,n]: q'' = u - {damping}*q' - {friction};
 [0]: q; q'; [n]: q = {goal}; q';
objective: [0,n]: integral(u^2);
method: hermite-simpson;
replay: model = "a.xml"; joint q = q; actuator m = u;
"""
SMOOTHED = {
    "tanh": "{F}*tanh(50*q')",
    "root": "{F}*q'/sqrt(q'^2 + 1e-4)",
    "arc tangent": "{F}*2/pi*atan(80*q')",
    "logistic": "{F}*(2/(1 + exp(-60*q')) - 1)",
}


@pytest.fixture
def judged(tmp_path):
    """Solves and certifies a spec beside its model."""

    def call(friction, damping=0.1, goal=1, loss='frictionloss="0.2"'):
        (tmp_path / "a.xml").write_text(MODEL.format(friction=loss))
        (tmp_path / "a.stc").write_text(SPEC.format(friction=friction, damping=damping, goal=goal))
        solution = stc.load(tmp_path / "a.stc").solve()
        assert solution.status == "optimal"
        return certify(solution)

    return call


@pytest.mark.daily_every(8)
@pytest.mark.parametrize("name", SMOOTHED)
@pytest.mark.parametrize("goal", [1, -1])
def test_smoothed_friction_is_called_that_and_the_damping_right(judged, name, goal):
    certificate = judged(SMOOTHED[name].format(F=0.2), goal=goal)
    assert not certificate.passed
    assert certificate.headline.startswith("joint q: dry friction is smoothed in the spec: 0.2 above")
    assert "the damping is right, 0.1" in certificate.headline
    assert not any(
        "damping by" in finding or "model, beginning" in finding for finding in certificate.findings
    )
    # Advice as a person would take it: the number that it tells, against the way that it tells.
    (step,) = certificate.next_steps
    told = re.search(
        r"slides (forwards|backwards) throughout: write a constant dry friction, ([\d.]+) against", step
    )
    sign = "" if told[1] == "forwards" else "-"
    assert judged(f"({sign}{told[2]})", goal=goal).passed


def test_a_speed_is_told_from_which_on_the_friction_is_whole(judged):
    headline = judged("0.2*tanh(50*q')").headline
    speed = float(re.search(r"above ([\d.]+) rad/s", headline)[1])
    assert speed == pytest.approx(0.0529, rel=0.05)  # tanh(50 v) = 0.99


def test_friction_of_another_size_is_told_with_both(judged):
    certificate = judged("0.3*tanh(50*q')")
    assert "smoothed in the spec: 0.3 above" in certificate.headline and "model 0.2" in certificate.headline
    assert "0.2 against its velocity" in certificate.next_steps[0]


def test_damping_that_is_wrong_too_is_told_of(judged):
    certificate = judged("0.2*tanh(50*q')", damping=0.15)
    assert (
        "smoothed" in certificate.headline and "damping by q': spec 0.15, model 0.1" in certificate.headline
    )
    assert len(certificate.next_steps) == 2
    again = judged("0.2", damping=0.15)
    assert again.headline.startswith("joint q: damping by q': spec 0.15, model 0.1")


def test_plain_damping_and_drag_are_not_called_friction(judged):
    assert "damping by q': spec 0.3, model 0.1" in judged("0.2", damping=0.3).headline
    assert "smoothed" not in judged("(0.2 + 0.5*q'*sqrt(q'^2 + 1e-8))").headline


def test_a_model_without_friction_is_told_to_have_none(judged):
    certificate = judged("0.2*tanh(50*q')", loss="")
    assert "smoothed in the spec: 0.2" in certificate.headline and "model none" in certificate.headline
    assert judged("0", loss="").passed
