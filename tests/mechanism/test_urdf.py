"""URDFs as they are written for other programs: where their meshes lie, what they leave open, what specs add."""

from __future__ import annotations

import struct
from pathlib import Path

import mujoco
import numpy as np
import pytest
from mechanism_states import Compared, inverse, relative_error

from stc.mechanism.read import ModelFileError, read_model
from stc.model_source import opened
from stc.urdf import located

_INERTIAL = (
    '<inertial><origin xyz=".02 .01 -.1"/><mass value="{mass}"/>'
    '<inertia ixx=".02" iyy=".03" izz=".015" ixy=".001" ixz="-.002" iyz=".0005"/></inertial>'
)


def _joint(
    name: str, parent: str, child: str, more: str = "", kind: str = "revolute", at: str = "0 0 -.3"
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}" '
        f'rpy=".1 -.2 .3"/><axis xyz="1 2 .5"/>{more}</joint>'
    )


#: A limb whose shoulder is two joints with a link without mass between them, and whose fingers follow one another.
LIMB = f"""<robot name="limb">
  <link name="base"/>
  <link name="trunk">{_INERTIAL.format(mass=4)}</link>
  {_joint("mount", "base", "trunk", kind="fixed")}
  <link name="virtual"/>
  {_joint("shoulder_1", "trunk", "virtual", '<limit lower="-1" upper="2" effort="30" velocity="9"/>')}
  <link name="upper">{_INERTIAL.format(mass=2)}</link>
  {_joint("shoulder_2", "virtual", "upper", '<dynamics damping=".3"/><limit lower="-1" upper="1" effort="7"/>')}
  <link name="finger">{_INERTIAL.format(mass=1)}</link>
  {_joint("bend", "upper", "finger", '<dynamics damping=".1"/>', kind="continuous")}
  <link name="tip">{_INERTIAL.format(mass=0.5)}</link>
  {_joint("curl", "finger", "tip", '<mimic joint="bend" multiplier="-.5" offset=".2"/>', kind="continuous")}
</robot>"""

#: A plate that slides and turns in the plane, with a lift, and a ball that flies.
CART = f"""<robot name="cart"><link name="world"/>
  <link name="plate">{_INERTIAL.format(mass=3)}<collision><geometry><box size=".4 .3 .1"/></geometry></collision></link>
  {_joint("floating", "world", "plate", kind="planar")}
  <link name="lift">{_INERTIAL.format(mass=1)}</link>
  {_joint("rise", "plate", "lift", '<limit lower="0" upper=".5" effort="200" velocity="1"/>', kind="prismatic")}
  <link name="ball">{_INERTIAL.format(mass=0.2)}</link>
  {_joint("loose", "world", "ball", kind="floating")}
</robot>"""


@pytest.mark.parametrize("text", [LIMB, CART], ids=["limb", "cart"])
@pytest.mark.parametrize("additions", [(), ("freejoint", "motors", "floor")], ids=["plain", "with"])
def test_equations_are_those_of_mujoco(tmp_path: Path, text: str, additions: tuple[str, ...]) -> None:
    (tmp_path / "robot.urdf").write_text(text, encoding="utf-8")
    both = Compared(tmp_path / "robot.urdf", states=200, additions=additions)
    assert relative_error(both.values(both.dynamics.inverse()), both.in_mujoco(inverse)) < 1e-9


def test_additions() -> None:
    """A free root, motors as strong as the joints' efforts and none for what follows, and a floor."""
    plain = read_model("limb.urdf", text=LIMB)
    assert plain.n_freedoms == 4
    assert not plain.actuators
    model = read_model("limb.urdf", text=LIMB, additions=("freejoint", "motors", "floor"))
    assert [joint.kind for joint in model.joints] == ["free", "hinge", "hinge", "hinge", "hinge"]
    assert model.joints[0].name == "base"
    ranges = {motor.name: motor.control_ranges[0] for motor in model.actuators}
    assert ranges == {"shoulder_1": (-30, 30), "shoulder_2": (-7, 7), "bend": None}
    assert not any(joint.force_limited for joint in model.joints)
    assert [geom.kind for geom in model.geoms if geom.body == 0] == ["plane"]


