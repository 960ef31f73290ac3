"""Dry friction in a spec acts against the motion that it states, or the comparison says where it does not."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc.certification import certify
from stc.studies.equations import check_equations
from stc.validate.certificate import Certificate

BLOCK = """
<mujoco>
  <option gravity="0 0 -9.81"/>
  <worldbody><body>
    <joint name="x" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
  </body></worldbody>
  <actuator><motor name="u" joint="x"/></actuator>
</mujoco>
"""

#: 2 kg are pushed along a line, x(t) as given: only the force that this takes is solved for.
SPEC = """
constants: n=20, T=1, h=T/n, F=3;
variables: x, u;
constraints: [0,n]: {rows} x'' = {acceleration}; [0]: x; x'={start};
method: {method};
replay: model="block.xml"; joint x=x; actuator u=u; set joint.x.frictionloss=F;
"""
FORWARDS, BACKWARDS, BOTH = ("1", 0.5), ("-1", -0.5), ("1", -0.5)


def judged(
    folder: Path, motion: tuple[str, float], friction: str, method: str = "hermite-simpson"
) -> Certificate:
    (folder / "block.xml").write_text(BLOCK)
    rows = f"2*x'' = u {friction};"
    text = SPEC.format(rows=rows, acceleration=motion[0], start=motion[1], method=method)
    (folder / "block.stc").write_text(text)
    return certify(stc.load(folder / "block.stc").solve(), equations=True)


@pytest.mark.daily_every(3)
@pytest.mark.parametrize("method", ["central", "trapezoidal", "hermite-simpson"])
def test_friction_against_the_motion_is_right(tmp_path: Path, method: str) -> None:
    for motion, friction in ((FORWARDS, "- F"), (BACKWARDS, "+ F")):
        certificate = judged(tmp_path, motion, friction, method)
        assert certificate.passed, certificate.headline


@pytest.mark.daily_every(4)
@pytest.mark.parametrize(
    ("motion", "friction", "values"),
    [
        (FORWARDS, "+ F", "spec -3, model 3"),
        (BACKWARDS, "- F", "spec 3, model -3"),
        (FORWARDS, "", "spec 0, model 3"),
        (FORWARDS, "- 0.9*F", "spec 2.7, model 3"),
    ],
)
def test_friction_with_the_motion_or_none_is_named(
    tmp_path: Path, motion: tuple[str, float], friction: str, values: str
) -> None:
    certificate = judged(tmp_path, motion, friction)
    assert not certificate.passed
    assert certificate.headline == f"joint x: dry friction: {values} (frames 0 to 20)"
    assert not any("equations are right" in step for step in certificate.next_steps)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(
    ("friction", "words"),
    [
        (
            "- F",
            "that of sliding forwards, the motion slides backwards between frames 0 and 9.5 (frames 0 to 20)",
        ),
        (
            "+ F",
            "that of sliding backwards, the motion slides forwards between frames 10.5 and 20 (frames 0 to 20)",
        ),
    ],
)
def test_one_friction_for_both_ways_is_named(tmp_path: Path, friction: str, words: str) -> None:
    """It turns round at t = 0.5: at frame 10 exactly."""
    certificate = judged(tmp_path, BOTH, friction)
    assert not certificate.passed
    assert certificate.headline == f"joint x: dry friction: spec {words}"
    assert not any("equations are right" in step for step in certificate.next_steps)


def test_friction_that_turns_with_the_motion_is_right(tmp_path: Path) -> None:
    (tmp_path / "block.xml").write_text(BLOCK)
    rows = "[0, n/2]: 2*x'' = u + F; [n/2, n]: 2*x'' = u - F; [0, n]:"
    text = SPEC.format(rows=rows, acceleration="1", start=-0.5, method="trapezoidal")
    (tmp_path / "block.stc").write_text(text + "jumps: [n/2]: u;")
    certificate = certify(stc.load(tmp_path / "block.stc").solve(), equations=True)
    assert certificate.passed, certificate.headline


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(("share", "good"), [(1, True), (0.9, False)])
def test_friction_against_any_velocity_is_compared_with_that(
    tmp_path: Path, share: float, good: bool
) -> None:
    """Written with the direction of the velocity, which has no value at rest."""
    (tmp_path / "block.xml").write_text(BLOCK)
    rows = f"2*x'' = u - {share}*F*x'/sqrt(x'^2);"
    text = SPEC.format(rows=rows, acceleration="1", start=0.5, method="trapezoidal")
    (tmp_path / "block.stc").write_text(text + "guess: x = t;")
    report = check_equations(stc.load(tmp_path / "block.stc").problem(), states=60)
    assert report.passed is good, report.findings
    assert "dry friction of joint x: against the velocity (frames 0 to 20)" in report.notes
    certificate = certify(stc.load(tmp_path / "block.stc").solve(), equations=True)
    assert certificate.passed is good, certificate.headline
    assert good or certificate.headline == "joint x: dry friction: spec 2.7, model 3 (frames 0 to 20)"
