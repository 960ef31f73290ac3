"""The commands from the outside: exit statuses, files, and what goes to which stream."""

from __future__ import annotations

import errno
import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stc
from stc.cli.main import run
from stc.cli.record import STAGES

# Minimise x^2 + y^2 on the line x + 2y = 5: the foot of the perpendicular from the origin is (1, 2).
NEAREST_POINT = "constants: n = 0, c = 5; variables: x, y; constraints: x + 2*y = c; objective: x^2 + y^2;"

# Least squared acceleration from 0 to 1, at rest at both ends, in unit time: x = 3t^2 - 2t^3, integral 12.
REST_TO_REST = """\
constants: n = 10, h = 1/n, xf = 1;
variables: x;
constraints:
  [0]: x; x';
  [n]: x = xf; x';
objective: integral(x''^2);
method: hermite-simpson;
"""

INFEASIBLE = "constants: n = 0; variables: x, y; constraints: x^2 + y^2 <= 1; x + y >= 3;"

Stc = Callable[..., tuple[int, str, str]]


@pytest.fixture
def stc_(stc_: Stc) -> Stc:
    """Runs a command line in a folder with two feasible specs and an infeasible one."""
    Path("point.stc").write_text(NEAREST_POINT)
    Path("rest.stc").write_text(REST_TO_REST)
    Path("infeasible.stc").write_text(INFEASIBLE)
    return stc_


def last_line(out: str) -> dict[str, Any]:
    record = json.loads(out.splitlines()[-1])
    assert isinstance(record, dict)
    return record


# ------------------------------------------------------------------ solving


def test_solve_prints_a_table_and_saves_a_solution(stc_: Stc) -> None:
    status, out, err = stc_("solve", "point.stc")
    assert (status, err) == (0, "")
    facts = dict(line.split(None, 1) for line in out.splitlines()[1:])
    assert facts["status"].strip() == "optimal"
    assert float(facts["objective"]) == pytest.approx(5.0)
    assert facts["saved"].strip() == "point.npz"
    solution = stc.read("point.npz")
    assert solution["x"] == pytest.approx([1.0])
    assert solution["y"] == pytest.approx([2.0])


def test_a_motion_without_steps_is_solved_by_every_method(stc_: Stc) -> None:
    for method in ("central", "trapezoidal", "hermite-simpson"):
        assert stc_("solve", "point.stc", "--method", method)[::2] == (0, "")
        solution = stc.read("point.npz")
        assert (solution.method, solution["y"]) == (method, pytest.approx([2.0]))
        assert stc_("solve", "point.stc", "--method", method, "--warm-start", "point.npz")[0] == 0


@pytest.mark.parametrize("spec", ["point.stc", "infeasible.stc"])
def test_what_cannot_be_saved_is_told_of_all_the_same(
    stc_: Stc, monkeypatch: pytest.MonkeyPatch, spec: str
) -> None:
    def full(self: stc.Solution, path: Path) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    expected = stc_("solve", spec)
    monkeypatch.setattr("stc.solution.Solution.save", full)
    status, out, err = stc_("solve", spec, "-o", "here.npz")
    assert status == 1
    assert [line for line in out.splitlines() if "time" not in line] == [
        line for line in expected[1].splitlines() if "time" not in line and "saved" not in line
    ]
    unsaved = "here.npz: No space left on device: the solution is not saved"
    assert f"note: {unsaved}" in err
    status, out, _ = stc_("solve", spec, "-o", "here.npz", "--json")
    told = last_line(out)
    assert (status, told["file"]) == (1, None)
    assert told["message"].endswith(unsaved)
    assert told["objective"] == pytest.approx(5.0) or told["status"] == "infeasible"