def test_additions_keep_what_is_there() -> None:
    """Of a model with a floor, a free body and a motor nothing is added twice, and nothing is freed that is scenery."""
    text = """<mujoco><worldbody><geom type="plane" size="1 1 1"/><body name="table"><geom size=".1"/></body>
      <body name="arm"><geom size=".1"/><body><joint name="a"/><geom size=".1"/><body><joint/><geom size=".1"/>
      </body></body></body></worldbody><actuator><motor joint="a"/></actuator></mujoco>"""
    model = read_model("m.xml", text=text, additions=("freejoint", "motors", "floor"))
    assert [joint.kind for joint in model.joints] == ["free", "hinge", "hinge"]
    assert model.bodies[model.joints[0].body].name == "arm"
    assert [motor.target for motor in model.actuators] == [1, 2]
    assert sum(geom.kind == "plane" for geom in model.geoms) == 1


def test_a_link_without_mass_between_joints() -> None:
    """Its joint is one more of the link that it carries: places as where the link in between has a little mass."""
    thin = '<link name="virtual"><inertial><mass value="1e-9"/><inertia ixx="1e-9" iyy="1e-9" izz="1e-9" ixy="0" '
    heavy = LIMB.replace('<link name="virtual"/>', thin + 'ixz="0" iyz="0"/></inertial></link>')
    joined, apart = opened("limb.urdf", text=LIMB).model, opened("limb.urdf", text=heavy).model
    rng = np.random.default_rng(3)
    for q in rng.uniform(-1.0, 1.0, (20, 4)):
        places = []
        for model in (joined, apart):
            data = mujoco.MjData(model)
            for name, value in zip(("shoulder_1", "shoulder_2", "bend", "curl"), q, strict=True):
                data.joint(name).qpos = value
            mujoco.mj_kinematics(model, data)
            places.append(np.concatenate([data.body("tip").xpos, data.body("tip").xmat]))
        np.testing.assert_allclose(*places, rtol=0, atol=1e-12)


def test_a_joint_that_follows() -> None:
    tie = read_model("limb.urdf", text=LIMB).equalities[0]
    assert (tie.kind, tie.data[:3]) == ("joint", (0.2, -0.5, 0.0))
    still = LIMB.replace('name="bend" type="continuous"', 'name="bend" type="fixed"')
    tie = read_model("limb.urdf", text=still).equalities[0]
    assert tie.second == -1


def test_inertias_that_no_body_has() -> None:
    """They become possible, by as little as that takes, and are told of; possible ones stay as they are."""
    assert read_model("limb.urdf", text=LIMB).changes == ()
    flat = LIMB.replace('ixx=".02" iyy=".03" izz=".015" ixy=".001" ixz="-.002" iyz=".0005"', _FLAT, 1)
    model = read_model("limb.urdf", text=flat)
    assert len(model.changes) == 1
    assert '"trunk"' in model.changes[0]
    moments = sorted(model.bodies[2].inertia)
    np.testing.assert_allclose(moments, [0.01 + 1e-5, 0.02 + 1e-5, 0.03003 - 1e-5], rtol=1e-5)
    assert moments[0] + moments[1] >= moments[2]


#: The largest moment is 3e-5 more than the sum of the others.
_FLAT = 'ixx=".01" iyy=".02" izz=".03003" ixy="0" ixz="0" iyz="0"'

# -------------------------------------------------------------------------------------------------------- meshes


