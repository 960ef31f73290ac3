"""A report that cannot be written costs the report and nothing else."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import stc
from stc.certification import certify

resource = pytest.importorskip("resource")

#: The command line of a process whose files may hold so many bytes: as on a full disk, but small ones can be written.
SMALL_FILES = """
import resource, sys
most = int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
from stc.cli.main import run
sys.exit(run(sys.argv[2:]))
"""


@pytest.mark.daily_every(2)
@pytest.mark.parametrize(("command", "as_json"), [("validate", False), ("run", True)])
def test_what_was_found_is_shown_where_the_report_cannot_be_written(
    command: str, as_json: bool, tmp_path: Path
) -> None:
    solution, file = stc.load("particle_waypoints", n=20, T=0.5).solve(), tmp_path / "particle_waypoints.npz"
    solution.save(file)
    # The solution can be written, a page without pictures cannot; so it does not matter whether there is OpenGL.
    page = certify(solution).write(tmp_path / "whole.html", pictures=False)
    most = (file.stat().st_size + page.stat().st_size) // 2
    target = (
        ["particle_waypoints", "--set", "n=20", "--set", "T=0.5"]
        if command == "run"
        else ["particle_waypoints.npz"]
    )
    words = [command, *target, "--report", "a.html", *(["--json"] if as_json else [])]
    done = subprocess.run(
        [sys.executable, "-c", SMALL_FILES, str(most), *words],
        cwd=tmp_path,
        env={**os.environ, "MUJOCO_GL": "off"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 1
    told = "a.html: File too large: the report is not written"
    if as_json:
        record = json.loads(done.stdout)
        assert (record["status"], record["report"]) == ("optimal", None)
        assert record["message"].endswith(told)
        assert record["validation"]["passed"]
        assert record["objective"] is not None
    else:
        assert done.stdout.splitlines()[-1].startswith("passed: ")
        assert "open-loop" in done.stdout
        assert done.stderr.splitlines()[-1] == f"note: {told}"
    assert [path.name for path in tmp_path.iterdir() if "a.html" in path.name] == []