def test_what_does_not_fit_on_a_disk_is_saved_among_temporary_files(
    stc_: Stc, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    save = stc.Solution.save

    def full(self: stc.Solution, path: Path) -> None:
        if path.parent == Path():
            raise OSError(errno.ENOSPC, "No space left on device")
        save(self, path)

    monkeypatch.setattr("stc.solution.Solution.save", full)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    status, _, err = stc_("solve", "point.stc", "-o", "here.npz")
    (place,) = tmp_path.glob("stc-*/here.npz")
    assert status == 1
    assert f"here.npz: No space left on device: the solution is saved as {place} instead" in err
    assert stc.read(place).status == "optimal"


def test_a_folder_that_cannot_be_written_to_is_told_of_before_solving(
    stc_: Stc, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.access", lambda path, mode: str(path) != "kept")
    Path("kept").mkdir()
    status, out, err = stc_("solve", "point.stc", "-o", "kept/point.npz")
    assert (status, out) == (2, "")
    assert err == "stc: -o kept/point.npz: nothing can be written to the folder `kept`\n"


def test_a_coarse_grid_is_told_of_and_the_status_stays(stc_: Stc) -> None:
    coarse = """
    constants: n = 10, T = 4, h = T/n;
    variables: a, u;
    method: trapezoidal;
    constraints: [0, n]: a'' = u - 9.81*sin(a); [0]: a; a'; [n]: a = 3.14159; a';
    objective: [0, n]: integral(u^2);
    guess: a = 3.14159*t/T;
    """
    Path("coarse.stc").write_text(coarse)
    status, out, err = stc_("solve", "coarse")
    assert status == 0 and "status       optimal" in out
    assert "grid error   " in out
    assert "note: the grid is coarse" in err and "--refine" in err
    record = last_line(stc_("solve", "coarse", "--json")[1])
    assert record["status"] == "optimal"
    assert record["grid"]["gross"] is True and record["grid"]["motion"] > 0.01
    status, out, err = stc_("solve", "cart_pole_swing_up")
    assert (status, err) == (0, "") and "of the range of" in out


def test_json_has_every_promised_key(stc_: Stc) -> None:
    status, out, _ = stc_("solve", "rest", "--json")
    assert status == 0
    assert len(out.splitlines()) == 1
    record = last_line(out)
    shape = {key: type(value).__name__ for key, value in record.items()}
    assert shape == {
        "status": "str",
        "message": "str",
        "objective": "float",
        "violation": "float",
        "optimality": "float",
        "iterations": "int",
        "factorizations": "int",
        "strategy": "str",
        "optimizer": "str",
        "grid": "dict",
        "ringing": "list",
        "complementarity": "NoneType",
        "blame": "NoneType",
        "active": "NoneType",
        "sensitivities": "NoneType",
        "estimation": "NoneType",
        "variables": "int",
        "rows": "int",
        "parameters": "dict",
        "seconds": "dict",
        "name": "str",
        "method": "str",
        "n": "int",
        "file": "str",
        "warnings": "list",
        "outside": "list",
    }
    assert set(STAGES) <= set(record["seconds"])
    assert all(isinstance(value, float) for value in record["seconds"].values())
    assert record["objective"] == pytest.approx(12.0, rel=1e-6)
    assert record["factorizations"] >= record["iterations"] > 0


def test_constants_from_outside_may_be_expressions(stc_: Stc) -> None:
    status, out, _ = stc_("solve", "point", "--json", "--set", "c=20/2^2 + sqrt(25)")
    assert status == 0
    assert last_line(out)["objective"] == pytest.approx(20.0)


def test_numbers_of_a_model_are_given_by_their_paths(stc_: Stc) -> None:
    status, out, _ = stc_("solve", "arm_swing", "--json", "--set", "body.hand.mass=0.3")
    assert status == 0
    assert last_line(out)["objective"] < 500.0
    _, _, told = stc_("solve", "arm_swing", "--set", "body.hands.mass=1")
    assert "did you mean `body.hand.mass`" in told


def test_the_later_of_two_values_wins(stc_: Stc) -> None:
    _, out, _ = stc_("solve", "point", "--json", "--set", "c=1", "--set", "c=10")
    assert last_line(out)["objective"] == pytest.approx(20.0)


def test_method_and_n_can_be_chosen(stc_: Stc) -> None:
    _, out, _ = stc_("solve", "rest", "--json", "--method", "trapezoidal", "--set", "n=20")
    record = last_line(out)
    assert (record["method"], record["n"]) == ("trapezoidal", 20)


def test_output_goes_where_it_should(stc_: Stc) -> None:
    _, out, _ = stc_("solve", "rest", "-o", "deep/er/motion.csv", "--json")
    assert last_line(out)["file"] == str(Path("deep/er/motion.csv"))
    assert stc.read("deep/er/motion.csv")["x"] == pytest.approx(
        3 * (t := np.linspace(0, 1, 11)) ** 2 - 2 * t**3
    )
    assert not Path("rest.npz").exists()
    assert [path.name for path in Path("deep/er").iterdir()] == [
        "motion.csv"
    ]  # nothing half-written beside it


def test_warm_start_takes_fewer_iterations_even_with_another_n(stc_: Stc) -> None:
    cold = last_line(stc_("solve", "rest", "--json", "-o", "cold.npz")[1])
    warm = last_line(stc_("solve", "rest", "--json", "--warm-start", "cold.npz")[1])
    finer = last_line(stc_("solve", "rest", "--json", "--warm-start", "cold.npz", "--set", "n=20")[1])
    assert warm["status"] == finer["status"] == "optimal"
    assert warm["iterations"] <= cold["iterations"]
    assert finer["n"] == 20


def test_what_did_not_converge_says_so_and_is_saved(stc_: Stc) -> None:
    status, out, _ = stc_("solve", "rest", "--max-iterations", "0", "--json")
    record = last_line(out)
    assert (status, record["status"]) == (1, "iteration_limit")
    assert stc.read("rest.npz").status == "iteration_limit"
    status, out, _ = stc_("solve", "rest", "--max-iterations", "0")
    assert status == 1
    assert "iteration_limit" in out


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_what_did_not_converge_does_not_cost_an_optimal_solution(stc_: Stc, suffix: str) -> None:
    target = ("-o", f"rest{suffix}")
    assert stc_("solve", "rest", *target)[2] == ""
    best = Path(f"rest{suffix}").read_bytes()
    status, _, err = stc_("solve", "rest", "--max-iterations", "0", *target)
    kept = Path(f"rest.optimal{suffix}")
    assert (status, err.strip()) == (
        1,
        f"note: rest{suffix} held an optimal solution, and the new one is not optimal; the old file is kept as {kept}",
    )
    assert kept.read_bytes() == best
    assert stc.read(f"rest{suffix}").status == "iteration_limit"
    # The next failure has nothing to keep, and what was kept stays; so it does beside the next success.
    assert stc_("solve", "rest", "--max-iterations", "0", *target)[2] == ""
    assert stc_("solve", "rest", *target)[2] == ""
    assert kept.read_bytes() == best
    # What cannot be read is nothing to keep.
    Path(f"rest{suffix}").write_text("no solution")
    assert stc_("solve", "rest", "--max-iterations", "0", *target)[::2] == (1, "")


def test_infeasible_is_an_outcome_and_no_mistake(stc_: Stc) -> None:
    status, out, _ = stc_("solve", "infeasible", "--json")
    record = last_line(out)
    assert (status, record["status"]) == (1, "infeasible")
    assert record["violation"] > 0.1
    assert record["message"]


def test_contradictory_bounds_are_infeasible(stc_: Stc) -> None:
    Path("contradiction.stc").write_text("constants: n = 0; variables: x; constraints: x >= 2; x <= 1;")
    status, out, _ = stc_("solve", "contradiction", "--json")
    record = last_line(out)
    assert (status, record["status"]) == (1, "infeasible")
    assert record["optimality"] is None


def test_warnings_are_of_the_spec_as_it_stands(stc_: Stc) -> None:
    # A free end time that every frame counts; not quadratic, on enough frames to be solved on fewer of them first.
    Path("swing.stc").write_text(
        """constants: n = 80; variables: q, u; parameters: T; definitions: h = T/n; guess: T = 4; q = pi*t/4;
        constraints: q'' + 9.81*sin(q) = u; -3 <= u <= 3; [0]: q; q'; [n]: q = pi; q'; 1 <= T <= 10;
        objective: T; method: trapezoidal;"""
    )
    said = "this term is the same on every frame and counts 81 times"
    for words in (("check", "swing"), ("solve", "swing"), ("solve", "swing", "--refine", "10")):
        assert said in stc_(*words)[2], words
        warnings = last_line(stc_(*words, "--json")[1])["warnings"]
        assert [one["message"] for one in warnings] == [said], words
    assert "counts 41 times" in stc_("solve", "swing", "--continue", "n=20:40:1")[2]


def test_check_does_not_praise_bounds_that_contradict_each_other(stc_: Stc) -> None:
    Path("contra.stc").write_text(
        "constants: n = 4; variables: x;\nconstraints:\n  [0]: x = 0;\n  [0]: x = 1;\nobjective: x''^2;"
    )
    status, out, err = stc_("check", "contra")
    assert status == 1
    assert "no mistakes" not in out and "infeasible" in out
    said = "x at frame 0 must be at least 1 and at most 0 (contra.stc:4:8 and contra.stc:3:8)"
    assert said in err
    status, out, _ = stc_("check", "contra", "--json")
    record = last_line(out)
    assert (status, record["status"], record["contradictions"]) == (1, "infeasible", [said])


# --------------------------------------------------------------- validation


def test_run_solves_saves_and_validates(stc_: Stc) -> None:
    status, out, _ = stc_("run", "particle_waypoints", "--json")
    record = last_line(out)
    assert (status, record["status"]) == (0, "optimal")
    assert record["validation"]["passed"] is True
    assert all(
        set(metric) >= {"name", "value", "unit", "limit", "verdict"}
        for metric in record["validation"]["metrics"]
    )
    assert Path("particle_waypoints.npz").exists()

    status, out, _ = stc_("validate", "particle_waypoints.npz")
    assert status == 0
    assert "open-loop drift" in out
    assert "passed" in out


def test_validate_solves_a_spec_first_and_saves_only_on_request(stc_: Stc) -> None:
    status, out, _ = stc_("validate", "particle_waypoints", "--json", "--set", "n=20")
    assert status == 0
    assert last_line(out)["file"] is None
    assert not Path("particle_waypoints.npz").exists()


def test_what_did_not_converge_is_replayed_only_by_force(stc_: Stc) -> None:
    words = ("run", "particle_waypoints", "--json", "--set", "n=8", "--max-iterations", "0")
    status, out, err = stc_(*words)
    record = last_line(out)
    assert (status, record["status"], record["validation"]) == (1, "iteration_limit", None)
    assert "--force" in err
    status, out, _ = stc_(*words, "--force")
    assert status == 1
    assert last_line(out)["validation"]["metrics"]


def test_a_spec_without_a_replay_section_is_solved_but_not_validated(stc_: Stc) -> None:
    status, out, err = stc_("run", "rest", "--json")
    record = last_line(out)
    assert (status, record["status"], record["validation"]) == (1, "optimal", None)
    assert "replay" in err
    assert Path("rest.npz").exists()


# ----------------------------------------------------------- mistakes


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["solve"], "SPEC"),
        (["slove", "point"], "solve"),
        (["solve", "point", "--nosuch"], "--nosuch"),
        (["solve", "poimt"], "did you mean `point.stc`?"),
        (["solve", "particle_waypoint"], "did you mean `particle_waypoints`?"),
        (["solve", "nowhere/at_all.stc"], "no such file"),
        (["solve", "."], "folder"),
        (["solve", "point", "--set", "c"], "NAME=VALUE"),
        (["solve", "point", "--set", "c="], "NAME=VALUE"),
        (["solve", "point", "--set", "c=1/0"], "division by zero"),
        (["solve", "point", "--set", "c=y"], "`y` is not a number"),
        (["solve", "point", "--set", "c=(1"], "`)`"),
        (["solve", "point", "--set", "d=1"], "d"),
        (["solve", "point", "--method", "trapezoid"], "did you mean `trapezoidal`?"),
        (["solve", "point", "--max-iterations", "few"], "--max-iterations"),
        (["solve", "point", "--max-iterations", "-1"], "--max-iterations"),
        (["solve", "point", "--time-limit", "0"], "--time-limit"),
        (["solve", "point", "--tolerance", "nan"], "--tolerance"),
        (["solve", "point", "--warm-start", "gone.npz"], "gone.npz"),
        (["solve", "point", "--warm-start", "point.stc"], "point.stc"),
        (["solve", "point", "-o", "point.txt"], ".npz"),
        (["solve", "point", "-o", "point.stc/inside.npz"], "point.stc"),
        (["validate", "gone.npz"], "gone.npz"),
        (["validate", "rest"], "replay"),
        (["show", "point", "--stage", "tokns"], "did you mean `tokens`?"),
        (["new", "point"], "exists already"),
        (["new", "point.stc/inside"], "point.stc/inside.stc"),
        (["solve", "point", "--tolerance", "1e-30"], "between 1e-14 and 1, not 1e-30"),
        (["validate", "point", "--samples", "3"], "--samples can only be used with --robustness"),
        (["validate", "point", "--seed", "3"], "--seed can only be used with --robustness"),
    ],
)
def test_mistakes_get_a_message_and_exit_2(stc_: Stc, words: list[str], expected: str) -> None:
    status, out, err = stc_(*words)
    assert status == 2
    assert expected in err
    assert out == ""
    assert "Traceback" not in err
    status, out, _ = stc_(*words, "--json")
    assert status == 2
    record = last_line(out)
    assert record["status"] == "error"
    assert record["message"]
    assert record["objective"] is None
    assert record["diagnostics"] == []
    assert set(record["seconds"]) == set(STAGES)


