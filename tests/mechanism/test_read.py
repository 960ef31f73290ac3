"""What is read from a model file: names, kinds, places in the file, and a model in the other format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mechanism_states import Compared, inverse, relative_error

from stc.mechanism.mechanism import index_of
from stc.mechanism.read import ModelFileError, read_model

MODEL = """<mujoco>
  <option timestep="0.004" integrator="RK4" cone="elliptic"/>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 1" friction=".8 .1 .01"/>
    <body name="trunk" pos="0 0 1">
      <freejoint/>
      <geom type="box" size=".1 .2 .3" contype="2" conaffinity="3" condim="4" priority="1" margin=".01"/>
      <site name="imu" pos=".1 0 0"/>
      <body name="leg" pos="0 0 -.3">
        <joint axis="0 1 0" range="-1 1" damping=".5"/>
        <joint axis="1 0 0"/>
        <geom name="foot" type="sphere" size=".05"/>
      </body>
      <replicate count="2" offset="0 .1 0">
        <body name="arm"><joint type="slide" axis="0 0 1"/><geom size=".05"/></body>
      </replicate>
    </body>
  </worldbody>
  <contact>
    <exclude body1="trunk" body2="leg"/>
    <pair geom1="floor" geom2="foot" friction=".5 .5 .1 .1 .1"/>
  </contact>
  <equality><connect body1="leg" anchor="0 0 0"/></equality>
  <actuator>
    <motor joint="leg" ctrlrange="-2 2" gear="3"/>
    <position name="lift" joint="arm0" kp="5"/>
  </actuator>
  <keyframe><key name="stand" qpos="0 0 1 1 0 0 0 .1 .2 .3 .4" ctrl="1 2"/></keyframe>
