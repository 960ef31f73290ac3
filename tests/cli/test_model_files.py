"""`stc show robot.xml` and `stc new --model robot.xml`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stc
from stc.certification import certify
from stc.cli import model_starter
from stc.cli.main import run
from stc.validate import validate


def test_a_model_is_listed_with_what_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "sticky.xml"
    model.write_text(
        """<mujoco><worldbody><body name="fish"><freejoint name="left/root"/>
        <geom name="belly" size=".1" adhesion="1"/></body></worldbody></mujoco>""",
        encoding="utf-8",
    )
    assert run(["show", str(model)]) == 0
    shown = capsys.readouterr().out
    assert 'joint."left/root" (free)' in shown
    assert "geom.belly (sphere)" in shown
    assert "cannot be stated:" in shown
    assert "sticky.xml:2" in shown
    assert "without adhesion" in shown
    assert "overlap" not in shown


def test_bodies_that_are_drawn_one_in_another_are_listed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A turret in its base: MuJoCo lets no body collide with its parent, unless that is fixed to the world."""
    model = tmp_path / "turret.xml"
    turret = '<body name="turret"><joint/><geom size=".1"/><body name="gun"><joint/><geom size=".1"/></body></body>'
    model.write_text(
        f'<mujoco><worldbody><body name="base"><geom size=".1"/>{turret}</body></worldbody></mujoco>',
        encoding="utf-8",
    )
    assert run(["show", str(model)]) == 0
    (line,) = [each for each in capsys.readouterr().out.splitlines() if "overlap" in each]
    assert line.endswith("`with excludes`: base and turret; base and gun")


@pytest.mark.parametrize("model", ["arm.xml", pytest.param("quadruped.xml", marks=pytest.mark.nightly)])
def test_a_starter_spec_of_a_model_states_a_problem(
    tmp_path: Path, model: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["new", "mine", "--model", model]) == 0
    problem = stc.load("mine.stc").problem()
    assert problem.of_model
    assert not problem.warnings
    if model == "arm.xml":
        assert stc.load("mine.stc").solve().status == "optimal"


_LIFT = """<mujoco><worldbody><body><joint name="lift" type="slide" axis="0 0 1" range="0 .4"/>
    <geom type="cylinder" size=".05 .1"/><body pos=".3 0 0"><joint name="turn" axis="0 0 1"/>
    <geom type="capsule" fromto="0 0 0 .2 0 0" size=".02"/></body></body></worldbody>
    <actuator><motor joint="lift"/><motor joint="turn"/></actuator></mujoco>"""