def test_mistakes_in_a_spec_have_their_places(stc_: Stc) -> None:
    # A name that nothing declares, and a line that cannot be read: both are told in one run.
    Path("wrong.stc").write_text("constants: n = 0;\nvariables: x;\nconstraints:\n  x = yy;\n  x + = 2;\n")
    status, out, err = stc_("solve", "wrong.stc", "--json")
    assert status == 2
    assert re.findall(r"wrong\.stc:(\d+):\d+: error", err) == ["4", "5"]
    assert "^" in err
    record = last_line(out)
    first = record["diagnostics"][0]
    assert set(first) == {"file", "line", "column", "severity", "message", "hint"}
    assert (Path(first["file"]).name, first["severity"]) == ("wrong.stc", "error")
    assert isinstance(first["line"], int)
    assert isinstance(first["column"], int)


def test_an_undefined_start_is_a_mistake_in_the_input(stc_: Stc) -> None:
    Path("log.stc").write_text("constants: n = 0;\nvariables: x;\nconstraints:\n  log(x) + x^2 = 1;\n")
    status, out, _ = stc_("solve", "log", "--json")
    record = last_line(out)
    assert (status, record["status"]) == (2, "error")
    assert [d["line"] for d in record["diagnostics"]] == [4]


def test_a_damaged_solution_is_a_mistake(stc_: Stc) -> None:
    Path("bad.npz").write_bytes(b"PK\x03\x04 nothing of use")
    for words in (["validate", "bad.npz"], ["solve", "point", "--warm-start", "bad.npz"]):
        status, _, err = stc_(*words)
        assert status == 2
        assert "bad.npz" in err


