"""Several optimizers side by side, from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import stc
from stc.cli.main import run
from stc.studies.compare import compare

SPEC = """constants: n = 0, c = 1;
variables: x, y;
constraints: x + 2*y = 5*c;
objective: x^2 + y^2;
"""


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("point.stc").write_text(SPEC)


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
