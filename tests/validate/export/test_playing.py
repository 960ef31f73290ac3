"""Keyframes and controls: a plain MuJoCo program plays them, and the model carries what the spec set."""

from __future__ import annotations

import errno
import re
import shutil
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

import stc
from stc.solution import Solution
from stc.validate.export import export
from stc.validate.model import ModelError
from stc.validate.setup import prepare

PAGE = Path(__file__).parents[3] / "docs" / "export.md"


@pytest.fixture(scope="module")
def lamp() -> Solution:
    return stc.load("luxo_poses").solve()


def examples() -> str:
    """The programs of the page that play a motion, one after the other."""
    text = PAGE.read_text().partition("## Animation")[0]
    return "\n".join(re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL))


def drifts(printed: str) -> list[float]:
    return [float(value) for value in re.findall(r": (\S+) rad", printed)]


def test_the_example_plays_the_lamp(
    lamp: Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    export(lamp, "keyframes")
    export(lamp, "controls")
    exec(examples(), {})
    alone, tracked = drifts(capsys.readouterr().out)
    assert alone < 2e-5
    assert tracked < 5e-6


@pytest.mark.nightly
def test_feedback_holds_what_is_unstable(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    solution = stc.load("cart_pole_swing_up").solve()
    export(solution, "keyframes", "luxo_poses_keyframes.xml")
    export(solution, "controls", "luxo_poses_controls.npz")
    exec(examples(), {})
    alone, tracked = drifts(capsys.readouterr().out)
    assert tracked < 5e-5 < alone


def test_the_folder_can_be_moved_and_has_a_keyframe_per_frame(lamp: Solution, tmp_path: Path) -> None:
    export(lamp, "keyframes", tmp_path / "a" / "lamp.xml")
    shutil.move(tmp_path / "a", tmp_path / "b")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "b" / "lamp.xml"))
    setup = prepare(lamp)
    assert model.nkey == lamp.n + 1
    assert np.array_equal(model.key_time, lamp.time)
    assert np.array_equal(
        model.key_qpos[:, setup.reference.positions].T, [lamp[v] for v in ("a1", "a2", "a3")]
    )
    assert np.array_equal(
        model.key_qvel[:, setup.reference.velocities].T, [lamp[f"a{k}'"] for k in (1, 2, 3)]
    )
    assert np.array_equal(model.key_ctrl[1:-1].T, [lamp[f"u{k}"][1:-1] for k in (1, 2, 3)])
    assert np.array_equal(model.mesh_vert, setup.compiled.mesh_vert)


@pytest.mark.parametrize("kept", [False, True])
def test_a_full_disk_leaves_nothing_behind(
    lamp: Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kept: bool
) -> None:
    target = tmp_path / "lamp.xml"
    if kept:
        export(lamp, "keyframes", target)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    write, room = Path.write_bytes, [1]

    def full(path: Path, data: bytes) -> int:
        if not room:
            write(path, data[:100])
            raise OSError(errno.ENOSPC, "No space left on device")
        room.pop()
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError) as caught:
        export(lamp, "keyframes", target)
    assert Path(caught.value.filename).parent == tmp_path / "lamp_assets"
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
    assert (tmp_path / "lamp_assets").exists() is kept


def test_meshes_of_one_name_from_two_folders_stay_two(tmp_path: Path) -> None:
    files = {"a": "thin/part.stl", "b": "other/part_2.stl", "c": "wide/part.stl"}
    for width, file in enumerate(files.values(), start=1):
        (tmp_path / file).parent.mkdir()
        trimesh.creation.box((0.1 * width, 0.1, 0.1)).export(tmp_path / file)
    assets = "".join(f'<mesh name="{name}" file="{file}"/>' for name, file in files.items())
    seen = "".join(
        f'<geom type="mesh" mesh="{name}" mass="0" contype="0" conaffinity="0"/>' for name in files
    )
    model = MODEL.replace('<include file="rest.xml"/>', f'<asset>{assets}</asset><include file="rest.xml"/>')
    solution = bob(tmp_path, model.replace("<geom name=", seen + "<geom name="))
    written = export(solution, "keyframes", tmp_path / "out.xml")
    wanted, found = prepare(solution).compiled, mujoco.MjModel.from_xml_path(str(written))
    assert np.array_equal(found.mesh_vert, wanted.mesh_vert)
    copies = {path.name for path in (tmp_path / "out_assets").iterdir()}
    assert copies == {"part.stl", "part_2.stl", "part_3.stl"}


