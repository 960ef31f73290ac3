"""A hopper on a point: solved with the ``point`` contact and repeated by MuJoCo's own floor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stc
from stc.validate import validate

pytestmark = pytest.mark.slow

MODEL = """
<mujoco>
  <option timestep="0.0004" integrator="RK4" gravity="0 0 -9.81" impratio="10"/>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" friction="0.88 0 0" solref="0.0002 1"/>
    <body name="foot">
      <inertial pos="0 0 0" mass="0.3" diaginertia="1e-3 1e-3 1e-3"/>
      <joint name="x" type="slide" axis="1 0 0"/>
      <joint name="z" type="slide" axis="0 0 1"/>
      <geom name="ball" type="sphere" pos="0 0 0.01" size="0.01" friction="0.88 0 0" solref="0.0002 1"/>
      <body name="weight">
        <inertial pos="0 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/>
        <joint name="along" type="slide" axis="1 0 0"/>
        <joint name="leg" type="slide" axis="0 0 1"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="along" joint="along"/>
    <motor name="leg" joint="leg"/>
  </actuator>
</mujoco>
"""

SPEC = """
constants:
  na = 30, nb = 50, n = 80, T1 = 0.3, T2 = 0.2, T3 = 0.3, D = 0.1, g = 9.81, mu = 0.8, m = 0.3, M = 1, rest = 0.4;
variables: x, z, s, l, v, u;
definitions:
  [0, na - 1]: h = T1/na;
  [na, nb - 1]: h = T2/(nb - na);
  [nb, n]: h = T3/(n - nb);
lagrangian:
  m/2*(x'^2 + z'^2) + M/2*((x' + s')^2 + (z' + l')^2) - m*g*z - M*g*(z + l);
forces:
  s: v;
  l: u;
contact:
  tip = point(x, z), friction = mu, clearance = 0.005, landing = 10;
  [0, na]: tip at 0;
  [nb, n]: tip at D;
constraints:
  [0, n]: 0.2 <= l <= 0.6; -0.2 <= s <= 0.2;
  [0]: l = rest; s; l'; s';
  [n]: l = rest; s; l'; s';
guess: l = rest;
objective:
  [0, n]: integral((u - M*g)^2 + v^2 + 1e-3*(u'^2 + v'^2) + 1e-5*(l''^2 + s''^2));
method: hermite-simpson;
replay:
  model = "hopper.xml";
  joint x = x;
  joint z = z;
  joint along = s;
  joint leg = l;
  actuator along = v;
  actuator leg = u;
  contact body.foot.fx = tip_fx;
  contact body.foot.fz = tip_fz;
"""


def test_a_point_hops_and_the_floor_agrees(tmp_path: Path) -> None:
    (tmp_path / "hopper.xml").write_text(MODEL)
    (tmp_path / "hopper.stc").write_text(SPEC)
    found = stc.load(tmp_path / "hopper.stc").solve()
    assert found.status == "optimal"
    stance = np.r_[0:30, 50:81]
    assert found["tip_fz"][stance].min() >= -1e-8
    assert np.all(np.abs(found["tip_fx"][stance]) <= 0.8 * found["tip_fz"][stance] + 1e-7)
    assert np.abs(found["tip_fz"][31:50]).max() <= 1e-8
    assert found["z"][31:50].min() > 0.0
    assert found["tip_jz1"] >= 0.0
    # Momentum: all pressure and the impulse carry the weight over the whole motion.
    pressure = np.trapezoid(found["tip_fz"][:31], found.time[:31]) + np.trapezoid(
        found.after["tip_fz"][50:], found.time[50:]
    )
    assert pressure + found["tip_jz1"] == pytest.approx(1.3 * 9.81 * 0.8, rel=2e-3)
    report = validate(found)
    values = {(m.name, m.subject): m.value for m in report.metrics}
    assert values["open-loop error on the ground, RMS", "base"] <= 1e-2
    assert values["tracked error on the ground, RMS", "base"] <= 5e-3
    assert max(v for (name, _), v in values.items() if name == "inverse-dynamics residual") <= 1e-9
