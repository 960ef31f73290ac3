"""Advice where a model cuts controls off, and where wrong equations cannot be told from coarse frames."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc.certification import certify
from stc.validate import Metric
from stc.validate.certificate.advice import next_steps

ROD = """<mujoco><worldbody><body name="rod"><joint name="p" axis="0 -1 0"/>
  <inertial pos="0 0 -0.5" mass="1" diaginertia="0.02 0.02 0.02"/></body></worldbody>
  <actuator><motor name="torque" joint="p" ctrlrange="-5 {most}"/></actuator></mujoco>"""

SPEC = """
constants: n=60, T=0.6, h=T/n; variables: q, u;
constraints: [0,n]: 0.27*q'' + 0.5*9.81*sin(q) = u; [0]: q; q'; [n]: q=0.5; q';
objective: [0,n]: integral(u^2);
method: hermite-simpson;
replay: model="rod.xml"; joint p=q; actuator torque=u;
"""


@pytest.mark.parametrize("most", [1.0, 9.0])
def test_a_control_that_is_cut_off_is_named(tmp_path: Path, most: float) -> None:
    (tmp_path / "rod.xml").write_text(ROD.format(most=most))
    (tmp_path / "rod.stc").write_text(SPEC)
    solution = stc.load(tmp_path / "rod.stc").solve()
    largest = float(solution["u"].max())
    assert 1.1 < largest < 8.9
    assert solution["u"].min() > -5.0
    certificate = certify(solution)
    assert certificate.passed == (most > largest)
    if not certificate.passed:
        line = f"the control of torque goes to {largest:.4g}, the model clamps it to -5 ... 1"
        assert certificate.headline.endswith(line)
        (step,) = certificate.next_steps
        assert step.startswith(line)


def test_where_the_residual_is_not_judged_that_is_said_before_more_frames() -> None:
    drift = [Metric("tracked drift, largest", "joint a", 2.0, "rad", 1.0)]
    first, second = next_steps(drift, False, "--set n=120", unjudged=True)
    assert first.startswith("the inverse-dynamics residual is not judged here")
    assert second.startswith("take more frames: --set n=120")
    assert len(next_steps(drift, False, "--set n=120")) == 1
