"""A report that cannot be written costs the report and nothing else."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import stc

resource = pytest.importorskip("resource")

#: The command line of a process whose files may hold so many bytes: as on a full disk, but small ones can be written.
SMALL_FILES = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
from stc.cli import run
sys.exit(run(sys.argv[1:]))
"""


@pytest.mark.parametrize("command", ["validate", "run"])
def test_what_was_found_is_shown_where_the_report_cannot_be_written(command: str, tmp_path: Path) -> None:
    stc.load("particle_waypoints").solve().save(tmp_path / "particle_waypoints.npz")
    target = "particle_waypoints" if command == "run" else "particle_waypoints.npz"

    def call(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-c", SMALL_FILES, command, target, "--report", "a.html", *words],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=120,
        )

    told = "a.html: File too large: the report is not written"
    done = call()
    assert done.returncode == 1
    assert done.stdout.splitlines()[-1].startswith("passed: ")
    assert "open-loop" in done.stdout
    assert done.stderr.splitlines()[-1] == f"note: {told}"

    done = call("--json")
    record = json.loads(done.stdout)
    assert done.returncode == 1
    assert (record["status"], record["report"]) == ("optimal", None)
    assert record["message"].endswith(told)
    assert record["validation"]["passed"]
    assert record["objective"] is not None
    assert [path.name for path in tmp_path.iterdir() if "a.html" in path.name] == []
