"""A wrong force that the spec hands over is not called gravity, and gravity is not called otherwise beside one."""

from __future__ import annotations

import pytest

from stc.pipeline import load
from stc.studies.equation_report import EquationReport
from stc.studies.equations import check_equations

#: A particle that a centre attracts, as planets are, and that falls besides.
CENTRAL = """
constants: n=20, T=1, h=T/n, m=2, G=3, g=9.8, stronger=1, heavier=1, other=0, given=g, steady=0, wrong=0;
variables: x, y;
definitions: r=sqrt(x^2+y^2);
constraints:
  [0,n]: m*x''=-G*x/r^3 + (1 + wrong)*steady;
         m*y''=-stronger*G*y/r^3-heavier*m*g-other*y; [0]: x=1; y; x'=0; y'=1.5;
guess: x=1; y=1.5*t;
method: hermite-simpson;
replay:
  model="particle.xml"; joint x=x; joint z=y; apply joint.x=-G*x/r^3+steady; apply joint.z=-G*y/r^3;
  set body.particle.mass=m; set option.gravity.z=-given;
"""


def compared(**constants: float) -> EquationReport:
    return check_equations(load(CENTRAL, **constants).problem(), states=60)


def test_right_forces_pass() -> None:
    assert compared().passed
    assert compared(steady=2).passed


@pytest.mark.parametrize(
    ("constants", "finding"),
    [
        ({"stronger": 1.02}, "joint z: force of apply joint.z: spec "),
        ({"stronger": 1.02, "given": 0, "heavier": 0}, "joint z: force of apply joint.z: spec "),
        ({"heavier": 1.5}, "joint z: gravity: spec 29.4, model 19.6 (frames 0 to 20)"),
        # Neither the one nor the other, and a steady force may be gravity along x.
        ({"other": 1}, "joint z: gravity or force of apply joint.z: spec "),
        ({"G": 0, "steady": 2, "wrong": 0.1}, "joint x: gravity or force of apply joint.x: spec "),
    ],
)
def test_the_force_that_is_wrong_is_named(constants: dict[str, float], finding: str) -> None:
    report = compared(**constants)
    assert len(report.findings) == 1, report.findings
    assert report.findings[0].startswith(finding), report.findings


def test_the_values_named_are_those_of_the_force() -> None:
    (finding,) = compared(stronger=1.25).findings
    spec, model = (float(part.split()[1]) for part in finding.split(": ")[-1].split(", "))
    assert spec == pytest.approx(1.25 * model, rel=1e-3)