def _box(path: Path, size: float, text: bool = False) -> None:
    """A cube of an edge length as an STL file."""
    corners = size * (np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) - 0.5)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [corners[list(three)] for a, b, c, d in sides for three in ((a, b, c), (a, c, d))]
    path.parent.mkdir(parents=True, exist_ok=True)
    if text:
        lines = [
            "facet normal 0 0 0\nouter loop\n"
            + "".join(f"vertex {x} {y} {z}\n" for x, y, z in face)
            + "endloop\nendfacet\n"
            for face in faces
        ]
        path.write_text(f"solid box\n{''.join(lines)}endsolid box\n", encoding="utf-8")
    else:
        body = b"".join(struct.pack("<12fH", 0, 0, 0, *face.ravel(), 0) for face in faces)
        path.write_bytes(bytes(80) + struct.pack("<I", len(faces)) + body)


_ARM = """<robot name="arm"><link name="base"/>
  <joint name="elbow" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>
  <link name="arm">{inertial}{more}</link></robot>"""
_TOUCHED = '<collision><geometry><mesh filename="{}"/></geometry></collision>'
_SEEN = '<visual><geometry><mesh filename="{}"/></geometry></visual>'


def _arm(folder: Path, more: str, inertial: str = "") -> Path:
    path = folder / "urdf" / "arm.urdf"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(_ARM.format(inertial=inertial, more=more), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "name",
    [
        "package://arm_description/meshes/box.stl",
        "model://arm_description/meshes/box.stl",
        "../meshes/box.stl",
    ],
)
@pytest.mark.parametrize("text", [False, True], ids=["binary", "text"])
@pytest.mark.parametrize("folder", ["arm_description", "clone"])
def test_meshes_are_found(tmp_path: Path, name: str, text: bool, folder: str) -> None:
    """By package and by path, in a folder called like the package and in one that is not: a cube weighs its volume."""
    _box(tmp_path / folder / "meshes" / "box.stl", 0.1, text)
    model = read_model(_arm(tmp_path / folder, _TOUCHED.format(name)))
    assert model.bodies[2].mass == pytest.approx(1.0, rel=1e-5)


def test_packages_where_ros_looks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _box(tmp_path / "opt" / "share" / "arm_meshes" / "a b.stl", 0.1)
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path / 'opt'}")
    assert (
        located("package://arm_meshes/a%20b.stl", tmp_path)
        == tmp_path / "opt" / "share" / "arm_meshes" / "a b.stl"
    )
    assert located("package://arm_meshes/b.stl", tmp_path) is None


def test_meshes_of_one_name(tmp_path: Path) -> None:
    """What is seen and what is touched lie in two folders and are called alike; each is its own, at its scale."""
    _box(tmp_path / "visual" / "box.stl", 0.3)
    _box(tmp_path / "collision" / "box.stl", 0.1)
    scaled = (
        '<collision><geometry><mesh filename="../collision/box.stl" scale="2 1 1"/></geometry></collision>'
    )
    more = _SEEN.format("../visual/box.stl") + _TOUCHED.format("../collision/box.stl") + scaled
    model = read_model(_arm(tmp_path, more))
    assert model.bodies[2].mass == pytest.approx(3.0, rel=1e-5)
    assert len(model.geoms) == 3


def test_missing_looks_stop_nothing(tmp_path: Path) -> None:
    _box(tmp_path / "box.stl", 0.1)
    more = _SEEN.format("package://arm/gone.dae") + _TOUCHED.format("../box.stl")
    model = read_model(_arm(tmp_path, more))
    assert model.changes == ()
    assert len(model.geoms) == 1


def test_missing_shapes_of_links_with_an_inertia_are_told(tmp_path: Path) -> None:
    """What touches is left out, which is told; the equations are those of the stated inertia."""
    path = _arm(tmp_path, _TOUCHED.format("package://arm/gone.stl"), _INERTIAL.format(mass=2))
    model = read_model(path)
    assert model.bodies[2].mass == 2.0
    (told,) = model.changes
    assert "package://arm/gone.stl" in told
    assert '"arm"' in told


