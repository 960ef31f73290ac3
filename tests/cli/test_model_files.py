"""`stc show robot.xml` and `stc new --model robot.xml`."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc
from stc.cli import run


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


def test_a_missing_model_is_a_mistake(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["show", str(tmp_path / "none.xml")]) == 2
    assert "there is no model" in capsys.readouterr().err
