"""A command that a certificate advises can be given as it stands."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from planted_faults import text_of

import stc
from stc.certification import certify
from stc.cli.main import run


def advised(solution: stc.Solution) -> str:
    """The command that adds frames, as it is written in the advice."""
    (step,) = certify(solution).next_steps
    found = re.search(r"`(stc run .*?)`", step)
    assert found is not None, step
    return found[1]


@pytest.mark.parametrize("method", ["hermite-simpson", "trapezoidal"])
def test_the_command_has_what_was_given(method: str) -> None:
    command = advised(stc.load("arm_reach").solve(n=8, method=method))
    other = f" --method {method}" if method != "hermite-simpson" else ""
    assert command == f"stc run arm_reach --set n=8{other} --until-passed"


def test_the_spec_is_named_and_the_command_works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my specs").mkdir()
    Path("my specs/reach.stc").write_text(text_of("arm_reach").replace("n = 60", "n = 16"))
    command = advised(stc.load("my specs/reach.stc").solve())
    assert command == "stc run 'my specs/reach.stc' --until-passed"
    assert run(shlex.split(command)[1:]) == 0


def test_a_text_without_a_file_has_no_command() -> None:
    (step,) = certify(stc.load(text_of("arm_reach")).solve(n=16)).next_steps
    assert "stc run" not in step
    assert "`solve_until_passed(model)`" in step