@pytest.mark.parametrize("name", ["package://arm/gone.stl", "../looks.dae"])
def test_missing_shapes_that_masses_are_computed_from_are_errors(tmp_path: Path, name: str) -> None:
    (tmp_path / "looks.dae").write_text("<COLLADA/>", encoding="utf-8")
    with pytest.raises(ModelFileError, match=r'mass of the link "arm".*line 3'):
        read_model(_arm(tmp_path, _TOUCHED.format(name)))


def test_links_that_overlap_as_drawn_do_not_touch() -> None:
    ball = '<collision><geometry><sphere radius=".2"/></geometry></collision>'
    text = LIMB
    for link in ("trunk", "finger", "tip"):
        text = text.replace(f'<link name="{link}">', f'<link name="{link}">{ball}')
    model = read_model("limb.urdf", text=text)
    pairs = {frozenset(model.bodies[k].name for k in pair) for pair in model.excluded}
    assert frozenset(("trunk", "finger")) not in pairs  # 0.6 m apart, as they are drawn
    far = text.replace('<origin xyz="0 0 -.3" rpy=".1 -.2 .3"/>', '<origin xyz="0 0 -.1"/>')
    near = read_model("limb.urdf", text=far)
    pairs = {frozenset(near.bodies[k].name for k in pair) for pair in near.excluded}
    assert frozenset(("trunk", "finger")) in pairs


def test_macros_are_told_of() -> None:
    text = LIMB.replace("</robot>", '<xacro:include filename="legs.xacro"/></robot>')
    with pytest.raises(ModelFileError, match="xacro"):
        read_model("limb.urdf", text=text)
    text = LIMB.replace(
        "</robot>", '<link name="a"><visual><origin xyz="$(optenv IMU_XYZ 0 0 0)"/></visual></link></robot>'
    )
    with pytest.raises(ModelFileError, match="xacro"):
        read_model("limb.urdf", text=text)
    commented = LIMB.replace("</robot>", "<!-- <xacro:leg/> --></robot>")
    assert len(read_model("limb.urdf", text=commented).joints) == 4


#: A root with a name of its own, in which a trunk floats, and a leg whose file states its mass only.
_LOOSE = f"""<robot name="loose"><link name="footprint"/>
  <link name="trunk">{_INERTIAL.format(mass=4)}</link>{_joint("base", "footprint", "trunk", kind="floating")}
  <link name="leg"><inertial><origin xyz=".1 0 0"/><mass value="3"/>
    <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="look.obj"/></geometry></visual>
    <collision><geometry><sphere radius="0"/></geometry></collision>
    <collision><origin xyz="0 .3 0"/><geometry><box size=".1 .2 .4"/></geometry></collision></link>
  {_joint("hip", "trunk", "leg", kind="continuous")}</robot>"""


@pytest.mark.nightly
def test_a_urdf_that_other_programs_take_as_it_is(tmp_path: Path) -> None:
    """A root that is not called world, an inertia of zeros, a shape without size, a mesh that is none."""
    (tmp_path / "robot.urdf").write_text(_LOOSE, encoding="utf-8")
    (tmp_path / "look.obj").write_text("v 0 0 0\nf 1 2 3\n", encoding="utf-8")
    both = Compared(tmp_path / "robot.urdf", 20)
    assert relative_error(both.values(both.dynamics.inverse()), both.in_mujoco(inverse)) < 1e-9
    root, hip = both.mechanism.joints
    assert (root.name, root.kind, hip.kind) == ("base", "free", "hinge")
    leg = both.mechanism.bodies[hip.body]
    assert leg.mass == 3.0
    assert leg.com == pytest.approx((0.1, 0.0, 0.0))
    sides = np.array([0.1, 0.2, 0.4])
    assert sorted(leg.inertia) == pytest.approx(sorted(3.0 / 12.0 * (sides @ sides - sides**2)))
    told = "; ".join(both.mechanism.changes)
    assert 'the link "leg" has a mass and no inertia: it gets that of its shapes' in told
    assert 'a shape of the link "leg" has no size' in told
