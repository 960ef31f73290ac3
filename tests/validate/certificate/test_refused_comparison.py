"""Where equations cannot be compared with the model's, a certificate says so and advises something else."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc.certification import certify
from stc.errors import UsageError
from stc.studies.equations import check_equations
from stc.validate import Metric
from stc.validate.certificate import Certificate
from stc.validate.certificate.advice import next_steps

ROD = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body>
      <joint name="p" axis="0 -1 0"/>
      <inertial pos="0 0 -0.5" mass="1" diaginertia="0.02 0.02 0.02"/>
    </body>
    {second}
  </worldbody>
  {equality}
  <actuator><motor name="t" joint="p"/></actuator>
</mujoco>
"""

HEAD = """
constants: n=60, T=0.6, h=T/n, k=1; variables: q, u{more}; objective: [0,n]: integral(u^2); guess: q=t/T;
method: central; replay: model="rod.xml"; joint p=q; actuator t=u;
"""
#: A rod's law between neighbouring frames: three of them, and two of angles and rates (symplectic Euler).
STENCIL = """constraints: [1,n-1]: 0.27*(q[i+1]-2*q+q[i-1])/h^2 = u - k*0.5*9.81*sin(q);
  [0]: q; [1]: q; [n]: q=1; [n-1]: q=1;"""
EULER = """constraints: [0,n-1]: 0.27*(v[i+1]-v) = h*(u - k*0.5*9.81*sin(q)); q[i+1]-q = h*v[i+1];
  [0]: q; v; [n]: q=1; v;"""


def write(folder: Path, text: str, second: str = "", equality: str = "") -> Path:
    (folder / "rod.xml").write_text(ROD.format(second=second, equality=equality))
    (folder / "rod.stc").write_text(text)
    return folder / "rod.stc"


def by_hand(certificate: Certificate) -> None:
    """It failed by what was measured, and is not advised to compare what cannot be compared."""
    assert not certificate.passed
    assert certificate.equations is None
    assert "inverse-dynamics residual" in certificate.headline
    assert certificate.next_steps[0].startswith(
        "check by hand the equations of motion, which cannot be compared"
    )
    assert not any("--equations" in step for step in certificate.next_steps)


@pytest.mark.parametrize("law", [STENCIL, EULER], ids=["stencil", "euler"])
def test_equations_between_neighbouring_frames_are_refused(tmp_path: Path, law: str) -> None:
    spec = write(tmp_path, HEAD.format(more=", v" if law is EULER else "") + law)
    with pytest.raises(
        UsageError, match=r"the equations at .*rod\.stc:4:23.* have values of neighbouring frames"
    ):
        check_equations(stc.load(spec).problem())
    certificate = certify(stc.load(spec, k=1.2).solve())
    by_hand(certificate)
    assert any("not compared: the equations at" in note for note in certificate.notes)
    assert not any(metric.name.startswith("equations of motion") for metric in certificate.metrics)


def test_a_right_motion_passes_though_its_equations_are_refused(tmp_path: Path) -> None:
    certificate = certify(stc.load(write(tmp_path, HEAD.format(more="") + STENCIL)).solve(), equations=True)
    assert certificate.passed, certificate.headline
    assert any("not compared: the equations at" in note for note in certificate.notes)


def test_a_force_that_is_held_does_not_hide_a_missing_equation(tmp_path: Path) -> None:
    spec = write(tmp_path, HEAD.format(more="") + "constraints: [0,n-1]: u[i+1] = u; [0]: q; [n]: q=1;")
    report = check_equations(stc.load(spec).problem(), states=20)
    assert "the spec states no equation of motion for it" in report.findings[0]


@pytest.mark.parametrize("share", [3, 2])
def test_a_wrong_law_of_a_geared_rod_is_to_be_looked_for_by_hand(tmp_path: Path, share: int) -> None:
    """Joint q turns a third as far as p; where the spec has it as half as far, its joint lines are to be looked at."""
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/>'
    wheel = f'<body pos="1 0 0"><joint name="q" axis="0 1 0"/>{inertial}</body>'
    gear = '<equality><joint joint1="q" joint2="p" polycoef="0 0.3333333333333333 0 0 0"/></equality>'
    law = f"""constraints: [0,n]: (0.27 + 0.1/9)*q'' = u - 1.2*0.5*9.81*sin(q); [0]: q; q'; [n]: q=1; q';
      replay: joint q=q/{share};"""
    certificate = certify(stc.load(write(tmp_path, HEAD.format(more="") + law, wheel, gear)).solve())
    if share == 3:
        by_hand(certificate)
        return
    assert not certificate.passed
    assert certificate.headline.startswith("equality 0 (q and p): equality broken in the solved pose")
    assert certificate.next_steps[0].startswith(
        "make the joint lines under replay: satisfy the model's equality"
    )
    assert not any("--equations" in step for step in certificate.next_steps)


def failed(name: str) -> Metric:
    return Metric(name, "joint a", 2.0, "share", 1.0)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        (["equations of motion", "mass matrix, entry by entry"], False),
        (["equations of motion", "force, entry by entry"], False),
        (["equations of motion"], False),
        (["equations of motion", "static force, entry by entry"], True),  # gravity gives no impulse
        (["energy balance"], True),
    ],
)
def test_an_impulse_is_no_cause_of_its_own_where_masses_are_wrong(wrong: list[str], told: bool) -> None:
    for impulse in ("unexplained impulse", "unexplained impulse, pulls or slips beyond friction"):
        steps = next_steps([failed(name) for name in (*wrong, impulse)], True)
        assert any("impulse" in step for step in steps) is told
