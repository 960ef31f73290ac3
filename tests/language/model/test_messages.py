"""What a user is told of mistakes in specs with a model."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc.errors import SpecError

from .bodies import FEET, load, quadruped

START = "constants: n = 10, T = 1, h = T/n;\n"

CASES = {
    "joint": ("constraints: [0]: joint.FLx = 1;", "`joint.FLx` is not a name of the model"),
    "body": ("constraints: body.trank.z >= 0;", "did you mean `trunk`?"),
    "field": ("constraints: body.trunk.q >= 0;", "has no field `q`"),
    "pose": ("constraints: [0]: keyframe.sit;", "there is no pose `keyframe.sit`"),
    "vector": ("constraints: [0]: joint.FLh = (1, 2, 3);", "an expression is a number, not a vector"),
    "quaternion": ("constraints: [0]: joint.root.qw'' = 0;", "no second derivative of its own"),
    "lagrangian": ("lagrangian: joint.FLh'^2;", "a spec with a model has no Lagrangian"),
    "kind": ("contact: FL = hook(site.FL);", "there is no contact `hook`"),
    "site": ("contact: FL = point(site.F);", "the model has no site `F`"),
    "two": ("contact: FL = point(site.FL); [0, 5]: FL; [4, 8]: FL;", "stands already on [0, 5]"),
    "force": ("forces: joint.hip: 3;", "`joint.hip` is not declared"),
    "touching": (
        "contact: FL = point(site.FL); [0, 5]: FL; [5, 8]: FL;",
        "write one for both, from frame 0 to 8",
    ),
    "contact": (
        "contact: FL = point(site.FL); [0, n]: FL; constraints: [n]: FL.x = 1;",
        "such as `geom.NAME.x`; its forces are `FL_fx`",
    ),
    "axis": ("constraints: body.trunk.xaxis = 1;", "with `.xaxis.x`, `.xaxis.y` and `.xaxis.z`"),
    "energy": ("constraints: energy.total = 1;", "`energy.kinetic` or `energy.potential`"),
    "guess": ("guess: body.trunk.z = 1;", "is no coordinate or control of the model"),
    "mass": ("constants: k = body.nothing.mass;", "is not declared"),
}


@pytest.mark.parametrize("flag", ["contact", "constraint"])
def test_a_contact_that_the_model_switches_off_is_told_with_both_lines(tmp_path: Path, flag: str) -> None:
    model = quadruped().replace("<worldbody>", f'<option><flag {flag}="disable"/></option><worldbody>', 1)
    with pytest.raises(SpecError) as told:
        load(tmp_path, model, START + "contact: FL = point(site.FL); [0, n]: FL;").problem()
    assert "switches contacts off" in str(told.value)
    assert "motion.stc:3:" in str(told.value)
    assert "robot.xml:" in str(told.value)


@pytest.mark.parametrize("name", CASES)
def test_a_mistake_is_told_with_its_place(tmp_path: Path, name: str) -> None:
    text, message = CASES[name]
    with pytest.raises(SpecError) as told:
        load(tmp_path, quadruped(), START + text).problem()
    assert message in str(told.value)
    assert "motion.stc:3:" in str(told.value)


def test_a_pose_that_floats_is_told_with_the_distance(tmp_path: Path) -> None:
    text = f"{START}{FEET} [0, n]: FL; FR; RL; RR;\nconstraints: [0]: keyframe.stand + (0, 0, 0.05); rest;"
    with pytest.raises(SpecError, match=r"`FL` is 0.05 m above the floor in this pose"):
        load(tmp_path, quadruped(), text).problem()


def test_a_pose_is_grounded_on_what_its_feet_stand_on(tmp_path: Path) -> None:
    """On a box, and on a slope, where the ground is not below the feet by the height along its normal."""
    step = '<geom name="step" type="box" size=".5 .5 .05" pos="2 0 .05"/>'
    slope = '<geom name="slope" type="plane" size="3 3 1" pos="-2 0 0" euler="0 .3 0"/>'
    model = quadruped().replace('<geom name="floor"', f'{step}{slope}<geom name="floor"')
    on = [f"{foot} on geom.{{0}};" for foot in ("FL", "FR", "RL", "RR")]
    for name, x in (("step", 2), ("slope", -2)):
        rows = " ".join(on if name == "step" else on[:2]).format(name)
        text = f"""{START}{FEET} [6, n]: {rows}
        constraints: [0]: keyframe.stand + (0, 0, 1); rest; [n]: keyframe.stand + ({x}, 0, 1) grounded; rest;"""
        assert load(tmp_path, model, text).problem().of_model


def test_a_pose_that_moves_what_is_held_is_refused(tmp_path: Path) -> None:
    text = f"""{START}{FEET} [0, n]: FL; FR; RL; RR;