</mujoco>
"""


@pytest.fixture(scope="module")
def text() -> str:
    return MODEL.replace('<joint axis="0 1 0"', '<joint name="leg" axis="0 1 0"').replace(
        'type="slide"', 'name="arm" type="slide"'
    )


def test_names(text: str) -> None:
    """Joints without a name are called by their body, once; actuators by what they act on."""
    unnamed = read_model("m.xml", text=MODEL[: MODEL.index("  <equality>")] + "</mujoco>")
    assert [joint.name for joint in unnamed.joints] == ["trunk", "leg", "leg_2", "arm0", "arm1"]
    model = read_model("m.xml", text=text)
    assert [joint.name for joint in model.joints] == ["trunk", "leg", "leg_2", "arm0", "arm1"]
    assert [actuator.name for actuator in model.actuators] == ["leg", "lift"]
    assert [body.name for body in model.bodies] == ["world", "trunk", "leg", "arm0", "arm1"]
    assert index_of(model.keyframes, "stand") == 0
    assert index_of(model.keyframes, "sit") is None


def test_numbers(text: str) -> None:
    """What the file says is in the data, in MuJoCo's units."""
    model = read_model("m.xml", text=text)
    leg = model.joints[1]
    assert (leg.kind, leg.qpos, leg.dof, leg.axis, leg.damping) == ("hinge", 7, 6, (0.0, 1.0, 0.0), 0.5)
    assert leg.limited
    assert leg.bounds == pytest.approx((-np.pi / 180, np.pi / 180))
    assert not model.joints[2].limited
    floor, trunk, foot = model.geoms[:3]
    assert (floor.name, floor.kind, floor.friction) == ("floor", "plane", (0.8, 0.1, 0.01))
    assert (trunk.contype, trunk.conaffinity, trunk.condim, trunk.priority) == (2, 3, 4, 1)
    assert (foot.kind, foot.body) == ("sphere", 2)
    assert model.sites[0].pos == (0.1, 0.0, 0.0)
    assert model.excluded == ((1, 2),)
    assert model.pairs[0].friction[:2] == (0.5, 0.5)
    motor, servo = model.actuators
    assert motor.control_ranges == ((-2.0, 2.0),)
    assert motor.gear[0] == 3.0
    assert (servo.gain, servo.bias, servo.bias_parameters[1]) == ("fixed", "affine", -5.0)
    options = model.options
    assert (options.timestep, options.integrator, options.cone) == (0.004, "rk4", "elliptic")
    assert model.keyframes[0].qpos[7:] == (0.1, 0.2, 0.3, 0.4)
    assert model.equalities[0].kind == "connect"
    assert model.equalities[0].between == "body"
    assert model.start[:7] == (0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    assert model.below(1) == [1, 2, 3, 4]


def test_places(text: str) -> None:
    """Elements know their lines, copies that of their original; a free joint has that of its body."""
    model = read_model("m.xml", text=text)
    lines = text.splitlines()
    things = [
        *[(body, "<body") for body in model.bodies[1:]],
        (model.joints[0], '<body name="trunk"'),
        *[(joint, "<joint") for joint in model.joints[1:]],
        *[(geom, "<geom") for geom in model.geoms],
        *[(site, "<site") for site in model.sites],
        (model.actuators[0], "<motor"),
        (model.actuators[1], "<position"),
        (model.equalities[0], "<connect"),
        (model.options, "<option"),
    ]
    for thing, tag in things:
        assert thing.place is not None
        assert thing.place.file == "m.xml"
        assert tag in lines[thing.place.line - 1]
    assert model.bodies[3].place == model.bodies[4].place


def test_places_in_included_files(tmp_path: Path) -> None:
    """An element of an included file is said to be there, on its own line."""
    (tmp_path / "legs.xml").write_text(
        '<mujoco>\n <worldbody>\n  <body name="leg">\n   <joint name="hip"/>\n   <geom size=".1"/>\n  </body>\n'
        " </worldbody>\n</mujoco>\n"
    )
    main = tmp_path / "main.xml"
    main.write_text(
        '<mujoco>\n <include file="legs.xml"/>\n <worldbody>\n  <body name="trunk"><geom size=".1"/></body>\n'
        " </worldbody>\n</mujoco>\n"
    )
    model = read_model(main)
    found = {body.name: body.place for body in model.bodies[1:]}
    assert str(found["leg"]) == f"{tmp_path / 'legs.xml'}:3"
    assert str(found["trunk"]) == f"{main}:4"
    assert str(model.joints[0].place) == f"{tmp_path / 'legs.xml'}:4"


def test_urdf(tmp_path: Path) -> None:
    """A URDF file is read by the same reader and gives the same forces as MuJoCo's."""
    inertial = (
        '<inertial><origin xyz=".1 .2 .3"/><mass value="2"/>'
        '<inertia ixx=".1" iyy=".2" izz=".25" ixy=".01" ixz="0" iyz="0"/></inertial>'
    )
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(
        f'<robot name="arm"><link name="base"/><link name="upper">{inertial}</link><link name="lower">{inertial}</link>'
        '<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>'
        '<origin xyz="0 0 1" rpy=".1 .2 .3"/>'
        '<axis xyz="1 2 3"/><limit lower="-1" upper="1" effort="10" velocity="1"/><dynamics damping=".3"/></joint>'
        '<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><origin xyz="0 0 1"/>'
        '<axis xyz="0 1 0"/></joint></robot>'
    )
    both = Compared(urdf, states=100)
    assert [joint.name for joint in both.mechanism.joints] == ["shoulder", "elbow"]
    assert relative_error(both.values(both.dynamics.inverse()), both.in_mujoco(inverse)) < 1e-9


def test_warnings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What MuJoCo says about a file is in the data, and nowhere else."""
    monkeypatch.chdir(tmp_path)
    body = '<worldbody><body><joint/><geom size=".1"/></body></worldbody>'
    model = read_model("m.xml", text=f'<mujoco><compiler settotalmass="3"/>{body}</mujoco>')
    assert len(model.warnings) == 1
    assert "settotalmass" in model.warnings[0]
    assert not list(tmp_path.iterdir())
    assert read_model("m.xml", text="<mujoco/>").warnings == ()


@pytest.mark.parametrize(
    ("compiler", "others", "doubted"), [("", "", True), ('angle="radian"', "", False), ("", "-90 90", False)]
)
def test_ranges_in_rad_that_are_read_in_degrees_are_doubted(
    compiler: str, others: str, doubted: bool
) -> None:
    ranges = ["-1.2 0.8", others or "0 2.5"]
    bodies = "".join(
        f'<body name="b{k}"><joint name="j{k}" range="{each}"/><geom size=".1"/></body>'
        for k, each in enumerate(ranges)
    )
    told = read_model(
        "m.xml", text=f"<mujoco><compiler {compiler}/><worldbody>{bodies}</worldbody></mujoco>"
    ).warnings
    assert [("j0" in each and "-1.2 to 0.8" in each and "radian" in each) for each in told] == [
        True
    ] * doubted


def test_what_is_no_model(tmp_path: Path) -> None:
    """The message names the file and carries MuJoCo's own."""
    broken = tmp_path / "broken.xml"
    broken.write_text("<mujoco><worldbody><body></mujoco>")
    with pytest.raises(ModelFileError, match=r"broken\.xml"):
        read_model(broken)
    with pytest.raises(ModelFileError, match=r"nowhere\.xml"):
        read_model(tmp_path / "nowhere.xml")
    with pytest.raises(ModelFileError, match="joynt"):
        read_model("m.xml", text="<mujoco><worldbody><body><joynt/></body></worldbody></mujoco>")


def test_what_is_centred_to_within_rounding_is_centred() -> None:
    """As MuJoCo takes it: it computes with the own frame of a body where another is the same but for noise."""
    text = """<mujoco><worldbody><body><freejoint/><inertial pos="3e-9 0 0" mass="2" diaginertia="1 2 3"/>
      <geom size=".1" pos="0 -2e-9 0"/><site name="s" pos="0 .1 0"/></body></worldbody></mujoco>"""
    found = read_model("noise.xml", text)
    assert found.bodies[1].com == (0.0, 0.0, 0.0)
    assert found.geoms[0].pos == (0.0, 0.0, 0.0)
    assert found.sites[0].pos == (0.0, 0.1, 0.0)
