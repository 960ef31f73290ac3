"""Numbers of a model in a spec: as constants, from expressions, as unknowns; equations and replay have the same."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc.certification import certify
from stc.errors import SpecError
from stc.studies.equations import check_equations
from stc.studies.replay_lines import check_replay_lines
from stc.validate import validate

from .bodies import load

ARM = """<mujoco><compiler angle="radian"/><worldbody><body name="arm"><joint name="a" axis="0 1 0" armature=".01"/>
  <geom name="rod" type="capsule" fromto="0 0 0 0 0 -.5" size=".03" mass="1"/></body></worldbody>
  <actuator><motor name="a" joint="a"/></actuator></mujoco>"""
SPEC = """constants: n = 20, T = 1, h = T/n;
constraints: [0]: joint.a = 0; rest; [n]: joint.a = 1; rest;
objective: [0, n]: integral(effort);
"""
#: Ways to make the arm swing with another armature, which acts like an inertia of its own.
WAYS = {
    "a constant of that path": "constants: joint.a.armature = 0.2;",
    "a line of the replay": "constants: J = 0.1; replay: set joint.a.armature = 2*J;",
    "a parameter in a line of the replay": (
        "parameters: J; guess: J = 0.1; constraints: J = 0.2; replay: set joint.a.armature = J;"
    ),
    "a parameter of that path": "parameters: joint.a.armature; constraints: joint.a.armature = 0.2;",
}


def test_a_mass_that_only_derived_numbers_hold_counts_as_used(tmp_path: Path) -> None:
    model = load(tmp_path, ARM, SPEC + "constants: body.arm.mass = 2;")
    wanted = load(tmp_path, ARM, SPEC + "replay: set body.arm.mass = 2;").solve().objective
    assert model.solve().objective == pytest.approx(wanted, rel=1e-9)
    assert wanted > 1.1 * load(tmp_path, ARM, SPEC).solve().objective
    assert not model.warnings


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("way", WAYS)
def test_equations_and_replay_have_the_same_number(tmp_path: Path, way: str) -> None:
    wanted = load(tmp_path, ARM.replace('armature=".01"', 'armature=".2"'), SPEC).solve().objective
    plain = load(tmp_path, ARM, SPEC).solve().objective
    assert abs(wanted - plain) > 0.1
    solution = load(tmp_path, ARM, SPEC + WAYS[way]).solve()
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(wanted, rel=1e-8)
    report = validate(solution, tmp_path / "robot.xml", tracked=False)
    assert max(m.value for m in report.metrics if m.name == "inverse-dynamics residual") < 1e-9
    assert report.fields["joint.a.armature"] == pytest.approx(0.2)


def test_a_mass_is_chosen(tmp_path: Path) -> None:
    """An unknown mass starts at the model's, and the least effort has the least that is allowed."""
    spec = f"{SPEC}parameters: body.arm.mass; constraints: 0.6 <= body.arm.mass <= 5;"
    solution = load(tmp_path, ARM, spec).solve()
    assert solution.status == "optimal"
    assert solution.parameters["body.arm.mass"] == pytest.approx(0.6, abs=1e-6)
    report = validate(solution, tmp_path / "robot.xml", tracked=False)
    assert max(m.value for m in report.metrics if m.name == "inverse-dynamics residual") < 1e-9


def test_equations_are_compared_with_the_number_that_is_set(tmp_path: Path) -> None:
    problem = load(tmp_path, ARM, SPEC + WAYS["a line of the replay"]).problem()
    assert check_equations(problem, states=20).passed


def test_a_number_that_is_zero_can_be_given(tmp_path: Path) -> None:
    plain = load(tmp_path, ARM, SPEC).solve().objective
    solution = load(tmp_path, ARM, f"{SPEC}constants: joint.a.damping = 0.5;").solve()
    assert solution.status == "optimal"
    assert abs(solution.objective - plain) > 1e-2
    report = validate(solution, tmp_path / "robot.xml", tracked=False)
    assert max(m.value for m in report.metrics if m.name == "inverse-dynamics residual") < 1e-9


MISTAKES = {
    "replay: set body.arm.pos.z = 0.3;": "would change the replay and not the equations",
    "parameters: body.arm.length;": "is not a number of the model that can be a parameter",
    "parameters: body.amr.mass;": "did you mean `body.arm.mass`?",
    "variables: joint.b;": "is not a number of the model that can be a variable",
    "constraints: momentum(joint.a) = 0;": "a spec with a model has no Lagrangian",
}


@pytest.mark.parametrize("text", MISTAKES)
def test_mistakes_are_told(tmp_path: Path, text: str) -> None:
    with pytest.raises(SpecError) as told:
        load(tmp_path, ARM, SPEC + text).problem()
    assert MISTAKES[text] in str(told.value)
    assert "motion.stc:5:" in str(told.value)


def test_friction_of_the_replay_alone_may_be_set(tmp_path: Path) -> None:
    assert load(tmp_path, ARM, f"{SPEC}replay: set geom.rod.friction.slide = 0.3;").problem().of_model