constraints: [0]: keyframe.stand; rest; [n]: keyframe.stand + (0.1, 0, 0); rest;"""
    with pytest.raises(
        SpecError, match=r"`FL` is 0.1 off its place in this pose, where it holds since frame 0"
    ):
        load(tmp_path, quadruped(), text).problem()


def test_a_path_needs_a_model(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="is a path of a model, and the spec has none"):
        stc.load(f"{START}variables: x; constraints: [0]: joint.knee = x;").problem()


def test_what_cannot_be_stated_is_named_and_can_be_left_out(tmp_path: Path) -> None:
    sticky = quadruped().replace('name="floor"', 'name="floor" adhesion="1"', 1)
    text = f"{START}constraints: [0]: keyframe.stand; rest;"
    with pytest.raises(SpecError) as told:
        load(tmp_path, sticky, text).problem()
    assert "robot.xml:" in str(told.value)
    assert "without adhesion" in str(told.value)
    (tmp_path / "motion.stc").write_text(f'model: "robot.xml" without adhesion;\n{text}', encoding="utf-8")
    assert stc.load(tmp_path / "motion.stc").problem().of_model


def test_a_missing_model_is_told_once(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(quadruped(), encoding="utf-8")
    spec = tmp_path / "motion.stc"
    text = "constants: n = 3;\nconstraints: joint.FLh;\nguess: joint.FLh = 1; forces: joint.FLh: 2;"
    spec.write_text(f'model: "robor.xml";\n{text}', encoding="utf-8")
    with pytest.raises(SpecError) as told:
        stc.load(spec).problem()
    assert str(told.value).count("error") == 1
    assert "did you mean `robot.xml`?" in str(told.value)


POSES = "constraints: [0]: keyframe.stand; rest;\n  [n]: keyframe.stand; rest;"


@pytest.mark.parametrize(
    ("lines", "warned"),
    [
        (f"{POSES}\n  -20 <= joint.*' <= 20;", True),
        (f"{POSES}\n  joint.*' >= -20;", True),
        (f"{POSES} -20 <= joint.*' <= 20;", False),
        (f"{POSES}\n  [n]: -20 <= joint.*' <= 20;", False),
        (f"{POSES}\n  [0, n]: -20 <= joint.*' <= 20;", False),
        (f"{POSES}\n  joint.FLh' <= 20;", False),
        (f"{POSES}\n  joint.*'' = 0;", False),
    ],
)
def test_limits_below_a_pose_are_told_of(tmp_path: Path, lines: str, warned: bool) -> None:
    """People mean all frames; where a limit is written beside its frame it is meant."""
    problem = load(tmp_path, quadruped(), START + lines).problem()
    found = [w for w in problem.warnings if "alone, with the pose" in w.message]
    assert bool(found) == warned


def test_a_surface_that_turns_is_named_with_its_line(tmp_path: Path) -> None:
    platform = '<body><joint name="tilt" axis="0 1 0"/><geom name="platform" type="box" size="1 1 .1" mass="1"/></body>'
    model = quadruped().replace('<geom name="floor"', f'{platform}\n<geom name="floor"')
    text = f"{START}contact: FL = point(site.FL); [0, n]: FL on geom.platform;"
    with pytest.raises(
        SpecError, match=r"the geom `platform` turns \(.*robot.xml:3\): standing on it cannot be stated"
    ):
        load(tmp_path, model, text).problem()


@pytest.mark.parametrize(("pull", "count"), [(-9.81, 0), (0.0, 0), (9.81, 1)])
def test_gravity_that_pulls_upwards_is_pointed_out(pull: float, count: int) -> None:
    problem = stc.load(
        'constants: n = 4, h = 0.1; model: "arm.xml"; objective: [0, n]: integral(effort);',
        **{"option.gravity.z": pull},
    ).problem()
    assert [w.message for w in problem.warnings if "upwards" in w.message] == [
        "gravity pulls upwards, by 9.81 m/s^2"
    ] * count