_SATELLITE = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
    <geom type="box" size=".3 .3 .4"/>
    <body name="wheel"><joint name="wheel"/><geom type="cylinder" size=".1 .03"/></body>
    </body></worldbody><actuator><motor joint="wheel"/></actuator></mujoco>"""


@pytest.mark.parametrize("model", [_LIFT, _SATELLITE])
def test_what_a_motor_lifts_and_what_has_no_weight_need_no_floor(
    model: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("lift.xml").write_text(model, encoding="utf-8")
    assert run(["new", "mine", "--model", "lift.xml"]) == 0
    text = Path("mine.stc").read_text(encoding="utf-8")
    assert "holds a pose with the least effort" in text.splitlines()[0]
    assert "floor" not in text and "contact" not in text


_LEG = """<mujoco><worldbody>{floor}<body name="hip" pos="0 0 1">
  <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
  <joint name="pitch" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 .4" size=".05"/>
  <body name="shin"><joint name="knee" axis="0 1 0" limited="true" range="20 120"/>
    <geom type="capsule" fromto="0 0 0 0 0 -.4" size=".04"/>
    <body name="foot" pos="0 0 -.4"><joint name="ankle" axis="0 1 0" range="-90 90"/>
      <geom type="capsule" fromto="-.12 0 0 .15 0 0" size=".04"/></body></body></body></worldbody>
  <actuator><motor joint="knee"/><motor joint="ankle"/></actuator></mujoco>"""


_ROTORS = """<mujoco><worldbody><body name="frame" pos="0 0 1"><freejoint name="root"/>
    <inertial pos="0 0 .05" mass="1.3" fullinertia=".04 .03 .06 .001 0 0"/>
    <geom type="box" size=".1 .1 .02" contype="0" conaffinity="0"/>{sites}</body></worldbody>
    <actuator>{rotors}</actuator></mujoco>"""


@pytest.mark.slow
@pytest.mark.parametrize(("most", "title"), [(5.0, "holds a pose"), (3.0, "is let go")])
def test_a_starter_of_what_flies_hovers_if_its_rotors_lift_it(
    most: float, title: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Four rotors lift 1.3 kg with 3.2 N each; if they do not, the page says at its top what it does not do."""
    monkeypatch.chdir(tmp_path)
    places = [(-1, -1), (-1, 1), (1, 1), (1, -1)]
    sites = "".join(f'<site name="s{k}" pos="{0.2 * x} {0.2 * y} .05"/>' for k, (x, y) in enumerate(places))
    rotors = "".join(
        f'<motor site="s{k}" gear="0 0 1 0 0 {0.02 * x * y}" ctrlrange="0 {most}" ctrllimited="true"/>'
        for k, (x, y) in enumerate(places)
    )
    Path("drone.xml").write_text(_ROTORS.format(sites=sites, rotors=rotors), encoding="utf-8")
    assert run(["new", "mine", "--model", "drone.xml"]) == 0
    first, second, *_ = Path("mine.stc").read_text(encoding="utf-8").splitlines()
    assert title in first
    assert (second == "# More was asked of it at first:") == (title == "is let go")


@pytest.mark.parametrize("floor", ["", '<geom type="plane" size="2 2 .1"/>'])
def test_a_starter_of_a_leg_whose_file_draws_it_beyond_a_stop_solves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, floor: str
) -> None:
    """Its foot is a capsule, it has the name of a bundled model, and its spec goes into another folder."""
    monkeypatch.chdir(tmp_path)
    Path("robots").mkdir()
    Path("robots/humanoid.xml").write_text(_LEG.format(floor=floor), encoding="utf-8")
    assert run(["new", "specs/mine", "--model", "robots/humanoid.xml"]) == 0
    solution = stc.load("specs/mine.stc").solve(max_iterations=300)
    assert solution.status == "optimal"
    knee = solution["joint.knee"]
    assert knee.min() > np.radians(20) - 1e-6


@pytest.mark.parametrize(
    "name",
    ["hopper", *(pytest.param(n, marks=pytest.mark.nightly) for n in ("ant", "half_cheetah"))],
)
def test_a_starter_of_a_robot_of_others_stands_and_passes_validation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Its legs are drawn straight or out of range, its feet are capsules with a margin, and its contacts are soft."""
    gymnasium = pytest.importorskip("gymnasium")
    path = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / f"{name}.xml"
    monkeypatch.chdir(tmp_path)
    assert run(["new", "mine", "--model", str(path)]) == 0
    text = Path("mine.stc").read_text(encoding="utf-8")
    assert "contact:" in text
    certificate = certify(stc.load("mine.stc").solve(), equations=False)
    assert certificate.passed, certificate.headline


@pytest.mark.nightly
def test_a_starter_of_an_arm_holds_it_beside_an_object_drawn_in_the_floor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The cylinder that gymnasium's arm pushes slides along the table: it does not fall, and takes no part."""
    gymnasium = pytest.importorskip("gymnasium")
    path = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / "pusher.xml"
    monkeypatch.chdir(tmp_path)
    assert run(["new", "mine", "--model", str(path)]) == 0
    assert "holds a pose" in Path("mine.stc").read_text(encoding="utf-8").splitlines()[0]
    assert certify(stc.load("mine.stc").solve(), equations=False).passed


