"""Sweeps find what single solves find, keep it, and go on where they were stopped."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ended_processes import die, die_once

import stc
from stc.cli.main import run
from stc.workers import WorkerError, Workers, can_share

needs_joblib = pytest.mark.skipif(not can_share(), reason="joblib is not installed")

#: A mass is brought over the distance D in the time T with the least effort: the integral of the squared force is
#: 12 m^2 D^2/T^3, along a cubic.  Below D = -1 the guess has no value, and from D = 6 on the force is too small.
PUSH = """constants: n = 20, T = 1, h = T/n, m = 1, D = 1;
variables: x, u;
guess: x = sqrt(D + 1);
constraints: m*x'' = u; -24*m <= u <= 24*m; [0]: x; x'; [n]: x = D; x';
objective: integral(u^2);
method: hermite-simpson;
"""


def effort(m: float, D: float) -> float:
    return 12.0 * (m * D) ** 2


def push(tmp_path: Path) -> Path:
    spec = tmp_path / "push.stc"
    spec.write_text(PUSH)
    return spec


def test_every_point_is_what_the_closed_form_says(tmp_path: Path) -> None:
    told: list[int] = []
    axes = {"D": np.linspace(0.5, 2.0, 4), "m": [2, 1]}
    found = stc.sweep(
        push(tmp_path), axes, tmp_path / "found", workers=1, on_point=lambda _, one: told.append(one.index)
    )
    assert found.good and sorted(told) == list(range(8))
    columns = found.columns()
    assert columns["D"] == [0.5, 0.5, 1.0, 1.0, 1.5, 1.5, 2.0, 2.0] and columns["m"] == [1.0, 2.0] * 4
    np.testing.assert_allclose(
        columns["objective"], [effort(m, D) for D, m in zip(columns["D"], columns["m"])]
    )
    assert columns["start"].count("guess") == 1 and columns["verdict"] == [""] * 8
    assert found.solution(7)["x"][-1] == pytest.approx(2.0)
    with (tmp_path / "found" / "table.csv").open(encoding="utf-8") as stream:
        table = list(csv.DictReader(stream))
    assert [float(row["objective"]) for row in table] == columns["objective"]


def test_points_without_an_optimum_say_why_and_stop_nobody(tmp_path: Path) -> None:
    found = stc.sweep(push(tmp_path), {"D": [-9, 1, 2, 9, 3]}, tmp_path / "found", workers=1)
    columns = found.columns()
    assert columns["status"] == ["error", "optimal", "optimal", "optimal", "infeasible"]
    assert "sqrt" in columns["message"][0] and columns["message"][4]
    assert found.complete and not found.good
    with pytest.raises(stc.UsageError, match=r"point 0 of the sweep in .* has no motion"):
        found.solution(0)


def test_motions_of_a_model_are_judged(tmp_path: Path) -> None:
    """The model's gravity follows g; its mass does not follow when the text forgets to set it."""
    hop = stc.load("particle_waypoints", n=20, T=0.5)
    found = stc.sweep(hop, {"g": [1.62, 9.8]}, tmp_path / "good", workers=1)
    assert [found.facts[k]["verdict"] for k in (0, 1)] == ["passed", "passed"] and found.good
    assert all(0.0 < found.facts[k]["margin"] <= 1.0 for k in (0, 1))
    text = hop.text.replace("set body.particle.mass = m;", "").replace("T = 2", "T = 0.5")
    wrong = stc.sweep(text, {"m": [1, 2]}, tmp_path / "wrong", workers=1)
    assert [wrong.facts[k]["verdict"] for k in (0, 1)] == ["passed", "failed"] and not wrong.good
    assert wrong.facts[1]["margin"] > 1.0 and "joint" in wrong.facts[1]["message"]
    unjudged = stc.sweep("particle_waypoints", {"g": [1.62]}, tmp_path / "unjudged", workers=1, replay=False)
    assert unjudged.facts[0]["verdict"] == "" and unjudged.good


