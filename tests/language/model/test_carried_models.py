"""Solutions of specs with a model are read again without the model's file, and are trusted no more for it."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

import stc
from stc.errors import SolutionError
from stc.recorded_files import RecordedFile
from stc.solution import Solution
from stc.validate import validate

from .bodies import load

ARM = """<mujoco><compiler angle="radian"/><worldbody><body name="arm"><joint name="a" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0 0 -.5" size=".03" mass="1"/></body></worldbody>
  <actuator><motor name="a" joint="a"/></actuator></mujoco>"""
SPEC = """constants: n = 10, T = 1, h = T/n;
constraints: [0]: joint.a = 0; rest; [n]: joint.a = 1; rest;
objective: [0, n]: integral(effort);"""


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    """A solution that was saved beside its model."""
    solution = load(tmp_path, ARM, SPEC).solve()
    solution.save(tmp_path / "motion.npz")
    return tmp_path / "motion.npz"


def test_without_the_model_the_motion_is_the_same(saved: Path) -> None:
    before = stc.read(saved)
    judged = validate(before)
    (saved.parent / "robot.xml").unlink()
    found = stc.read(saved)
    for key, channel in before.trajectories.items():
        assert np.array_equal(found.trajectories[key].before, channel.before)
    report = validate(found)
    assert report.findings == judged.findings == []
    assert [(m.name, m.verdict) for m in report.metrics] == [(m.name, m.verdict) for m in judged.metrics]
    assert any("the one stored in the solution is replayed" in note for note in report.notes)


def test_a_motion_goes_on_from_a_carried_model(saved: Path, tmp_path: Path) -> None:
    """A second solve from the file carries the model, too."""
    (saved.parent / "robot.xml").unlink()
    again = stc.read(saved).resolve(T=1.2)
    assert again.status == "optimal"
    again.save(tmp_path / "again.csv")
    assert stc.read(tmp_path / "again.csv")["joint.a"][-1] == pytest.approx(1.0)


def test_a_changed_model_does_not_change_the_motion_but_the_verdict(saved: Path) -> None:
    before = stc.read(saved)
    (saved.parent / "robot.xml").write_text(ARM.replace('mass="1"', 'mass="2"'), encoding="utf-8")
    found = stc.read(saved)
    assert np.array_equal(found["joint.a"], before["joint.a"])
    report = validate(found)
    assert not report.passed
    assert any("has changed since this motion was solved" in fault for fault in report.faults)


def test_a_model_that_is_edited_between_two_solves_is_judged_as_it_is(tmp_path: Path) -> None:
    """In one process, as in a notebook: the text of the spec is the same, its model is not."""
    for mass in ("1", "2"):
        solution = load(tmp_path, ARM.replace('mass="1"', f'mass="{mass}"'), SPEC).solve()
        report = validate(solution)
        assert report.findings == report.faults == [] and report.claims.optimality < 1e-6


def test_a_model_that_is_edited_after_the_solve_is_not_taken_for_the_one_that_was_solved(
    tmp_path: Path,
) -> None:
    """Neither by the verdict on the solution at hand, nor by the file that is written after the edit."""
    spec = load(tmp_path, ARM, SPEC)
    solution = spec.solve()
    (tmp_path / "robot.xml").write_text(ARM.replace('mass="1"', 'mass="2"'), encoding="utf-8")
    solution.save(tmp_path / "motion.npz")
    for motion in (solution, stc.read(tmp_path / "motion.npz"), spec.solve(T=1.2)):
        report = validate(motion)
        assert any("has changed since this motion was solved" in fault for fault in report.faults)
        assert report.findings == report.faults and len(report.faults) == 1
    (tmp_path / "robot.xml").write_text(ARM, encoding="utf-8")
    assert validate(stc.read(tmp_path / "motion.npz")).faults == []


def test_another_model_with_other_joints_is_told_of(saved: Path) -> None:
    (saved.parent / "robot.xml").write_text(ARM.replace('name="a" axis', 'name="b" axis'), encoding="utf-8")
    assert stc.read(saved)["joint.a"][-1] == pytest.approx(1.0)


def test_a_forged_model_convinces_nobody(saved: Path) -> None:
    """A motion of a lighter arm, in a file that carries the lighter arm, is held against the arm that is there."""
    light = ARM.replace('mass="1"', 'mass="0.5"')
    folder = saved.parent / "light"
    folder.mkdir()
    forged: Solution = load(folder, light, SPEC).solve()
    forged.directory = str(saved.parent)
    content = light.encode()
    forged.files = [RecordedFile("model", "robot.xml", sha256(content).hexdigest(), len(content), content)]
    forged.save(saved.parent / "forged.npz")
    report = validate(stc.read(saved.parent / "forged.npz"))
    assert not report.passed
    assert any("has changed" in fault for fault in report.faults)


def test_a_part_that_is_not_carried_is_named(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(400, 3))
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()] + ["f 1 2 3"]
    (tmp_path / "shell.obj").write_text("\n".join(lines), encoding="utf-8")
    shell = ARM.replace(
        "<worldbody>", '<asset><mesh name="shell" file="shell.obj" inertia="convex"/></asset><worldbody>'
    ).replace("</body>", '<geom type="mesh" mesh="shell" mass="0.1" contype="0" conaffinity="0"/></body>')
    load(tmp_path, shell, SPEC).solve().save(tmp_path / "motion.npz")
    assert stc.read(tmp_path / "motion.npz").status == "optimal"
    (tmp_path / "shell.obj").unlink()
    (tmp_path / "robot.xml").unlink()
    with pytest.raises(SolutionError, match=r"the file contains all but shell\.obj"):
        stc.read(tmp_path / "motion.npz")


def test_what_a_spec_leaves_out_is_told_in_the_verdict(tmp_path: Path) -> None:
    wet = ARM.replace("<worldbody>", '<option density="1000"/><worldbody>')
    (tmp_path / "robot.xml").write_text(wet, encoding="utf-8")
    (tmp_path / "motion.stc").write_text(f'model: "robot.xml" without fluid;\n{SPEC}', encoding="utf-8")
    report = validate(stc.load(tmp_path / "motion.stc").solve(), tracked=False)
    assert any("leaves out parts of its model that MuJoCo simulates: fluid" in note for note in report.notes)
    assert not report.passed


def test_meshes_of_an_included_file_are_carried_from_the_folder_that_the_model_names(tmp_path: Path) -> None:
    """An `<include>` is part of one text, in which one line says where all meshes lie."""
    parts = tmp_path / "parts"
    (tmp_path / "shapes").mkdir()
    parts.mkdir()
    (tmp_path / "shapes" / "rod.obj").write_text(
        "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .5\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    (parts / "meshes.xml").write_text('<mujocoinclude><mesh name="rod" file="rod.obj"/></mujocoinclude>')
    model = ARM.replace('"radian"', '"radian" meshdir="shapes"')
    model = model.replace("<worldbody>", '<asset><include file="parts/meshes.xml"/></asset><worldbody>')
    model = model.replace("</body>", '<geom type="mesh" mesh="rod"/></body>')
    load(tmp_path, model, SPEC).solve().save(tmp_path / "motion.npz")
    before = stc.read(tmp_path / "motion.npz")
    for path in (tmp_path / "shapes" / "rod.obj", parts / "meshes.xml", tmp_path / "robot.xml"):
        path.unlink()
    assert np.array_equal(stc.read(tmp_path / "motion.npz")["joint.a"], before["joint.a"])