def test_a_starter_of_a_model_that_is_too_large_to_be_tried_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page that asks for most is written, and states a problem."""
    monkeypatch.chdir(tmp_path)
    assert run(["new", "mine", "--model", "quadruped.xml", "--time-limit", "1e-9"]) == 0
    text = Path("mine.stc").read_text(encoding="utf-8")
    assert text.startswith("# This page was not tried: the model is large")
    assert "stands still" in text
    assert stc.load("mine.stc").problem().of_model


def test_a_model_without_joints_has_no_starter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("stone.xml").write_text("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>", encoding="utf-8")
    assert run(["new", "mine", "--model", "stone.xml"]) == 2
    assert "no joints" in capsys.readouterr().err
    assert not Path("mine.stc").exists()


def test_a_starter_of_a_model_without_actuators_tells_how_to_drive_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("arm.xml").write_text(
        """<mujoco><worldbody><body><joint name="left elbow" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -1"
        size=".1"/></body></worldbody></mujoco>""",
        encoding="utf-8",
    )
    assert run(["new", "mine", "--model", "arm.xml"]) == 0
    text = Path("mine.stc").read_text(encoding="utf-8")
    assert "`with motors`" in text
    driven = text.replace('"arm.xml"', '"arm.xml" with motors').replace(
        "  [n]: begin;", '  [n]: joint."left elbow" = 1;'
    )
    Path("mine.stc").write_text(driven, encoding="utf-8")
    solution = stc.load("mine.stc").solve()
    assert solution.status == "optimal"
    assert np.abs(solution['actuator."left elbow"']).max() > 1.0


def test_a_missing_model_is_a_mistake(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["show", str(tmp_path / "none.xml")]) == 2
    assert "there is no model" in capsys.readouterr().err


_ARM = """<robot name="arm"><link name="base"/><joint name="elbow" type="continuous"><parent link="base"/>
  <child link="arm"/><axis xyz="0 1 0"/></joint><link name="arm"><inertial><origin xyz="0 0 -.5"/><mass value="1"/>
  <inertia ixx=".1" iyy=".1" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial>{more}</link></robot>"""


def test_what_a_urdf_does_not_state_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its base and motors in the listing, and what is left out of it."""
    mesh = '<collision><geometry><mesh filename="package://arm/meshes/arm.stl"/></geometry></collision>'
    (tmp_path / "arm.urdf").write_text(_ARM.format(more=mesh), encoding="utf-8")
    assert run(["show", str(tmp_path / "arm.urdf")]) == 0
    told = capsys.readouterr().out
    assert 'model: "arm.urdf" with freejoint, motors, floor;' in told
    assert "package://arm/meshes/arm.stl" in told


