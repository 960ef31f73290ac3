"""`stc show robot.xml` and `stc new --model robot.xml`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import stc
from stc.certification import certify
from stc.cli.main import run


def test_a_model_is_listed_with_what_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "wet.xml"
    model.write_text(
        """<mujoco><option density="1000"/><worldbody><body name="fish"><freejoint name="left/root"/>
        <geom name="belly" size=".1"/></body></worldbody></mujoco>""",
        encoding="utf-8",
    )
    assert run(["show", str(model)]) == 0
    shown = capsys.readouterr().out
    assert 'joint."left/root" (free)' in shown
    assert "geom.belly (sphere)" in shown
    assert "cannot be stated:" in shown
    assert "wet.xml:1" in shown
    assert "without fluid" in shown


@pytest.mark.parametrize("model", ["quadruped.xml", "arm.xml"])
def test_a_starter_spec_of_a_model_states_a_problem(
    tmp_path: Path, model: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["new", "mine", "--model", model]) == 0
    problem = stc.load("mine.stc").problem()
    assert problem.of_model
    assert not problem.warnings


def test_a_starter_spec_solves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["new", "mine", "--model", "arm.xml"]) == 0
    assert stc.load("mine.stc").solve().status == "optimal"


_LEG = """<mujoco><worldbody>{floor}<body name="hip" pos="0 0 1">
  <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
  <joint name="pitch" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 .4" size=".05"/>
  <body name="shin"><joint name="knee" axis="0 1 0" limited="true" range="20 120"/>
    <geom type="capsule" fromto="0 0 0 0 0 -.4" size=".04"/>
    <body name="foot" pos="0 0 -.4"><joint name="ankle" axis="0 1 0" range="-90 90"/>
      <geom type="capsule" fromto="-.12 0 0 .15 0 0" size=".04"/></body></body></body></worldbody>
  <actuator><motor joint="knee"/><motor joint="ankle"/></actuator></mujoco>"""


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


@pytest.mark.parametrize("name", ["hopper", "ant", "half_cheetah"])
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
    driven = text.replace("# variables: u;", "variables: u;").replace(
        "  [n]: begin;", '  [n]: joint."left elbow" = 1;'
    )
    Path("mine.stc").write_text(driven, encoding="utf-8")
    solution = stc.load("mine.stc").solve()
    assert solution.status == "optimal"
    assert np.abs(solution["u"]).max() > 1.0


def test_a_missing_model_is_a_mistake(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["show", str(tmp_path / "none.xml")]) == 2
    assert "there is no model" in capsys.readouterr().err


_ARM = """<robot name="arm"><link name="base"/><joint name="elbow" type="continuous"><parent link="base"/>
  <child link="arm"/><axis xyz="0 1 0"/></joint><link name="arm"><inertial><origin xyz="0 0 -.5"/><mass value="1"/>
  <inertia ixx=".1" iyy=".1" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial>{more}</link></robot>"""


def test_what_a_urdf_does_not_state_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its base and motors in the listing; of meshes in packages, which MuJoCo does not find, the line to write."""
    (tmp_path / "arm.urdf").write_text(_ARM.format(more=""), encoding="utf-8")
    assert run(["show", str(tmp_path / "arm.urdf")]) == 0
    assert "fixed to the world" in capsys.readouterr().out
    mesh = '<collision><geometry><mesh filename="package://arm/meshes/arm.stl"/></geometry></collision>'
    (tmp_path / "arm.urdf").write_text(_ARM.format(more=mesh), encoding="utf-8")
    assert run(["show", str(tmp_path / "arm.urdf")]) == 2
    assert 'strippath="true"' in capsys.readouterr().err
