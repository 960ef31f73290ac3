"""``stc compare`` tells of each optimizer as it is done, stops where it is stopped, and leaves out what never ends."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import stc
from stc.cli.main import run
from stc.studies.compare import Run, compare

SPEC = """constants: n = 0;
variables: x, y;
constraints: x + 2*y = 5;
objective: x^2 + y^2;
"""

#: More unknowns than dense steps are good for, with a solution that is found at once.
LARGE = "constants: n = 600; variables: x; constraints: [1, n]: x - x[i-1] <= 5; objective: (x - 1)^2;"

#: The command line with an optimizer that takes its time.
SLOW = """
import sys, time
import stc.studies.compare as study
from stc.cli.main import run

solve = study.solve

def slow(transcription, constants, options, start, callback, name):
    def wait(iterate):
        print("iterates", file=sys.stderr, flush=True)
        time.sleep(1.0)
        return callback(iterate)
    return solve(transcription, constants, options, start, callback if name == "sqp" else wait, name)

study.solve = slow
sys.exit(run(sys.argv[1:]))
"""


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("point.stc").write_text(SPEC)
    Path("large.stc").write_text(LARGE)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("again", [False, True])
def test_rows_are_there_at_once_and_stay_when_it_is_interrupted(again: bool) -> None:
    words = ["compare", "point.stc", "--optimizers", "sqp,nlopt:slsqp,witkin-kass"]
    running = subprocess.Popen(
        [sys.executable, "-c", SLOW, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert running.stdout is not None
    assert running.stderr is not None
    lines = [running.stdout.readline() for _ in range(3)]  # while the second one is busy
    assert [line.split()[:2] for line in lines] == [["point"], ["optimizer", "status"], ["sqp", "optimal"]]
    assert running.stderr.readline() == "iterates\n"
    running.send_signal(signal.SIGINT)
    if again:
        import time

        time.sleep(0.3)
        running.send_signal(signal.SIGINT)
    out, err = running.communicate(timeout=60)
    assert running.returncode == 1
    assert "Traceback" not in err
    assert "witkin-kass" not in out
    assert "of 3 optimizers were run" in err.splitlines()[-1]


def test_an_interrupted_comparison_is_json_all_the_same() -> None:
    words = ["compare", "point.stc", "--optimizers", "sqp,nlopt:slsqp,witkin-kass", "--json"]
    running = subprocess.Popen(
        [sys.executable, "-c", SLOW, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert running.stderr is not None
    running.stderr.readline()
    running.send_signal(signal.SIGINT)
    out, _ = running.communicate(timeout=60)
    record = json.loads(out)
    assert record["status"] == "interrupted"
    assert [row["status"] for row in record["optimizers"]] == ["optimal", "interrupted"]


def test_what_has_long_steps_is_left_out_unless_it_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", "large.stc", "--time-limit", "5"]) == 0
    out, err = capsys.readouterr()
    rows = {line.split()[0]: line.split()[1:] for line in out.splitlines()[2:5]}
    assert rows["sqp"][0] == "optimal"
    assert rows["nlopt:slsqp"] == ["skipped"]
    assert "nlopt:slsqp keeps dense matrices: 601 unknowns" in out
    assert "--optimizers nlopt:slsqp runs it all the same" in out
    assert "nlopt:slsqp" not in err
    assert run(["compare", "point.stc", "--json"]) == 0
    statuses = [row["status"] for row in json.loads(capsys.readouterr().out)["optimizers"]]
    assert statuses == ["optimal"] * 3


def test_records_are_told_of_one_by_one() -> None:
    told: list[Run] = []
    names: list[str] = []

    def announced(name: str, *_: int) -> None:
        assert len(told) == len(names)
        names.append(name)

    runs = compare(stc.load(SPEC), ["sqp", "nlopt:slsqp"], on_run=told.append, announce=announced)
    assert told == runs
    assert names == ["sqp", "nlopt:slsqp"]
