"""Forces of the model's own, counted where they act and not twice: joint limits and compensated gravity."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc.certification import certify
from stc.validate import Report, validate

STOP_MODEL = """<mujoco><option timestep="0.001" gravity="0 0 0"/><worldbody>
  <body><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    <joint name="x" type="slide" axis="1 0 0" range="-1 0.1" limited="true"/></body></worldbody>
  <actuator><motor name="f" joint="x"/></actuator></mujoco>"""

#: Bryson and Denham's problem: back through the start at the same speed, past a stop.  Its minimum is 4/(9 l).
BRYSON_DENHAM = """
constants: n = {n}, h = 1/n, l = 0.1;
variables: x, f;
method: {method};
constraints:
  [0, n]: {mass}*x'' = f; x <= l;
  [0]: x; x' = 1;
  [n]: x; x' = -1;
objective: [0, n]: integral(f^2)/2;
replay: model = "stop.xml"; joint x = x; actuator f = f;
"""


def value(report: Report, name: str) -> float:
    return max(metric.value for metric in report.metrics if metric.name.startswith(name))


@pytest.mark.parametrize(("method", "n"), [("hermite-simpson", 60), ("trapezoidal", 50)])
def test_a_motion_that_touches_its_stop_needs_no_force_of_it(tmp_path: Path, method: str, n: int) -> None:
    (tmp_path / "stop.xml").write_text(STOP_MODEL)
    (tmp_path / "stop.stc").write_text(BRYSON_DENHAM.format(method=method, n=n, mass=1))
    solution = stc.load(tmp_path / "stop.stc").solve()
    assert solution.objective == pytest.approx(4 / 0.9, rel=1e-2)
    certificate = certify(solution)
    assert value(certificate.report, "inverse-dynamics residual") < 1e-12
    assert certificate.passed, certificate.headline


def test_a_wrong_mass_still_shows_beside_a_stop(tmp_path: Path) -> None:
    (tmp_path / "stop.xml").write_text(STOP_MODEL)
    (tmp_path / "stop.stc").write_text(BRYSON_DENHAM.format(method="hermite-simpson", n=60, mass=1.25))
    report = validate(stc.load(tmp_path / "stop.stc").solve())
    assert value(report, "inverse-dynamics residual") == pytest.approx(0.2, rel=1e-6)


#: A motor presses the slide against its stop, which holds it.
HELD = """
constants: n = 20, h = 0.5/n;
variables: x, f, r;
method: hermite-simpson;
constraints:
  [0, n]: x'' = f + r; x = 0.1; f = 2*t; r = -{share}*f;
replay: model = "stop.xml"; joint x = x; actuator f = f; {line}
"""


@pytest.mark.parametrize(
    ("line", "residual"), [("contact joint.x = r;", 0.0), ("apply joint.x = r;", 0.0), ("", 1.0)]
)
def test_what_a_stop_gives_is_stated(tmp_path: Path, line: str, residual: float) -> None:
    (tmp_path / "stop.xml").write_text(
        STOP_MODEL.replace('limited="true"', 'limited="true" solreflimit="0.004 1"')
    )
    (tmp_path / "stop.stc").write_text(HELD.format(share=1, line=line))
    certificate = certify(stc.load(tmp_path / "stop.stc").solve(), equations=False)
    assert value(certificate.report, "inverse-dynamics residual") == pytest.approx(residual, abs=1e-12)
    assert certificate.passed is (residual == 0.0), certificate.headline


LIFT_MODEL = """<mujoco><option timestep="0.001" gravity="0 0 -10"/><worldbody>
  <body gravcomp="{share}"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    <joint name="z" type="slide" axis="0 0 1" actuatorgravcomp="{by_actuator}"/></body></worldbody>
  <actuator><motor name="f" joint="z"/></actuator></mujoco>"""

LIFT = """
constants: n = 40, h = 1/n, weight = {weight};
variables: z, f;
method: hermite-simpson;
constraints:
  [0, n]: z'' = f - weight;
  [0]: z; z';
  [n]: z = 1; z';
objective: [0, n]: integral(f^2)/2;
replay: model = "lift.xml"; joint z = z; actuator f = f;
"""


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("by_actuator", ["true", "false"])
@pytest.mark.parametrize("share", [1.0, 0.4])
def test_compensated_gravity_stands_in_the_books_once(tmp_path: Path, share: float, by_actuator: str) -> None:
    (tmp_path / "lift.xml").write_text(LIFT_MODEL.format(share=share, by_actuator=by_actuator))
    (tmp_path / "lift.stc").write_text(LIFT.format(weight=10 * (1 - share)))
    certificate = certify(stc.load(tmp_path / "lift.stc").solve())
    assert value(certificate.report, "energy balance") < 1e-9
    assert certificate.passed, certificate.headline
