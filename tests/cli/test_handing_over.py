"""Commands that hand motions to other programs, and that take recorded ones."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from stc.cli.main import run


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("saved") / "poses.npz"
    assert run(["solve", "luxo_poses", "-o", str(file)]) == 0
    return file


def test_the_suffix_says_what_is_exported(
    saved: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, begins in (("a.yaml", "# luxo_poses"), ("a.csv", "time,a1"), ("sub/a.yml", "# luxo_poses")):
        assert run(["export", str(saved), "-o", name]) == 0
        assert Path(name).read_text().startswith(begins)
    assert run(["export", str(saved), "--format", "joints", "--json"]) == 0
    told = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert told["file"] == "luxo_poses_joints.csv"
    assert run(["export", str(saved)]) == 2
    assert "says what to write" in capsys.readouterr().err
    assert run(["export", str(saved), "-o", "a.bvh"]) == 2
    assert "no format has this suffix" in capsys.readouterr().err


def test_mistakes_about_recorded_motions_and_sweeps_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.csv").write_text("time,cart\n0,1\n")
    for arguments, message in (
        (["explain-motion", "a.csv", "--model", "nothing.xml"], "there is no model `nothing.xml`"),
        (["explain-motion", "b.csv", "--model", "cart_pole.xml"], "there is no file `b.csv`"),
        (["explain-motion", "a.csv", "--model", "cart_pole.xml"], "has no column for `joint.pole`"),
        (["explain-motion", "a.csv", "--model", "cart_pole.xml", "-o", "a.csv"], "a spec is saved as *.stc"),
        (["dataset", "."], "is no folder of a sweep"),
    ):
        assert run(arguments) == 2, arguments
        assert message in capsys.readouterr().err, arguments
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


@pytest.mark.slow
def test_a_recorded_motion_becomes_a_spec(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["solve", "cart_pole_swing_up", "-o", "swing.npz"]) == 0
    assert run(["export", "swing.npz", "--format", "joints", "--rate", "90", "-o", "swing.csv"]) == 0
    assert run(["explain-motion", "swing.csv", "--model", "cart_pole.xml", "-o", "found/again.stc"]) == 0
    shown = capsys.readouterr().out
    assert re.search("objective +effort 100 %", shown)
    assert "passed: " in shown
    assert run(["solve", "found/again.stc", "--set", "D=0.5", "-o", "shorter.npz"]) == 0
    with np.load("shorter.npz") as found:
        assert found["unknowns/joint.cart"][-1] == pytest.approx(0.5, abs=1e-8)
