"""Shells complete commands, options and bundled specs."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

#: The command that the completion of this environment is for.
STC = Path(sys.executable).with_name("stc")

needs_command = pytest.mark.skipif(not STC.exists(), reason="the command is not installed beside Python")


def answer(words: str, **environment: str) -> str:
    done = subprocess.run(
        [STC],
        env={**os.environ, **environment, "COMP_WORDS": words},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    return done.stdout


@needs_command
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("stc sw", ["sweep"]),
        ("stc v", ["validate", "view"]),
        ("stc solve --max-it", ["--max-iterations"]),
        ("stc run luxo_mo", ["luxo_moon"]),
        ("stc validate nothing_like_it", []),
    ],
)
def test_words_are_completed(words: str, expected: list[str]) -> None:
    found = answer(words, _STC_COMPLETE="complete_bash", COMP_CWORD=str(words.count(" ")))
    assert sorted(found.split()) == expected


@needs_command
def test_the_script_for_bash_completes(tmp_path: Path) -> None:
    """What ``stc --install-completion`` installs, in a real shell."""
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("there is no bash")
    script = tmp_path / "completion.sh"
    script.write_text(answer("", _STC_COMPLETE="source_bash"))
    asks = "; ".join(
        [
            f"source '{script}'",
            "COMP_WORDS=(stc sched)",
            "COMP_CWORD=1",
            "$(complete -p stc | sed 's/.*-F \\([^ ]*\\).*/\\1/') stc",
            'echo "${COMPREPLY[@]}"',
        ]
    )
    path = f"{STC.parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        [bash, "--norc", "-c", asks],
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["schedule"]