def test_a_starter_of_a_urdf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An arm stays mounted and gets motors; the saved motion says so to whoever replays it."""
    monkeypatch.chdir(tmp_path)
    Path("arm.urdf").write_text(_ARM.format(more=""), encoding="utf-8")
    assert run(["new", "mine", "--model", "arm.urdf"]) == 0
    assert 'model: "arm.urdf" with motors;' in Path("mine.stc").read_text(encoding="utf-8")
    stc.load("mine.stc").solve().save("mine.npz")
    Path("mine.stc").unlink()
    assert validate("mine.npz").passed


_URDF_LEG = """<link name="{n}_hip"><inertial><mass value=".5"/><inertia ixx=".002" iyy=".002" izz=".002" ixy="0"
  ixz="0"
  iyz="0"/></inertial></link><link name="{n}_thigh"><inertial><origin xyz="0 0 -.1"/><mass value=".5"/><inertia
  ixx=".003" iyy=".003" izz=".001" ixy="0" ixz="0" iyz="0"/></inertial></link><link name="{n}_shin"><inertial><origin
  xyz="0 0 -.1"/><mass value=".2"/><inertia ixx=".001" iyy=".001" izz=".0005" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><origin xyz="0 0 -.2"/><geometry><sphere radius=".02"/></geometry></collision></link>
  <joint name="{n}_side" type="revolute"><parent link="trunk"/><child link="{n}_hip"/><origin xyz="{x} {y} 0"/>
  <axis xyz="1 0 0"/><limit lower="-.8" upper=".8" effort="30" velocity="20"/></joint>
  <joint name="{n}_swing" type="revolute"><parent link="{n}_hip"/><child link="{n}_thigh"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="3" effort="30" velocity="20"/></joint>
  <joint name="{n}_knee" type="revolute"><parent link="{n}_thigh"/><child link="{n}_shin"/><origin xyz="0 0 -.2"/>
  <axis xyz="0 1 0"/><limit lower="-2.5" upper="-.5" effort="30" velocity="20"/></joint>"""


@pytest.mark.nightly
def test_a_starter_of_a_urdf_with_legs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It stands, on a floor of its own, with knees bent that the drawn pose has outside of their ranges."""
    monkeypatch.chdir(tmp_path)
    legs = [
        _URDF_LEG.format(n=f"{a}{b}", x=x, y=y)
        for a, x in (("F", 0.2), ("R", -0.2))
        for b, y in (("L", 0.1), ("R", -0.1))
    ]
    trunk = """<link name="base"/><joint name="mount" type="fixed"><parent link="base"/><child link="trunk"/></joint>
      <link name="trunk"><inertial><mass value="6"/><inertia ixx=".03" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/>
      </inertial><collision><geometry><box size=".4 .2 .1"/></geometry></collision></link>"""
    Path("dog.urdf").write_text(f'<robot name="dog">{trunk}{"".join(legs)}</robot>', encoding="utf-8")
    assert run(["new", "mine", "--model", "dog.urdf"]) == 0
    text = Path("mine.stc").read_text(encoding="utf-8")
    assert 'model: "dog.urdf" with freejoint, motors, floor;' in text
    assert "stands still" in text
    assert run(["run", "mine"]) == 0


_WHEELS = "".join(
    f"""<link name="wheel{k}"><inertial><mass value=".3"/><inertia ixx=".001" iyy=".001" izz=".001" ixy="0" ixz="0"
    iyz="0"/></inertial><collision><geometry><cylinder radius=".06" length=".03"/></geometry></collision></link>
    <joint name="axle{k}" type="continuous"><parent link="trunk"/><child link="wheel{k}"/><axis xyz="0 0 1"/>
    <origin xyz="{x} {y} .06" rpy="-1.5707963267948966 0 0"/></joint>"""
    for k, (x, y) in enumerate([(-0.1, 0.1), (-0.1, -0.1), (0.1, 0.1), (0.1, -0.1)])
)


