"""What a model's flags and limits switch off is not stated: MuJoCo repeats what is solved."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stc.solution import Solution
from stc.validate import validate

from .bodies import load

START = "constants: n = 20, T = 1, h = T/n;\n"
SWING = f"""{START}constraints:
  [0]: joint.a = 0; joint.b = 0; rest;
  [n]: joint.a = 1; rest;
objective: [0, n]: integral(effort);"""


def model(flag: str = "", more: str = "", joint: str = "", motor: str = "", second: str = "") -> str:
    """Two arms side by side, with what may be switched off."""
    switched = f'<option><flag {flag}="disable"/></option>' if flag else ""
    return f"""<mujoco><compiler angle="radian"/>{switched}<worldbody>
      <body><joint name="a" axis="0 1 0" armature=".1" {joint}/><geom type="capsule" fromto="0 0 0 0 0 -.5" size=".03"
        mass="1" contype="0" conaffinity="0"/></body>
      <body pos="0 1 0"><joint name="b" axis="0 1 0" armature=".1" {second}/><geom type="capsule" fromto="0 0 0 0 0 -.5"
        size=".03" mass="1" contype="0" conaffinity="0"/></body></worldbody>{more}
      <actuator><motor name="a" joint="a" {motor}/><motor name="b" joint="b"/></actuator></mujoco>"""


def solve(folder: Path, text: str, spec: str = SWING) -> Solution:
    return load(folder, text, spec).solve()


def repeats(solution: Solution, folder: Path) -> bool:
    """Whether MuJoCo, left to itself with the solved controls, does what was solved."""
    report = validate(solution, folder / "robot.xml", tracked=False)
    drift = max(m.value for m in report.metrics if m.name == "open-loop drift, largest")
    return bool(drift < 1e-3)


CASES = {
    "limit": ("limit", {"joint": 'range="-.5 .5"'}, lambda s: s["joint.a"].max() > 0.9),
    "clampctrl": (
        "clampctrl",
        {"motor": 'ctrlrange="-.1 .1"'},
        lambda s: np.abs(s["actuator.a"]).max() > 1.0,
    ),
    "equality": (
        "equality",
        {"more": '<equality><joint joint1="b" joint2="a"/></equality>'},
        lambda s: np.abs(s["joint.b"]).max() < 0.1,
    ),
}


@pytest.mark.parametrize(
    ("name", "flag"),
    # Controls are clamped whatever becomes of constraints.
    [(n, f) for n in CASES for f in ("alone", "constraint") if (n, f) != ("clampctrl", "constraint")],
)
def test_what_is_switched_off_is_not_stated(tmp_path: Path, name: str, flag: str) -> None:
    switch, parts, free = CASES[name]
    bound = solve(tmp_path, model(**parts))
    assert bound.status == "infeasible" or not free(bound)
    found = solve(tmp_path, model(switch if flag == "alone" else flag, **parts))
    assert found.status == "optimal"
    assert free(found)
    assert repeats(found, tmp_path)


@pytest.mark.parametrize("flag", ["frictionloss", "constraint"])
def test_dry_friction_that_is_switched_off_costs_nothing(tmp_path: Path, flag: str) -> None:
    plain = solve(tmp_path, model())
    rubbing = solve(tmp_path, model(joint='frictionloss=".5"'))
    freed = solve(tmp_path, model(flag, joint='frictionloss=".5"'))
    assert abs(rubbing.objective - plain.objective) > 1e-3
    assert freed.objective == pytest.approx(plain.objective, rel=1e-9)
    assert repeats(freed, tmp_path)


TENDON = (
    '<tendon><fixed name="t" {0}><joint joint="a" coef="1"/><joint joint="b" coef="-1"/></fixed></tendon>'
)


def test_ranges_of_tendons_are_kept(tmp_path: Path) -> None:
    """The second arm has to follow the first to within the tendon's range."""
    text = model(more=TENDON.format('range="-.4 .4"'))
    found = solve(tmp_path, text)
    assert found.status == "optimal"
    assert np.abs(found["joint.a"] - found["joint.b"]).max() == pytest.approx(0.4, abs=1e-6)
    assert repeats(found, tmp_path)
    freed = solve(tmp_path, model("limit", more=TENDON.format('range="-.4 .4"')))
    assert np.abs(freed["joint.a"] - freed["joint.b"]).max() > 0.9


def test_dry_friction_of_tendons_is_a_force_within_its_bound(tmp_path: Path) -> None:
    found = solve(tmp_path, model(more=TENDON.format('frictionloss=".5"')))
    assert found.status == "optimal"
    friction = found["tendon.t.friction"]
    rate = found.trajectories["joint.a", 1].before - found.trajectories["joint.b", 1].before
    assert np.abs(friction).max() <= 0.5 + 1e-9
    assert (friction * rate).max() <= 1e-6


def test_what_actuators_pull_on_a_tendon_is_limited(tmp_path: Path) -> None:
    """The sum of two actuators on a tendon keeps within its range, as MuJoCo cuts it off."""
    text = model(more=TENDON.format('actuatorfrcrange="-1 1"'))
    text = text.replace(
        "<actuator>", '<actuator><motor name="t1" tendon="t" gear="2"/><motor name="t2" tendon="t"/>'
    )
    spec = SWING.replace("integral(effort)", "integral(actuator.a^2 + actuator.b^2)")
    found = solve(tmp_path, text, spec)
    assert found.status == "optimal"
    assert np.abs(2 * found["actuator.t1"] + found["actuator.t2"]).max() <= 1.0 + 1e-6
    assert repeats(found, tmp_path)


def test_forces_outside_their_range_are_not_asked_for(tmp_path: Path) -> None:
    found = solve(tmp_path, model(motor='gear="3" forcerange="-.4 .4"'))
    assert found.status == "optimal"
    assert np.abs(found["actuator.a"]).max() == pytest.approx(0.4, abs=1e-6)
    assert repeats(found, tmp_path)


@pytest.mark.parametrize("limited", ["true", "false"])
def test_ranges_count_where_the_model_says_limited(tmp_path: Path, limited: str) -> None:
    found = solve(tmp_path, model(motor=f'gear="3" ctrlrange="-.4 .4" ctrllimited="{limited}"'))
    assert found.status == "optimal"
    assert (np.abs(found["actuator.a"]).max() <= 0.4 + 1e-9) == (limited == "true")
    assert repeats(found, tmp_path)


def test_an_actuator_with_several_controls_has_a_name_for_each(tmp_path: Path) -> None:
    text = model().replace(
        '<motor name="a" joint="a" />', '<pid name="a" joint="a" kp="3" kv="1" ki="2" input="pos vel ff"/>'
    )
    spec = SWING.replace(
        "integral(effort)", "integral(actuator.a.ff^2 + actuator.a.pos^2 + 0.1*actuator.a.vel^2)"
    )
    found = solve(tmp_path, text, spec)
    assert found.status == "optimal"
    assert {"actuator.a.pos", "actuator.a.vel", "actuator.a.ff", "actuator.a.activation"} <= set(
        found.variables
    )
    assert repeats(found, tmp_path)


def test_switched_off_actuation_leaves_a_motion_to_its_weight(tmp_path: Path) -> None:
    spec = f"{START}constraints: [0]: joint.a = 1; joint.b = 0; rest;"
    found = solve(tmp_path, model("actuation", motor='forcerange="1 2"'), spec)
    assert found.status == "optimal"
    assert repeats(found, tmp_path)
