"""Limits of drift shrink with the motion: a small one has to be right as well."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc.validate import limits, validate

MODEL = """<mujoco><option timestep="0.001" gravity="0 0 0"/><worldbody>
  <body name="b"><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
    <joint name="x" type="slide" axis="1 0 0"/>
    <body><inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/>
      <joint name="loose" type="hinge" axis="0 1 0"/></body></body></worldbody>
  <actuator><motor name="f" joint="x"/></actuator></mujoco>"""

#: A joint that the spec does not tie: nothing but the replay judges the motion.
SPEC = """
constants: n = 40, h = 1/n, m = {mass}, d = {way};
variables: x, f;
method: {method};
constraints:
  [0, n]: m*x'' = f;
  [0]: x; x';
  [n]: x = d; x';
objective: [0, n]: integral(f^2);
replay: model = "small.xml"; joint x = x; {line} = f;
"""


@pytest.mark.daily_every(3)
@pytest.mark.parametrize("line", ["apply joint.x", "actuator f"])
@pytest.mark.parametrize("method", ["hermite-simpson", "trapezoidal"])
@pytest.mark.parametrize("way", [2e-3, 1.0])
@pytest.mark.parametrize("mass", [1.0, 2.0])
def test_half_a_mass_shows_however_short_the_way(
    tmp_path: Path, line: str, method: str, way: float, mass: float
) -> None:
    (tmp_path / "small.xml").write_text(MODEL)
    (tmp_path / "small.stc").write_text(SPEC.format(mass=mass, way=way, method=method, line=line))
    report = validate(stc.load(tmp_path / "small.stc").solve())
    drift = next(m for m in report.metrics if m.name == "open-loop drift, largest")
    assert report.passed is (mass == 2.0)
    if mass == 1.0:
        assert drift.value == pytest.approx(way / 2, rel=1e-3)
    assert drift.limit == pytest.approx(min(limits.OPEN_LOOP_DRIFT[method], limits.DRIFT_SHARE[method] * way))


def test_the_limit_of_a_small_motion_grows_with_it_up_to_that_of_large_ones() -> None:
    found = [limits.of_extent(1e-4, 1e-2, extent, 1e-6) for extent in (0.0, 1e-5, 1e-3, 1e-2, 5.0)]
    assert found == pytest.approx([1e-6, 1e-6, 1e-5, 1e-4, 1e-4])