MODEL = """<mujoco>
  <compiler angle="degree"/>
  <include file="rest.xml"/>
  <worldbody>
    <body name="bob" pos="0 0 1">
      <joint name="swing" type="hinge" axis="0 1 0" stiffness="1" springref="10" range="-90 90" limited="false"/>
      <geom name="ball" type="sphere" pos="0 0 -0.4" size="0.05" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>
"""
REST = """<mujoco>
  <actuator><motor name="swing" joint="swing" gear="3"/></actuator>
  <keyframe><key qpos="0.5"/></keyframe>
</mujoco>
"""
SPEC = """
constants: n = 4, T = 0.2, h = T/n, m = 0.7123456789012345, k = 0.3;
variables: a, u;
constraints:
  [0, n]: a'' = u;
  [0]: a; a';
  [n]: a = 0.1; a';
objective: [0, n]: integral(u^2);
method: hermite-simpson;
replay:
  model = "bob.xml";
  joint swing = a;
  actuator swing = u;
  set option.gravity.x = m;
  set option.wind.y = k;
  set option.solref.time = k;
  set body.bob.mass = m;
  set body.bob.com.z = -k;
  set body.bob.inertia.y = m/1300;
  set joint.swing.damping = k/7;
  set joint.swing.armature = k/7;
  set joint.swing.frictionloss = k/70;
  set joint.swing.stiffness = k/7;
  set joint.swing.springref = k;
  set joint.swing.lower = -k;
  set joint.swing.upper = k;
  set geom.ball.friction.slide = m;
  set actuator.swing.gear = 2*m;
"""


def bob(tmp_path: Path, model: str = MODEL) -> Solution:
    (tmp_path / "bob.xml").write_text(model)
    (tmp_path / "rest.xml").write_text(REST)
    (tmp_path / "bob.stc").write_text(SPEC)
    return stc.load(tmp_path / "bob.stc").solve()


@pytest.mark.parametrize("limited", ["false", "true"])
@pytest.mark.parametrize("angle", ["degree", "radian"])
def test_everything_that_a_spec_sets_is_in_the_model(tmp_path: Path, limited: str, angle: str) -> None:
    model = MODEL.replace('limited="false"', f'limited="{limited}"').replace("degree", angle)
    solution = bob(tmp_path, model)
    written = export(solution, "keyframes", tmp_path / "out.xml")
    wanted, found = prepare(solution).compiled, mujoco.MjModel.from_xml_path(str(written))
    for name in ("body_mass", "body_ipos", "body_inertia", "dof_damping", "dof_armature", "dof_frictionloss"):
        assert np.allclose(getattr(found, name), getattr(wanted, name), rtol=1e-15, atol=0), name
    for name in ("jnt_stiffness", "qpos_spring", "jnt_range", "geom_friction", "actuator_gear"):
        assert np.allclose(getattr(found, name), getattr(wanted, name), rtol=1e-15, atol=0), name
    assert found.opt.gravity[0] == solution.constants["m"]
    assert found.opt.wind[1] == solution.constants["k"]
    assert np.array_equal(found.geom_solref, wanted.geom_solref)
    assert found.geom_solref[0, 0] == solution.constants["k"]
    assert found.nkey == 5


def test_a_model_that_cannot_carry_it_is_refused(tmp_path: Path) -> None:
    solution = bob(tmp_path)
    text = ET.tostring(
        ET.fromstring(
            MODEL.replace("<worldbody>", '<worldbody><replicate count="1">').replace(
                "</worldbody>", "</replicate></worldbody>"
            )
        ),
        encoding="unicode",
    )
    # A replicated body has another name in the model than in the text.
    (tmp_path / "bob.xml").write_text(text)
    with pytest.raises(ModelError):
        export(solution, "keyframes", tmp_path / "out.xml")


def test_outer_forces_come_as_generalised_ones(tmp_path: Path) -> None:
    spec = SPEC.replace("  set option", "  apply body.bob.fx = u;\n  set option", 1)
    bob(tmp_path)
    (tmp_path / "bob.stc").write_text(spec)
    solution = stc.load(tmp_path / "bob.stc").solve()
    with np.load(export(solution, "controls", tmp_path / "c.npz", time_step=0.025)) as motion:
        assert motion["timestep"] == pytest.approx(0.025)
        assert motion["ctrl"].shape == (8, 1)
        # The force acts at the joint itself.
        assert np.allclose(motion["qfrc_applied"], 0.0)
        middles = 0.5 * (motion["time"][1:] + motion["time"][:-1])
        assert np.allclose(motion["ctrl"][:, 0], solution.at(middles)["u"])
        assert np.allclose(motion["qpos"][:, 0], solution.at(motion["time"])["a"])
        assert np.allclose(motion["qvel"][:, 0], solution.at(motion["time"])["a'"])
