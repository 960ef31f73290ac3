"""Several optimizers side by side, from the command line: each is told of as it is done, and some are left out."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import stc
from stc.cli.main import run
from stc.studies.compare import Run, compare

SPEC = """constants: n = 0, c = 1;
variables: x, y;
constraints: x + 2*y = 5*c;
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


def test_a_table_with_a_line_each(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", "point.stc", "--optimizers", "sqp,nlopt:slsqp,nlopt:mma,witkin-kass"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split()[:3] == ["optimizer", "status", "objective"]
    found = {line.split()[0]: line.split()[1:] for line in lines[2:6]}
    assert list(found) == ["sqp", "nlopt:slsqp", "nlopt:mma", "witkin-kass"]
    for name in ("sqp", "nlopt:slsqp", "witkin-kass"):
        assert found[name][0] == "optimal"
        assert float(found[name][1]) == pytest.approx(5.0, rel=1e-6)
    assert found["nlopt:mma"] == ["refused"]
    assert "takes no equations" in lines[6]


def test_the_same_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", "point.stc", "--optimizers", "sqp, nlopt:auglag", "--set", "c=2", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["status"], record["name"]) == ("ok", "point")
    assert [one["optimizer"] for one in record["optimizers"]] == ["sqp", "nlopt:auglag"]
    for one in record["optimizers"]:
        assert one["objective"] == pytest.approx(20.0, rel=1e-6)
        assert one["violation"] <= 1e-6
        assert one["optimality"] <= 1e-6
        assert one["evaluations"] >= one["iterations"] > 0
        assert one["seconds"] > 0


def test_no_optimum_is_no_success(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", "point.stc", "--optimizers", "sqp", "--max-iterations", "0"]) == 1
    assert "iteration_limit" in capsys.readouterr().out


@pytest.mark.parametrize("names", ["nosuch", "sqp,nlopt:nosuch", ","])
def test_unknown_optimizers_are_mistakes(names: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["compare", "point.stc", "--optimizers", names]) == 2
    assert "optimizer" in capsys.readouterr().err


def test_solve_takes_an_optimizer_and_the_file_remembers(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["solve", "point.stc", "--optimizer", "nlopt:slsqp", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["optimizer"], record["objective"]) == ("nlopt:slsqp", pytest.approx(5.0))
    assert stc.read("point.npz").optimizer == "nlopt:slsqp"


def test_large_problems_get_a_note_first(capsys: pytest.CaptureFixture[str]) -> None:
    Path("large.stc").write_text(
        "constants: n = 600, h = 1; variables: x; constraints: [1, n]: x*x[i-1] <= 5; objective: (x - 1)^2;"
    )
    run(["solve", "large.stc", "--optimizer", "nlopt:slsqp", "--max-iterations", "0"])
    assert "note: nlopt:slsqp keeps dense matrices" in capsys.readouterr().err


def test_every_optimizer_starts_from_the_same_point() -> None:
    starts: list[float] = []

    def first(record: object) -> bool:
        if record.iteration == 0:  # type: ignore[attr-defined]
            starts.append(record.objective)  # type: ignore[attr-defined]
        return False

    spec = SPEC + "guess: x = 3; y = 4;"
    compare(stc.load(spec), ["nlopt:slsqp", "nlopt:auglag", "witkin-kass", "nlopt:cobyla"], callback=first)
    assert starts[:3] == [25.0, 25.0, 25.0]


def slow_comparison(*words: str) -> subprocess.Popen[str]:
    command = [
        sys.executable,
        "-c",
        SLOW,
        "compare",
        "point.stc",
        "--optimizers",
        "sqp,nlopt:slsqp,witkin-kass",
    ]
    return subprocess.Popen([*command, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.daily_every(2)
@pytest.mark.parametrize("again", [False, True])
def test_rows_are_there_at_once_and_stay_when_it_is_interrupted(again: bool) -> None:
    running = slow_comparison()
    assert running.stdout is not None and running.stderr is not None
    lines = [running.stdout.readline() for _ in range(3)]  # while the second one is busy
    assert [line.split()[:2] for line in lines] == [["point"], ["optimizer", "status"], ["sqp", "optimal"]]
    assert running.stderr.readline() == "iterates\n"
    running.send_signal(signal.SIGINT)
    if again:
        time.sleep(0.3)
        running.send_signal(signal.SIGINT)
    out, err = running.communicate(timeout=60)
    assert running.returncode == 1
    assert "Traceback" not in err
    assert "witkin-kass" not in out
    assert "of 3 optimizers were run" in err.splitlines()[-1]


def test_an_interrupted_comparison_is_json_all_the_same() -> None:
    running = slow_comparison("--json")
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
