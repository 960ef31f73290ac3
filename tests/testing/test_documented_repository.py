"""The example repository of docs/testing.md, made and tested as it stands there."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "testing.md"


def files() -> dict[str, str]:
    """The blocks that a file's name stands before."""
    found = re.findall(r"^`([\w./]+)`:\n\n```\w*\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    return dict(found)


def build(folder: Path, old: str = "", new: str = "") -> None:
    """Write the files, with one text in the spec changed."""
    assert old in files()["pendulum.stc"]
    for name, text in files().items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text.replace(old, new) if old else text)


def run(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *options]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.nightly
@pytest.mark.slow
def test_its_tests_pass_and_leave_certificates(tmp_path: Path) -> None:
    build(tmp_path)
    done = run(tmp_path, "--stc-report", "certificates")
    assert "4 passed" in done.stdout, done.stdout + done.stderr
    pages = sorted(path.name for path in (tmp_path / "certificates").iterdir())
    assert pages == ["test_motion_1.62_-pendulum.html", "test_motion_9.81_-pendulum.html"]


@pytest.mark.slow
def test_its_failure_reads_as_the_page_shows(tmp_path: Path) -> None:
    build(tmp_path, "u - m*g*l*sin(a)", "u - 0.9*m*g*l*sin(a)")
    done = run(tmp_path, "-k", "equations")
    (shown,) = re.findall(r"^    E   (AssertionError.*)$", PAGE.read_text(), re.MULTILINE)
    found = re.findall(r"^E +(AssertionError.*)$", done.stdout, re.MULTILINE)
    # The states are drawn at random from a fixed seed: the figures are of one version.
    assert [re.sub(r"[\d.-]+", "#", line) for line in found] == [re.sub(r"[\d.-]+", "#", shown)], done.stdout
