"""Equations that have no value at rest, such as those of friction against a velocity, are judged all the same."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc import certification
from stc.pipeline import load
from stc.studies import along
from stc.studies.equation_report import EquationReport
from stc.studies.equations import check_equations
from stc.validate.certificate import Certificate

#: A thrown particle that a force of constant size holds back: against its velocity, which has no direction at rest.
DRAG = """
constants: n=20, T=1, h=T/n, m=2, g=9.8, F=3, heavier=1, stronger=1, slower=1, wind=0;
variables: x, y, u;
definitions: v=sqrt(x'^2+y'^2);
constraints:
  [0,n]: slower*m*x''=u-stronger*F*x'/v; m*y''=-heavier*m*g-F*y'/v-wind*x'; u=x;
  [0]: x; y; x'=3; y'=4;
guess: x=3*t; y=4*t;
method: hermite-simpson;
replay:
  model="particle.xml"; joint x=x; joint z=y; actuator fx=u;
  apply joint.x=-F*x'/v; apply joint.z=-F*y'/v;
  set body.particle.mass=m; set option.gravity.z=-g;
"""


def drag(**constants: float) -> EquationReport:
    return check_equations(load(DRAG, **constants).problem(), states=60)


def test_right_equations_pass_and_say_what_was_not_taken_apart() -> None:
    report = drag()
    assert report.passed, report.findings
    (note,) = [note for note in report.notes if "they have no value at rest" in note]
    assert "are taken apart without those of velocities" in note


@pytest.mark.parametrize(
    ("constants", "finding"),
    [
        ({"heavier": 1.1}, "joint z: gravity: spec 21.56, model 19.6 (frames 0 to 20)"),
        ({"slower": 0.9}, "joint x: mass matrix entry (x, x): spec 1.8, model 2 (frames 0 to 20)"),
        ({"stronger": 1.25}, "joint x: force of apply joint.x: spec "),
        ({"wind": 1}, "joint z: static force and what velocities add: spec "),
    ],
)
def test_what_is_wrong_is_named(constants: dict[str, float], finding: str) -> None:
    report = drag(**constants)
    assert not report.passed
    assert len(report.findings) == 1
    assert report.findings[0].startswith(finding), report.findings


def test_the_values_named_are_those_of_the_force() -> None:
    """A quarter more than the model has, wherever that was looked at."""
    (finding,) = drag(stronger=1.25).findings
    spec, model = (float(part.split()[1]) for part in finding.split(": ")[-1].split(", "))
    assert spec == pytest.approx(1.25 * model, rel=1e-3)


def certified(folder: Path, **constants: float) -> Certificate:
    (folder / "drag.stc").write_text(DRAG)
    return certification.certify(stc.load(folder / "drag.stc", **constants).solve())


def test_a_wrong_motion_has_its_verdict(tmp_path: Path) -> None:
    certificate = certified(tmp_path, heavier=1.1)
    assert not certificate.passed
    assert certificate.headline.startswith("joint z: gravity: spec 21.56, model 19.6")
    assert certified(tmp_path).passed


def test_a_comparison_that_breaks_down_is_told_and_costs_no_verdict(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> EquationReport:
        raise AssertionError("of some kind")

    monkeypatch.delenv("STC_DEBUG", raising=False)
    monkeypatch.setattr(along, "equations_along", broken)
    certificate = certified(tmp_path, heavier=1.1)
    assert not certificate.passed
    assert certificate.headline.startswith("joint z: inverse-dynamics residual ")
    (note,) = [note for note in certificate.notes if "not compared" in note]
    assert "stc itself failed there (AssertionError: of some kind)" in note
    assert not any("--equations" in step for step in certificate.next_steps)