def test_what_is_done_is_not_done_again(tmp_path: Path) -> None:
    spec, axes = push(tmp_path), {"D": [0.5, 1.0, 2.0]}
    first = stc.sweep(spec, axes, tmp_path / "found", workers=1)
    again = stc.sweep(
        spec, axes, tmp_path / "found", workers=1, on_point=lambda *_: pytest.fail("solved again")
    )
    assert again.facts == first.facts
    (tmp_path / "found" / "points" / "2.json").unlink()
    told: list[int] = []
    mended = stc.sweep(
        spec, axes, tmp_path / "found", workers=1, on_point=lambda _, one: told.append(one.index)
    )
    assert told == [2] and mended.facts == first.facts


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"axes": {"D": [1.0, 3.0]}}, "axes"),
        ({"method": "central"}, "method"),
        ({"replay": False}, "replay"),
        ({"spec": PUSH.replace("24", "25")}, "spec, text"),
    ],
)
def test_a_folder_holds_one_sweep(tmp_path: Path, change: dict[str, Any], what: str) -> None:
    given: dict[str, Any] = {"spec": push(tmp_path), "axes": {"D": [1.0, 2.0]}}
    stc.sweep(**given, folder=tmp_path / "found", workers=1)
    with pytest.raises(stc.UsageError, match=f"found holds another sweep: it differs in {what}\n"):
        stc.sweep(**{**given, **change}, folder=tmp_path / "found", workers=1)


def test_a_folder_of_other_files_is_left_alone(tmp_path: Path) -> None:
    with pytest.raises(stc.UsageError, match="is not a folder of a sweep, and not empty"):
        stc.sweep(push(tmp_path), {"D": [1.0]}, tmp_path, workers=1)
    stc.sweep(tmp_path / "push.stc", {"D": [1.0]}, tmp_path / "found", workers=1)
    (tmp_path / "found" / "points" / "0.json").write_text("{")
    with pytest.raises(stc.UsageError, match=r"0\.json cannot be read as a file of a sweep\n.*delete it"):
        stc.sweep(tmp_path / "push.stc", {"D": [1.0]}, tmp_path / "found", workers=1)


def test_mistakes_are_told_before_any_work(tmp_path: Path) -> None:
    with pytest.raises(stc.UsageError, match="the spec has no constant `g`"):
        stc.sweep(push(tmp_path), {"g": [1.0]}, tmp_path / "found")
    with pytest.raises(stc.UsageError, match="at least one worker is needed, not 0"):
        stc.sweep(push(tmp_path), {"D": [1.0]}, tmp_path / "none", workers=0)
    text = stc.load("particle_waypoints").text.replace("particle.xml", "nowhere.xml")
    with pytest.raises(stc.SpecError, match="nowhere"):
        stc.sweep(text, {"g": [1.0]}, tmp_path / "found")
    assert not (tmp_path / "found").exists()


def test_without_joblib_there_is_one_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stc.workers.can_share", lambda: False)
    with Workers() as alone:
        assert list(alone.results(abs, [-1, 2])) == [1, 2]
    with pytest.raises(stc.UsageError, match="2 workers need joblib, which is not installed"):
        Workers(2)


@needs_joblib
@pytest.mark.slow
def test_tasks_of_workers_that_are_killed_are_done_by_others(tmp_path: Path) -> None:
    with Workers(2) as both:
        marks = [str(tmp_path / str(number)) for number in range(5)]
        assert list(both.in_order(die_once, marks)) == [0, 1, 2, 3, 4]
        assert sorted(both.results(abs, range(-4, 0))) == [1, 2, 3, 4]


@needs_joblib
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")  # joblib ends its workers
def test_who_has_had_enough_is_not_warned() -> None:
    with Workers(2) as both:
        results = both.results(abs, range(-50, 0))
        assert 1 <= next(results) <= 50
        results.close()