def test_a_defect_of_the_program_is_one_clear_line(stc_: Stc, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise RuntimeError("inner\nworkings")

    monkeypatch.setattr("stc.pipeline.Model.solve", broken)
    status, out, err = stc_("solve", "point", "--json")
    assert status == 1
    assert len(err.splitlines()) == 1
    assert "report" in err
    assert last_line(out)["status"] == "failed"
    monkeypatch.setenv("STC_DEBUG", "1")
    assert "Traceback" in stc_("solve", "point")[2]


# -------------------------------------------------------- looking at specs


def test_check_tells_sizes_without_solving(stc_: Stc, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("stc.pipeline.Model.solve", lambda *_, **__: pytest.fail("check must not solve"))
    status, out, _ = stc_("check", "rest", "--json", "--set", "n=4")
    record = last_line(out)
    assert (status, record["status"], record["n"]) == (0, "ok", 4)
    # Position, velocity and acceleration on 5 frames and 4 midpoints; two links for each of two orders.
    assert (record["variables"], record["rows"]) == (27, 16)
    assert stc_("check", "rest")[0] == 0


def test_check_prints_warnings(stc_: Stc) -> None:
    Path("unused.stc").write_text("constants: n = 0, spare = 1;\nvariables: x;\nconstraints: x = 1;\n")
    status, out, err = stc_("check", "unused", "--json")
    assert status == 0
    assert "spare" in err
    (warning,) = last_line(out)["warnings"]
    assert (warning["line"], warning["severity"]) == (1, "warning")


def test_list_names_every_bundled_spec(stc_: Stc) -> None:
    status, out, _ = stc_("list")
    assert status == 0
    names = [line.split()[0] for line in out.splitlines()]
    assert "particle_waypoints" in names
    listed = last_line(stc_("list", "--json")[1])["specs"]
    assert [entry["name"] for entry in listed] == names
    assert all(entry["summary"] for entry in listed)


def test_new_makes_folders_and_advises_what_works(stc_: Stc) -> None:
    status, out, err = stc_("new", "sub/my hop")
    assert (status, err) == (0, "")
    assert Path("sub/my hop.stc").is_file()
    advice = out.split("next: stc ")[1]
    assert stc_(*shlex.split(advice))[0] == 0
    assert advice.strip() in Path("sub/my hop.stc").read_text()


def test_new_says_that_it_shadows_a_bundled_spec(stc_: Stc) -> None:
    status, _, err = stc_("new", "luxo_jump")
    assert status == 0
    assert "luxo_jump is a bundled spec too: in this folder that name means luxo_jump.stc" in err
    assert "`stc new mine --from luxo_jump`" in err
    assert stc_("new", "sub/luxo_jump")[2] == ""


def test_new_copies_a_bundled_spec(stc_: Stc) -> None:
    from stc import specs

    assert stc_("new", "land", "--from", "particle_terrain")[0] == 0
    source = specs.locate("particle_terrain")
    assert source is not None
    assert Path("land.stc").read_text() == source.read_text()
    assert stc_("check", "land.stc")[0] == 0  # with its data
    status, _, err = stc_("new", "other", "--from", "particle_terrain")
    assert (status, Path("other.stc").exists()) == (2, False)
    assert "particle_terrain.csv` exists already" in err
    assert "`stc list` names them" in stc_("new", "x", "--from", "nothing")[2]
    assert (
        "`--model` does not go with it" in stc_("new", "x", "--from", "luxo_jump", "--model", "luxo.xml")[2]
    )


def test_the_help_tells_how_many_samples_there_are(stc_: Stc) -> None:
    from stc.validate.limits import PERTURBED_SAMPLES

    assert f"default {PERTURBED_SAMPLES}." in stc_("validate", "--help")[1]


def test_new_writes_a_spec_that_solves_and_validates(stc_: Stc) -> None:
    assert stc_("new", "hop")[0] == 0
    assert "hop" in Path("hop.stc").read_text().splitlines()[0]
    status, out, err = stc_("run", "hop.stc", "--json")
    record = last_line(out)
    assert (status, record["warnings"], err) == (0, [], "")
    assert record["validation"]["passed"] is True


def test_version_and_help(stc_: Stc) -> None:
    assert stc_("--version")[:2] == (0, f"stc {stc.__version__}\n")
    for words in ([], ["--help"], ["solve", "-h"]):
        status, out, _ = stc_(*words)
        assert status == 0
        assert "Usage" in out


@pytest.mark.parametrize("command", ["check", "run"])
def test_replay_lines_that_do_not_fit_the_model_are_told_with_their_places_before_a_solve(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    text = stc.load("particle_waypoints").text
    text = text.replace("joint x =", "joint xx =").replace("body.particle.mass", "body.particl.mass")
    (tmp_path / "wrong.stc").write_text(text)
    assert run([command, "wrong.stc"]) == 2
    said = capsys.readouterr().err
    assert "error: joint xx: the model has no joint xx" in said
    assert "error: set body.particl.mass: the model has no body particl; did you mean particle?" in said
    assert len(re.findall(r"^wrong\.stc:\d+:3: error", said, re.MULTILINE)) == 2
    assert len(re.findall(r"\^+$", said, re.MULTILINE)) == 2
    assert not (tmp_path / "wrong.npz").exists()


@pytest.mark.parametrize("command", ["check", "run", "validate"])
def test_outputs_and_models_that_are_not_there_are_told_before_a_solve(stc_: Stc, command: str) -> None:
    text = stc.load("particle_waypoints").text.rstrip()
    Path("wrong.stc").write_text(f"{text}\n  compare body.particle.q = x;\n")
    status, _, err = stc_(command, "wrong.stc")
    last = len(text.splitlines()) + 1
    assert status == 2
    said = "error: compare body.particle.q: end the path in one of .x, .y, .z"
    assert err.startswith(f"wrong.stc:{last}:3: {said}")
    assert not Path("wrong.npz").exists()
    # A file beside the spec is meant rather than a bundled one whose name is like it, too.
    Path("parcel.xml").write_text("<mujoco/>")
    Path("wrong.stc").write_text(text.replace('"particle.xml"', '"parcl.xml"'))
    status, _, err = stc_(command, "wrong.stc")
    line = text[: text.index('"particle.xml"')].count("\n") + 1
    assert status == 2
    assert err.startswith(f"wrong.stc:{line}:3: error: there is no model parcl.xml: looked in")
    assert "did you mean parcel.xml?" in err


@pytest.mark.parametrize("encoding", ["latin-1", "utf-16"])
def test_another_encoding_is_told_with_its_line(stc_: Stc, encoding: str) -> None:
    Path("hop.stc").write_bytes("constants: n = 3;  # frames\n# für die Übung\n".encode(encoding))
    line, byte = (2, "0xfc") if encoding == "latin-1" else (1, "0xff")
    status, out, err = stc_("check", "hop.stc")
    assert (status, out) == (2, "")
    assert err.startswith(
        f"stc: hop.stc is not UTF-8 text: line {line} has the byte {byte}\n  save it in the encoding UTF-8"
    )


def test_what_is_no_spec_is_told_in_few_lines(stc_: Stc) -> None:
    Path("README.md").write_text("This is *prose*, and no spec.\n\nIt's long; really: long.\n" * 100)
    status, out, err = stc_("check", "README.md", "--json")
    assert status == 2
    assert len(err.splitlines()) < 120
    last = "`README.md` may not be a spec: specs are .stc files; `stc new NAME` writes one"
    assert err.rstrip().endswith(last)
    mistakes = last_line(out)["diagnostics"]
    assert f"and {len(mistakes) - 20} more mistakes" in err