def test_a_vector_of_whole_numbers_needs_no_blanks(tmp_path: Path) -> None:
    robot = ARM.replace('<joint name="a"', '<joint name="x" type="slide" axis="1 0 0"/><joint name="a"')
    spec = "constants: n = 4; constraints: [0]: keyframe.reference + (1,0,0); [n]: keyframe.reference + (1,0, 0);"
    assert load(tmp_path, robot, spec).problem().of_model


def test_central_differences_are_refused_where_contact_changes(tmp_path: Path) -> None:
    hopper = ARM.replace('<joint name="a"', '<joint name="z" type="slide" axis="0 0 1"/><joint name="a"')
    hopper = hopper.replace("</body>", '<site name="tip" pos="0 0 -.5"/></body>')
    spec = "constants: n = 10; method: central; contact: F = point(site.tip);\n[0, 5]: F;"
    with pytest.raises(SpecError, match="the method `central` does not support jumps"):
        load(tmp_path, hopper, spec).problem()
    whole = spec.replace("[0, 5]", "[0, n]")
    assert load(tmp_path, hopper, whole).problem().method == "central"


@pytest.mark.parametrize("number", ["body.trunk.com.x=0.03", "body.trunk.pos.z=0.1", "site.chest.pos.x=0.05"])
def test_what_moves_in_the_model_moves_in_mujoco(tmp_path: Path, number: str) -> None:
    """MuJoCo takes frames that coincide for one: a number that moves one of them parts them."""
    robot = """<mujoco><worldbody><body name="trunk" pos="0 0 .3"><joint name="y" axis="0 1 0"/>
      <joint name="x" axis="1 0 0"/><geom type="box" size=".1 .2 .3" mass="2"/><site name="chest"/>
      <body name="arm" pos="0 0 .3"><joint name="a" axis="1 0 0"/><geom type="box" size=".1 .1 .2" mass="1"/></body>
      </body></worldbody><actuator><motor name="jet" site="chest" gear="0 0 1 0 .3 0"/></actuator></mujoco>"""
    spec = (
        "constants: n = 20, T = 0.5, h = T/n; constraints: [0]: keyframe.reference; rest; actuator.jet = 3*t;"
    )
    path, value = number.split("=")
    model = load(tmp_path, robot, spec)
    solution = model.solve(constants={path: float(value)})
    report = validate(solution, tmp_path / "robot.xml", tracked=False)
    assert report.fields[path] == float(value)
    assert max(m.value for m in report.metrics if m.name == "inverse-dynamics residual") < 1e-9


def test_a_gear_of_several_numbers_does_not_keep_a_motion_from_being_judged(tmp_path: Path) -> None:
    robot = ARM.replace('axis="0 1 0" armature=".01"', 'type="ball"').replace(
        'joint="a"/>', 'joint="a" gear="1 2 0"/>'
    )
    spec = (
        "constants: n = 10, T = 0.5, h = T/n; constraints: [0]: keyframe.reference; rest; actuator.a = 0.1;"
    )
    report = validate(load(tmp_path, robot, spec).solve(), tmp_path / "robot.xml", tracked=False)
    assert max(m.value for m in report.metrics if m.name == "inverse-dynamics residual") < 1e-9


def test_a_gear_of_several_parts_is_no_number_of_the_model(tmp_path: Path) -> None:
    """The replay has the whole gear, of which the first part alone is not to be set."""
    thrust = ARM.replace("</body>", '<site name="jet" pos="0 0 -.5"/></body>').replace(
        'joint="a"/></actuator>', 'site="jet" gear="3 1 0 0 2 0"/></actuator>'
    )
    check_replay_lines(load(tmp_path, thrust, SPEC).problem())
    with pytest.raises(SpecError, match="gear"):
        check_replay_lines(load(tmp_path, thrust, SPEC + "replay: set actuator.a.gear = 2;").problem())


FAULTS = {
    'mass="1"': ('mass="1.1"', "joint a: mass matrix entry"),
    'armature=".01"': ("", "joint a: mass matrix entry"),
    'joint="a"/></': ('joint="a" gear="-1"/></', "joint a: force of actuator.a: spec 1, model -1"),
    'damping=".02"': ("", "joint a: damping by a'"),
    'frictionloss=".03"': ("", "joint.a.frictionloss were 0.03 instead of 0"),
}


@pytest.mark.parametrize("right", FAULTS)
def test_numbers_of_another_model_that_is_replayed_are_judged(tmp_path: Path, right: str) -> None:
    """Those of the spec's own model do not hide them; a number that the spec changes counts for both."""
    wrong, words = FAULTS[right]
    arm = ARM.replace('armature=".01"', 'armature=".01" damping=".02" frictionloss=".03"')
    assert right in arm
    (tmp_path / "other.xml").write_text(arm.replace(right, wrong), encoding="utf-8")
    spec = SPEC + 'constants: option.gravity.z = -9; replay: model = "other.xml";'
    load(tmp_path, arm, spec).solve().save(tmp_path / "motion.npz")
    certificate = certify(stc.read(tmp_path / "motion.npz"))
    assert not certificate.passed
    assert words in certificate.headline
    assert "gravity" not in certificate.headline
