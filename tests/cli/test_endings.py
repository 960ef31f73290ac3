"""Signals that end programs: a solve stops as for Ctrl-C and saves what it has, with an exit status that tells."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import stc
from stc.cli.live import Watch

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")


@pytest.fixture(autouse=True)
def _hangups_end_programs() -> Iterator[None]:
    """Whatever runs the tests may ignore them, as nohup does, and what is started inherits that."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


#: The command line with solves that take their time, and tell of each that has begun.
SLOW = """
import sys, time
from stc.cli.main import run
from stc.pipeline import Model

solve = Model.solve

def slow(self, *, callback, **options):
    print("begins", file=sys.stderr, flush=True)
    def wait(iterate):
        time.sleep(float(sys.argv[1]))
        return callback(iterate)
    return solve(self, callback=wait, **options)

Model.solve = slow
sys.exit(run(sys.argv[2:]))
"""

SPEC = """\
constants: n = 0;
variables: x, y;
guess: x = -1.2; y = 1;
objective: 100*(y - x^2)^2 + (1 - x)^2;
"""


def start(folder: Path, *words: str, seconds: float = 0.1) -> subprocess.Popen[str]:
    """Starts a command whose iterations take so long."""
    (folder / "banana.stc").write_text(SPEC)
    return subprocess.Popen(
        [sys.executable, "-c", SLOW, str(seconds), *words],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def begun(running: subprocess.Popen[str], count: int) -> None:
    """Waits until so many solves have begun."""
    assert running.stderr is not None
    for _ in range(count):
        assert running.stderr.readline() == "begins\n"


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_a_search_that_is_ended_saves_the_best_so_far(name: str, tmp_path: Path) -> None:
    number = getattr(signal, name)
    running = start(tmp_path, "solve", "banana.stc", "--starts", "50", "--json")
    begun(running, 3)  # two are over
    time.sleep(0.15)
    running.send_signal(number)
    out, err = running.communicate(timeout=60)
    assert running.returncode == 128 + number
    record = json.loads(out)
    assert (record["status"], record["file"]) == ("optimal", "banana.npz")
    assert "interrupted; 3 of 50 starts were made" in record["message"]
    assert stc.read(tmp_path / "banana.npz").status == "optimal"
    assert "Traceback" not in err


def test_a_solve_that_is_ended_saves_its_best_iterate(tmp_path: Path) -> None:
    running = start(tmp_path, "solve", "banana.stc")
    begun(running, 1)
    time.sleep(0.3)
    running.send_signal(signal.SIGTERM)
    out, _ = running.communicate(timeout=60)
    assert running.returncode == 143
    assert "interrupted" in out
    assert stc.read(tmp_path / "banana.npz").status == "interrupted"


def test_a_second_signal_ends_at_once(tmp_path: Path) -> None:
    running = start(tmp_path, "solve", "banana.stc", "--json", seconds=1.0)
    begun(running, 1)
    for _ in range(2):
        time.sleep(0.4)  # within the first iteration
        running.send_signal(signal.SIGTERM)
    out, err = running.communicate(timeout=60)
    assert running.returncode == 143
    assert json.loads(out)["status"] == "interrupted"
    assert "Traceback" not in err
    assert not list(tmp_path.glob(".*"))  # no half a file


def test_handlers_are_there_while_something_is_to_be_saved_and_no_longer() -> None:
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.getsignal(number) for number in numbers]
    with Watch("a", saves=True) as watch:
        assert all(signal.getsignal(number) == watch._on_signal for number in numbers)
    with Watch("a"):
        assert [signal.getsignal(number) for number in numbers[1:]] == before[1:]
    assert [signal.getsignal(number) for number in numbers] == before


def test_what_nohup_ignores_is_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with Watch("a", saves=True):
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)