@pytest.mark.parametrize(
    ("name", "root", "parts", "words"),
    [
        ("world", "floating", _URDF_LEG.format(n="F", x=0, y=0), "motors, floor"),
        ("base", "fixed", _WHEELS, "freejoint, motors, floor"),
    ],
)
def test_a_urdf_that_is_free_or_on_wheels_gets_a_floor(
    name: str, root: str, parts: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(model_starter, "_SECONDS", 0.0)  # nothing is solved
    monkeypatch.chdir(tmp_path)
    trunk = f"""<link name="{name}"/><link name="trunk"><inertial><mass value="6"/><inertia ixx=".03" iyy=".1" izz=".1"
      ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="mount" type="{root}"><parent link="{name}"/>
      <child link="trunk"/></joint>"""
    Path("robot.urdf").write_text(f'<robot name="robot">{trunk}{parts}</robot>', encoding="utf-8")
    assert run(["new", "mine", "--model", "robot.urdf"]) == 0
    assert f'model: "robot.urdf" with {words};' in Path("mine.stc").read_text(encoding="utf-8")


def test_words_for_what_is_added(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "arm.urdf").write_text(_ARM.format(more=""), encoding="utf-8")
    (tmp_path / "arm.stc").write_text(
        'constants: n = 2, h = 1; model: "arm.urdf" with flor;', encoding="utf-8"
    )
    assert run(["check", str(tmp_path / "arm.stc")]) == 2
    assert "did you mean `floor`?" in capsys.readouterr().err


@pytest.mark.nightly
def test_wheels_of_a_starter_spec_roll(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    model = """<mujoco><option timestep="1e-4" integrator="RK4" impratio="10"/><worldbody>
      <geom type="plane" size="5 5 .1" friction=".9" solref="0.0004 1"/>
      <body name="trunk" pos="0 0 .1"><joint name="x" type="slide" axis="1 0 0"/>
        <joint name="z" type="slide" axis="0 0 1"/><joint name="pitch" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 .05 0 0 .6" size=".04" mass="4" contype="0" conaffinity="0"/>
        <body name="wheels"><joint name="axle" axis="0 1 0"/>
          <geom name="wheel" type="cylinder" fromto="0 -.1 0 0 .1 0" size=".1" mass="1" friction=".9"
            solref="0.0004 1"/>
        </body></body></worldbody><actuator><motor joint="axle"/></actuator></mujoco>"""
    Path("cart.xml").write_text(model)
    assert run(["new", "mine", "--model", "cart.xml"]) == 0
    text = Path("mine.stc").read_text()
    assert "point(body.wheels, 0, 0.1, 0), radius = 0.1" in text
    drive = """constants: n = 40, T = 1, h = T/n, D = 0.5;
        model: "cart.xml";
        contact: wheel = {wheel}, friction = 0.8; [0, n]: wheel;
        constraints: [0]: keyframe.reference; rest; [n]: joint.x = D; joint.pitch; rest;
        objective: [0, n]: integral(effort);"""
    with pytest.raises(stc.SpecError, match="cylinder") as caught:
        stc.load(drive.format(wheel="point(geom.wheel)")).problem()
    wheel = "point(body.wheels, 0, 0, 0), radius = 0.1"
    assert f"`{wheel}`" in str(caught.value)
    solution = stc.load(drive.format(wheel=wheel)).solve()
    assert solution.status == "optimal"
    assert solution["joint.axle"][-1] == pytest.approx(5.0, abs=1e-6)
    assert certify(solution).passed


_CAR = """<mujoco><compiler autolimits="true"/><worldbody><geom type="plane" size="5 5 .1"/>
  <body name="car" pos="0 0 .05"><freejoint/><geom type="box" size=".2 .1 .03" pos="0 0 .04" mass="2"/>
    {front}
    <body name="left" pos="-.15 .12 0"><joint name="left" axis="0 1 0" damping=".01"/>
      <geom type="cylinder" size=".05 .02" euler="90 0 0" mass=".2"/></body>
    <body name="right" pos="-.15 -.12 0"><joint name="right" axis="0 1 0" damping=".01"/>
      <geom type="cylinder" size=".05 .02" euler="90 0 0" mass=".2"/></body></body></worldbody>
  <actuator><motor joint="left" ctrlrange="-1 1"/><motor joint="right" ctrlrange="-1 1"/></actuator></mujoco>"""
_FRONT_WHEELS = "".join(
    f"""<body name="{name}" pos=".15 {y} 0"><joint name="{name}" axis="0 1 0" damping=".01"/>
      <geom type="cylinder" size=".05 .02" euler="90 0 0" mass=".2"/></body>"""
    for name, y in (("ahead_left", 0.12), ("ahead_right", -0.12))
)
_CASTER = '<geom name="caster" size=".02" pos=".15 0 -.03" mass=".1" condim="1" priority="1"/>'


@pytest.mark.nightly
@pytest.mark.parametrize(("front", "wheels"), [(_FRONT_WHEELS, 4), (_CASTER, 2)])
def test_a_starter_of_a_car_stands_on_its_wheels(
    front: str, wheels: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On the middle of each, where their load is; a caster of the chassis counts as well."""
    monkeypatch.chdir(tmp_path)
    Path("car.xml").write_text(_CAR.format(front=front), encoding="utf-8")
    assert run(["new", "mine", "--model", "car.xml"]) == 0
    text = Path("mine.stc").read_text(encoding="utf-8")
    assert "stands still" in text.splitlines()[0]
    assert text.count(", 0, 0, 0), radius = 0.05") == wheels
    assert ("point(geom.caster), friction = 0;" in text) == (wheels == 2)
    assert certify(stc.load("mine.stc").solve()).passed


_CRANE = """<mujoco><compiler autolimits="true"/><worldbody><geom type="plane" size="5 5 .1"/>
  <body name="mast" pos="0 0 1"><geom type="box" size=".1 .1 .3" mass="9"/>
    <body name="boom" pos="0 0 .3"><joint name="luff" axis="0 -1 0" range="-10 70" damping="5"/>
      <geom type="capsule" fromto="0 0 0 .9 0 0" size=".03" mass="4"/>
      <body name="rope" pos=".9 0 -.05"><joint name="swing" type="ball" damping=".02"/>
        <geom type="capsule" fromto="0 0 0 0 0 -.5" size=".008" mass=".1"/></body></body></body>
  <body name="load" pos=".9 0 .65"><freejoint/><geom type="box" size=".08 .08 .08" mass="2"/></body>
  <body name="crate" pos="2 0 .1"><freejoint/><geom type="box" size=".2 .3 .1" mass="1"/></body></worldbody>
  <equality><connect body1="rope" body2="load" anchor="0 0 -.5"/></equality>
  <actuator><motor joint="luff" gear="120" ctrlrange="-1 1"/></actuator></mujoco>"""


@pytest.mark.nightly
def test_a_starter_of_a_crane_holds_its_load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The boom begins inside of the mast, the rope ends inside of the load, and a crate lies on the floor.

    With the links of the model as soft as MuJoCo has them the load sinks, and advice names them.
    """
    monkeypatch.chdir(tmp_path)
    Path("crane.xml").write_text(_CRANE, encoding="utf-8")
    assert run(["new", "mine", "--model", "crane.xml"]) == 0
    text = Path("mine.stc").read_text(encoding="utf-8")
    assert "holds a pose" in text.splitlines()[0]
    assert 'model: "crane.xml" with excludes;' in text
    assert text.count("point(body.crate") == 3
    certificate = certify(stc.load("mine.stc").solve(), equations=False)
    assert certificate.passed, certificate.headline
    soft = text.replace("  set option.solref.time = 0.0005;\n", "")
    Path("mine.stc").write_text(soft, encoding="utf-8")
    certificate = certify(stc.load("mine.stc").solve(), equations=False)
    assert not certificate.passed
    assert any("stiffer" in step and "solref" in step for step in certificate.next_steps)


#: What robots of others have, and what the pages of these do.
_MOUNTED = {
    "dry friction": (
        """<mujoco><worldbody><body pos="0 0 1"><joint name="shoulder" axis="0 1 0" frictionloss=".1" damping=".01"/>
        <geom type="capsule" fromto="0 0 0 .4 0 0" size=".04" mass="2"/><body pos=".4 0 0"><joint name="elbow"
        axis="0 1 0" frictionloss=".1" damping=".01"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass="1"/>
        <body pos=".3 0 0"><joint name="wrist" axis="1 0 0" frictionloss=".01"/><geom type="box" size=".03 .02 .02"
        pos=".03 0 0" mass=".1"/></body></body></body></worldbody><actuator><motor joint="shoulder"/><motor
        joint="elbow"/><motor joint="wrist"/></actuator></mujoco>""",
        "holds a pose with the least effort",
    ),
    "servos and dampers of light fingers at their stops": (
        """<mujoco><compiler angle="radian"/><worldbody><body pos="0 0 1"><joint name="near" axis="0 1 0" range="0 1.6"
        damping=".1"/><geom type="capsule" fromto="0 0 0 -.04 0 0" size=".008" mass=".02"/><body pos="-.04 0 0"><joint
        name="far" axis="0 1 0" range="0 1.6" damping=".1"/><geom type="capsule" fromto="0 0 0 -.02 0 0" size=".006"
        mass=".005"/></body></body></worldbody><actuator><position joint="near" kp=".2" ctrlrange="0 1.6"/><position
        joint="far" kp=".1" ctrlrange="0 1.6"/></actuator></mujoco>""",
        "holds a pose with the least effort",
    ),
    "a joint without a motor at its stop": (
        """<mujoco><compiler angle="radian"/><worldbody><body pos="0 0 1"><joint name="arm" axis="0 1 0"/><geom
        type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass="1"/><body pos=".3 0 0"><joint name="flap" axis="0 -1 0"
        range="0 1" damping="1e-3"/><geom type="capsule" fromto="0 0 0 .1 0 0" size=".01" mass=".01"/></body></body>
        </worldbody><actuator><motor joint="arm"/></actuator></mujoco>""",
        "holds a pose that takes the least effort",  # it hangs
    ),
}


@pytest.mark.nightly
@pytest.mark.parametrize("what", _MOUNTED)
def test_a_starter_of_what_is_mounted_holds_what_its_motors_can(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Friction that creeps, weak servos, and joints that fall are no reason to let go of all."""
    model, title = _MOUNTED[what]
    monkeypatch.chdir(tmp_path)
    Path("robot.xml").write_text(model)
    assert run(["new", "mine", "--model", "robot.xml"]) == 0
    assert title in Path("mine.stc").read_text(encoding="utf-8").splitlines()[0]
    assert certify(stc.load("mine.stc").solve(), equations=False).passed


def test_what_stands_in_the_way_of_a_page_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An arm without motors that a weld holds at a place out of its reach."""
    monkeypatch.chdir(tmp_path)
    Path("held.xml").write_text(_WELDED.format(mocap="false"))
    assert run(["new", "mine", "--model", "held.xml"]) == 0
    assert "not solved: `equality grip` is 2 off its place in this pose" in capsys.readouterr().err


_WELDED = """<mujoco><worldbody><body name="hand" mocap="{mocap}" pos="2 0 1"/><body name="arm" pos="0 0 1"><joint
    name="a" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .5 0 0" size=".03"/></body></worldbody>
    <equality><weld name="grip" body1="hand" body2="arm" relpose="0 0 0 1 0 0 0"/></equality></mujoco>"""


@pytest.mark.nightly
def test_a_mocap_body_begins_where_what_is_welded_to_it_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """MuJoCo holds the hand of a redundant arm, drawn outside of a joint's range, where the motion begins."""
    monkeypatch.chdir(tmp_path)
    Path("held.xml").write_text(_WELDED.format(mocap="true"))
    assert run(["show", "held.xml"]) == 0
    assert "equality.grip welds body.hand and body.arm to each other" in capsys.readouterr().out
    joints = "".join(
        f'<body name="b{k}" pos="0 0 .2"><joint name="j{k}" axis="{axis}" damping=".5" range="{ends}"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 .2" size=".03"/>'
        for k, (axis, ends) in enumerate(
            [("0 0 1", "-170 170"), ("0 1 0", "30 170"), *[("0 0 1", "-170 170"), ("0 1 0", "-170 170")] * 3]
        )
    )
    Path("arm.xml").write_text(
        f"""<mujoco><worldbody><body name="tracker" mocap="true" pos=".5 0 .5" euler="40 0 0"/>{joints}{"</body>" * 8}
        </worldbody><equality><weld body1="tracker" body2="b7"/></equality></mujoco>"""
    )
    for model in ("held", "arm"):
        assert run(["new", model, "--model", f"{model}.xml"]) == 0
        text = Path(f"{model}.stc").read_text(encoding="utf-8")
        assert f'model: "{model}.xml" with mocap;' in text
        assert certify(stc.load(f"{model}.stc").solve(), equations=False).passed
    loose = text.replace("with mocap", "with release, motors")
    assert not any(name.startswith("equality") for name in stc.load(loose).problem().variables)
    Path("loose.stc").write_text(loose, encoding="utf-8")
    run(["run", "loose.stc"])
    assert "leaves out what the model welds or connects to mocap bodies" in capsys.readouterr().out


def test_a_page_that_exists_is_not_written_over_nor_tried(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.stc").write_text("mine")
    assert run(["new", "mine", "--model", "no_such_robot.xml"]) == 2
    assert "`mine.stc` exists already; nothing was written" in capsys.readouterr().err
    assert Path("mine.stc").read_text() == "mine"
