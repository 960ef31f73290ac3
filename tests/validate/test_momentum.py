"""Momentum in flight: along the axes that nothing pushes, and no share of rounding."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc.certification import certify
from stc.validate import validate
from stc.validate.momentum import flights
from stc.validate.verdict import open_setup

#: A trunk and a leg below it: they rise and part on one line, so that nothing turns.
HOPPER_MODEL = """<mujoco><option gravity="0 0 -10"/><worldbody><geom type="plane" size="5 5 0.1"/>
  <body name="trunk" pos="0 0 1"><inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.1"/>
    <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
    <joint name="pitch" type="hinge" axis="0 1 0"/><geom type="sphere" size="0.1"/>
    <body name="leg" pos="0 0 -0.5"><inertial pos="0 0 0" mass="0.3" diaginertia="0.01 0.01 0.01"/>
      <joint name="leg" type="slide" axis="0 0 1"/></body></body></worldbody>
  <actuator><motor name="leg" joint="leg"/></actuator></mujoco>"""

HOPPER = """
constants: n = 12, T = 0.6, h = T/n;
variables: x, z, p, e, u, fz;
constraints:
  [0, n]: x'' = 0; 2*z'' = fz - u - 20; 0.3*(z'' + e'') = u - 3; p'' = {turn}; u = 3 + 0.3*sin(9*t);
  [0, 4]: fz = 60; [5, n]: fz = 0;
  [0]: x; z; p; e; x' = 1/3; z'; p'; e';
method: hermite-simpson;
replay:
  model = "hopper.xml"; joint x = x; joint z = z; joint pitch = p; joint leg = e; actuator leg = u;
  contact body.trunk.fz = fz;
"""


@pytest.mark.parametrize(("turn", "verdict"), [("0", "pass"), ("0.02", "fail")])
def test_a_hop_straight_up_has_no_spin_to_lose(tmp_path: Path, turn: str, verdict: str) -> None:
    (tmp_path / "hopper.xml").write_text(HOPPER_MODEL)
    (tmp_path / "hopper.stc").write_text(HOPPER.format(turn=turn))
    report = validate(stc.load(tmp_path / "hopper.stc").solve())
    verdicts = {m.name.split(",")[0]: m.verdict for m in report.metrics if "momentum" in m.name}
    assert verdicts == {"momentum in flight": "pass", "angular momentum in flight": verdict}


#: A block that something lifts in flight as well: a jet at a site, a motor on the slide, or air that brakes.
LIFTED_MODEL = """<mujoco><option gravity="0 0 -10"/><worldbody><geom type="plane" size="5 5 0.1"/>
  <body name="block" pos="0 0 1"><inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.1"/>
    <joint name="x" type="slide" axis="1 0 0"/>
    <joint name="z" type="slide" axis="0 0 1" damping="{damping}"/>
    <geom type="sphere" size="0.1"/><site name="jet"/></body></worldbody>
  <actuator><motor name="lift" {place}/></actuator></mujoco>"""

LIFTED = """
constants: n = 12, T = 0.6, h = T/n;
variables: x, z, f, fz;
constraints:
  [0, n]: 2*x'' = {push}; 2*z'' = f + fz - 20 - {damping}*z'; f = {force};
  [0, 4]: fz = 60; [5, n]: fz = 0;
  [0]: x; z; x' = 1; z';
method: hermite-simpson;
replay:
  model = "lifted.xml"; joint x = x; joint z = z; actuator lift = f; contact body.block.fz = fz;
"""


@pytest.mark.parametrize(
    ("place", "force", "damping"),
    [
        ('site="jet" gear="0 0 1 0 0 0"', 12, 0),
        ('joint="z"', 12, 0),
        ('joint="z"', 0, 1.5),
    ],
)
@pytest.mark.parametrize("push", [0, 0.5])
def test_powered_flight_keeps_the_other_momentum(
    tmp_path: Path, place: str, force: float, damping: float, push: float
) -> None:
    """Along x nothing pushes the block, and a force from nowhere shows there."""
    (tmp_path / "lifted.xml").write_text(LIFTED_MODEL.format(place=place, damping=damping))
    (tmp_path / "lifted.stc").write_text(LIFTED.format(push=push, force=force, damping=damping))
    solution = stc.load(tmp_path / "lifted.stc").solve()
    (flight,) = flights(open_setup(solution))
    assert flight.linear is not None
    assert flight.angular is None  # the block cannot turn
    assert flight.linear > 0.01 if push else flight.linear < 1e-9


def test_a_jet_that_is_off_leaves_a_flight_as_it_is(tmp_path: Path) -> None:
    """The weight is wrong by a tenth, which only the vertical momentum tells."""
    (tmp_path / "lifted.xml").write_text(
        LIFTED_MODEL.format(place='site="jet" gear="0 0 1 0 0 0"', damping=0)
    )
    (tmp_path / "lifted.stc").write_text(LIFTED.format(push=0, force=0, damping=0).replace("- 20", "- 22"))
    certificate = certify(stc.load(tmp_path / "lifted.stc").solve(), equations=False)
    assert any(m.name.startswith("momentum in flight") and m.verdict == "fail" for m in certificate.metrics)
