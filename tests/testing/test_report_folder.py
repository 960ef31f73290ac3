"""``pytest --stc-report``: a folder that cannot be written to is told of at once."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.parametrize(("folder", "why"), [("taken", "that is a file"), ("taken/below", "Not a directory")])
def test_a_folder_that_cannot_be_made_ends_the_session_with_one_message(
    folder: str, why: str, tmp_path: Path
) -> None:
    (tmp_path / "taken").write_text("mine")
    (tmp_path / "test_a.py").write_text("def test_a():\n    pass\n")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--stc-report", folder],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 4  # pytest's own for wrong usage
    assert done.stderr.strip() == f"ERROR: --stc-report {folder}: {why}: it takes a folder"
    assert "Traceback" not in done.stdout
    assert (tmp_path / "taken").read_text() == "mine"