@needs_joblib
@pytest.mark.slow
def test_workers_that_are_killed_again_and_again_are_told_of() -> None:
    with Workers(2) as both, pytest.raises(WorkerError, match="worker processes were ended from outside"):
        list(both.results(die, range(4)))


def command(spec: Path, folder: Path, workers: int) -> list[str]:
    words = ["sweep", str(spec), "--set", "D=0.2:2:13", "--set", "m=1,2", "-o", str(folder)]
    return [sys.executable, "-m", "stc", *words, "--workers", str(workers)]


def done(folder: Path) -> dict[str, int]:
    """When the facts of each point that is done were written."""
    return {file.name: file.stat().st_mtime_ns for file in (folder / "points").glob("[0-9]*.json")}


@needs_joblib
@pytest.mark.slow
def test_two_workers_killed_twice_find_what_one_finds(tmp_path: Path) -> None:
    spec = push(tmp_path)
    assert run(command(spec, tmp_path / "one", 1)[3:]) == 0
    both = tmp_path / "both"
    for wanted in (4, 12):
        with subprocess.Popen(command(spec, both, 2), stdout=-3, stderr=-3) as process:
            while process.poll() is None and len(done(both)) < wanted:
                time.sleep(0.02)
            process.kill()
    before = done(both)
    assert len(before) >= 12
    ended = subprocess.run(command(spec, both, 2), check=True, capture_output=True, text=True)
    assert "push: 26 of 26 points" in ended.stdout
    assert before.items() <= done(both).items()
    assert (both / "table.csv").read_bytes() == (tmp_path / "one" / "table.csv").read_bytes()


@needs_joblib
@pytest.mark.slow
def test_an_interrupted_command_says_how_to_go_on_and_leaves_no_worker(tmp_path: Path) -> None:
    """A request to stop ends the command with what there is; its workers end with it."""
    with subprocess.Popen(
        command(push(tmp_path), tmp_path / "found", 2),
        stdout=-1,
        stderr=-1,
        text=True,
        start_new_session=True,
    ) as process:
        while process.poll() is None and len(done(tmp_path / "found")) < 3:
            time.sleep(0.02)
        process.terminate()
        _, err = process.communicate(timeout=120)
        assert process.returncode == 128 + signal.SIGTERM
        assert "of 26 points are done; the same command goes on from there" in err
        until = time.monotonic() + 60.0
        while _alive(process.pid):
            assert time.monotonic() < until, "workers are left"
            time.sleep(0.1)


def _alive(group: int) -> bool:
    """Whether any process of a group of processes is left."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return push(tmp_path)


def test_the_command_shows_what_was_found(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["sweep", "push.stc", "--set", "D=1:2:3", "--set", "m=1,1/2", "--workers", "1"]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[0] == "push: 6 of 6 points" and "push_sweep/table.csv" in out and err == ""
    assert (here.parent / "push_sweep" / "plot.png").read_bytes().startswith(b"\x89PNG")
    assert run(["sweep", "push.stc", "--set", "D=1,9", "-o", "few", "--workers", "1", "--json"]) == 1
    known = json.loads(capsys.readouterr().out)
    assert known["points"] == 2 and known["found"] == {"optimal": 1, "infeasible": 1}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "--set names the constants and their values"),
        (["--set", "D=1:2"], "--set wants NAME=FIRST:LAST:COUNT or NAME=VALUE,VALUE,..., not `D=1:2`"),
        (["--set", "D=1:2:1"], "the number of values must be a whole number, 2 or more"),
        (["--set", "D=1:2:2.5"], "the number of values must be a whole number, 2 or more"),
        (["--set", "D=1,,2"], "--set D=1,,2"),
        (["--set", "D=1,1"], "D is given the value 1 twice"),
    ],
)
def test_what_is_no_axis_is_refused(
    here: Path, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["sweep", "push.stc", *words]) == 2
    assert message in capsys.readouterr().err
