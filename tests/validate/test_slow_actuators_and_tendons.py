"""What feedback and books say of actuators that lag behind their controls, and of dry friction in tendons."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc.validate import Report, validate

ROD = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body>
      <joint name="p" axis="0 -1 0"/>
      <inertial pos="0 0 -0.5" mass="1" diaginertia="0.02 0.02 0.02"/>
    </body>
  </worldbody>
  {more}
</mujoco>
"""

SPEC = """
constants: n=60, T={T}, h=T/n; variables: q, u;
constraints: [0,n]: 0.27*q'' + 0.5*9.81*sin(q) + {friction} = u; {more} [0]: q; q'={rate}; [n]: q=1; q'={rate};
objective: [0,n]: integral(u^2 + 1e-3*u'^2);
guess: q=t/T;
method: hermite-simpson;
replay: model="rod.xml"; joint p=q; actuator t={control};
"""


def report_of(folder: Path, joined: str, **parts: object) -> Report:
    (folder / "rod.xml").write_text(ROD.format(more=joined))
    (folder / "rod.stc").write_text(SPEC.format(**parts))
    return validate(stc.load(folder / "rod.stc").solve())


@pytest.mark.parametrize(("friction", "right"), [(0.3, True), (0.25, False)])
def test_dry_friction_of_a_tendon_is_in_the_books(tmp_path: Path, friction: float, right: bool) -> None:
    """The rod goes forwards all the way, so that Coulomb's friction is a constant."""
    more = (
        '<tendon><fixed name="rope" frictionloss="0.3"><joint joint="p" coef="1"/></fixed></tendon>'
        '<actuator><motor name="t" joint="p"/></actuator>'
    )
    report = report_of(tmp_path, more, T=0.6, friction=friction, rate=1, more="", control="u")
    (balance,) = [m for m in report.metrics if m.name == "energy balance"]
    assert (balance.value < 1e-8) == right
    assert report.passed == right


@pytest.mark.parametrize(("lag", "right"), [(0.05, True), (0.045, False)])
def test_feedback_does_not_judge_where_actuators_lag(tmp_path: Path, lag: float, right: bool) -> None:
    more = '<actuator><general name="t" joint="p" dyntype="filterexact" dynprm="0.05"/></actuator>'
    control = f"u + {lag}*u'"
    report = report_of(tmp_path, more, T=2, friction=0, rate=0, more="[0]: u = 0;", control=control)
    assert report.passed == right
    steered = [m for m in report.metrics if m.name.startswith(("tracked drift", "feedback share"))]
    assert steered
    assert {m.verdict for m in steered} == {"info"}
    assert any("lag behind their controls" in note for note in report.notes)
    assert report.unjudged == ["inverse-dynamics residual", "energy balance"]


@pytest.mark.parametrize(("gear", "right"), [(1.0, True), (1.01, False)])
def test_forces_of_actuators_whose_states_are_told_are_judged(
    tmp_path: Path, gear: float, right: bool
) -> None:
    """The state is the torque; an actuator with another gear gives another one at every instant."""
    more = f"""<actuator><general name="t" joint="p" gear="{gear}" dyntype="filterexact" dynprm="0.05"/></actuator>"""
    control = "u + 0.05*u'; actuator t.activation = u"
    report = report_of(tmp_path, more, T=2, friction=0, rate=0, more="[0]: u = 0;", control=control)
    assert report.unjudged == []
    verdicts = {
        m.verdict for m in report.metrics if m.name in ("inverse-dynamics residual", "energy balance")
    }
    assert verdicts == ({"pass"} if right else {"fail"})
    assert report.passed == right
