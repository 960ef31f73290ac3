"""The line that tells how far something long has got: on a terminal only."""

from __future__ import annotations

import os
import pty
import re
import subprocess
import sys
from pathlib import Path

import pytest

import stc
from stc.validate import validate
from stc.validate.progress import listening, steps

WORDS = [
    (["compare", "particle_waypoints", "--optimizers", "sqp,witkin-kass"], b"witkin-kass (2 of 2)"),
    (["validate", "particle_waypoints", "--set", "n=1000"], b"inverse dynamics"),
]


@pytest.mark.needs("terminal")
@pytest.mark.parametrize(
    ("words", "told"), WORDS, ids=lambda value: value[0] if isinstance(value, list) else ""
)
def test_what_is_done_is_told_on_a_terminal(words: list[str], told: bytes, tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    environment = {**os.environ, "NO_COLOR": "1", "TERM": "xterm", "COLUMNS": "200"}
    command = [sys.executable, "-m", "stc", *words]
    running = subprocess.Popen(
        command, cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL, stderr=theirs
    )
    os.close(theirs)
    seen = b""
    try:
        while chunk := os.read(ours, 4096):
            seen += chunk
    except OSError:  # Linux says so where the other end is closed
        pass
    os.close(ours)
    assert running.wait(timeout=60) == 0
    assert told in re.sub(rb"\x1b\[[0-9;?]*[A-Za-z]", b"", seen)  # without what positions and colours it


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("words", [words for words, _ in WORDS], ids=lambda words: words[0])
def test_nothing_is_told_where_nobody_watches(words: list[str], tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "stc", *words], cwd=tmp_path, check=True, capture_output=True, timeout=120
    )
    assert done.stderr == b""


def test_a_validation_tells_of_all_that_takes_long_and_finds_the_same() -> None:
    solution = stc.load("arm_reach").solve()
    told: list[tuple[str, int, int]] = []
    quiet = validate(solution)
    with listening(lambda *step: told.append(step)):
        watched = validate(solution)
    assert [m.to_dict() for m in watched.metrics] == [m.to_dict() for m in quiet.metrics]
    assert {what for what, _, _ in told} == {
        "replay",
        "linearisation",
        "replay with feedback",
        "inverse dynamics",
        "energy balance",
    }
    assert all(0 <= done < count == solution.n for _, done, count in told)
    told.clear()
    assert list(steps("nothing", 3)) == [0, 1, 2]
    assert not told
