"""The comparison's own parts: problems that mean the same in both notations, tables that count what they should."""

from __future__ import annotations

import math
import re
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import stc

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def peers(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(ROOT))
    import bench.peers

    return bench.peers


def test_the_chain_means_the_same_in_both_notations(peers: ModuleType) -> None:
    from bench.peers import problems

    rods = 3
    solution = stc.load(problems.spec_of("P3", rods)).solve(n=8)
    assert solution.status == "optimal"
    for frame in range(9):
        q, v, a, tau = (
            [solution[f"{name}{k}{primes}"][frame] for k in range(1, rods + 1)]
            for name, primes in (("q", ""), ("q", "'"), ("q", "''"), ("tau", ""))
        )
        needed = problems.chain_torques(q, v, a, math.sin, math.cos)
        assert needed == pytest.approx(tau, rel=1e-6, abs=1e-5)


def test_the_cart_pole_means_the_same_in_both_notations(peers: ModuleType) -> None:
    from bench.peers import problems

    solution = stc.load(problems.spec_of("P2", 0)).solve(n=20)
    cart, pole = problems.cart_pole_accelerations(
        solution["q2"], solution["q2'"], solution["u"], np.sin, np.cos
    )
    assert np.allclose(cart, solution["q1''"], atol=1e-5)
    assert np.allclose(pole, solution["q2''"], atol=1e-5)


def test_a_tool_may_run_in_another_python(
    peers: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from bench.peers import runner
    from bench.peers.contenders import contender

    one = contender("Sleipnir")
    monkeypatch.delenv("BENCH_PYTHON_SLEIPNIR", raising=False)
    assert runner.interpreter(one) == sys.executable
    other = tmp_path / "python"
    for answers, takes_part in ((f'exec {sys.executable} -c "pass"', True), ("exit 1", False)):
        other.write_text(f"#!/bin/sh\n{answers}\n", encoding="utf-8")
        other.chmod(0o755)
        monkeypatch.setenv("BENCH_PYTHON_SLEIPNIR", str(other))
        assert runner.interpreter(one) == str(other)
        present, absent = runner.available()
        assert (one in present) == takes_part
        assert any("Sleipnir" in line for line in absent) != takes_part


@pytest.mark.parametrize(
    "tool",
    [
        "exec sleep 600",  # is ended from outside
        """echo '{"cpu": [0.7], "wall": [0.7], "iterations": 3, "objective": 1.0, "solved": false,'"""
        """ '"status": "Maximum_CpuTime_Exceeded", "note": ""}'""",  # stops at its own limit
    ],
)
def test_a_tool_without_an_answer_is_a_row(
    peers: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, tool: str
) -> None:
    from bench.peers import report, runner
    from bench.peers.contenders import contender
    from bench.peers.task import Case

    python = tmp_path / "python"
    python.write_text(f"#!/bin/sh\n{tool}\n", encoding="utf-8")
    python.chmod(0o755)
    monkeypatch.setenv("BENCH_PYTHON_SLEIPNIR", str(python))
    monkeypatch.setattr(runner, "SETTING_UP", 0.0)
    case = Case("P2", 50, time_limit=0.6)
    said: list[str] = []
    found = runner.solve_only([case], [contender("Sleipnir")], 3, said.append)
    assert len(said) == 1  # it is not asked again
    table = report.everyone(found)
    assert "| Sleipnir |" in table and "no answer in 0.6 s" in table
    ours = runner.Measured("stc", case, [0.002], [0.002], 10, 59.0, True)
    assert (
        report.overview([ours, *found])
        .splitlines()[2]
        .startswith("| P2 | 50 | 2 | 10 | no answer in 0.6 s |")
    )
    assert {case.time_limit for case in runner.CASES if case.problem in ("P7", "P8")} == {900.0}


@pytest.mark.slow
def test_the_quadratic_problem_is_the_spec(peers: ModuleType) -> None:
    from bench.peers import problems
    from bench.peers.quadratic import build
    from bench.peers.task import Case

    ours = stc.load(problems.spec_of("P1", 0)).solve(n=40)
    theirs = build(Case("P1", 40), "superlu").solve()
    assert theirs.objective == pytest.approx(ours.objective, rel=1e-9)


def test_only_the_same_optimum_counts(peers: ModuleType) -> None:
    from bench.peers import report
    from bench.peers.runner import Measured
    from bench.peers.task import Case

    ours = Measured("stc", Case("P2", 50), [0.002, 0.003], [0.002, 0.003], 10, 59.0, True)
    slow = replace(ours, contender="IPOPT, mapped", cpu=[0.006, 0.007])
    other = replace(ours, contender="fatrop, mapped", cpu=[0.001], objective=60.0)
    failed = replace(ours, contender="fatrop, expanded", cpu=[0.001], solved=False)
    different = replace(ours, contender="Crocoddyl", cpu=[0.001])
    table = report.overview([ours, slow, other, failed, different])
    assert table.splitlines()[2] == "| P2 | 50 | 2 | 10 | IPOPT, mapped | 6 | 10 | 3 | 5 |"
    assert "P2, n = 50 (3 of 5 times)" in report.missed([ours, slow, other, failed, different])
    assert "another optimum" in report.everyone([ours, other])
    assert Measured.from_dict(slow.to_dict()) == slow


def test_a_part_measured_anew_keeps_the_rest(peers: ModuleType) -> None:
    from bench.peers.runner import Measured, merged
    from bench.peers.task import Case

    old = [Measured(name, Case("P2", n), [1.0]) for n in (50, 1000) for name in ("stc", "PIQP")]
    new = [
        Measured("stc", Case("P2", 50, time_limit=20.0), [0.5]),
        Measured("SuperLU", Case("P1", 50), [2.0]),
    ]
    both = merged(old, new)
    assert [(one.contender, one.case.n, one.cpu[0]) for one in both] == [
        *[("stc", 50, 0.5), ("PIQP", 50, 1.0), ("stc", 1000, 1.0), ("PIQP", 1000, 1.0), ("SuperLU", 50, 2.0)]
    ]
    assert both[0].case == both[1].case


def test_every_part_has_its_place_on_the_page(peers: ModuleType) -> None:
    from bench.__main__ import PARTS, SCRIPTS

    page = (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    for part in ("overview", "everyone", *(set(PARTS) - {"peers"})):
        assert page.count(f"<!-- {part} -->") == page.count(f"<!-- end of {part} -->") == 1, part
    assert all((ROOT / "bench" / f"{name}.py").exists() for name in SCRIPTS.values())


def test_the_systems_factorised_alone_are_those_of_a_solve(
    peers: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "bench"))
    from kkt import System, backward_error, system_of
    from scipy.sparse import coo_array

    from bench.peers.problems import constants_of, spec_of
    from stc.solver.kkt import structured_kkt

    for name, constants in (("P3", {"n": 20}), ("P5", constants_of("P5", 30))):
        systems: list[System] = [
            system_of(spec_of(name, 2), 8, presolve=presolve, **constants) for presolve in (True, False)
        ]
        assert (systems[0].lower()[0] < systems[1].lower()[0]) == (name == "P5")  # presolve leaves some out
        for system in systems:
            size, rows, columns, values = system.lower()
            lower = coo_array((values, (rows, columns)), shape=(size, size)).toarray()
            eigenvalues = np.linalg.eigvalsh(lower + np.tril(lower, -1).T)
            ours = structured_kkt(*system.pattern)
            ours.hess[:], ours.jac[:], ours.primal[:], ours.dual[:] = system.values
            assert ours.refactor() == (np.sum(eigenvalues > 0), np.sum(eigenvalues < 0), 0) != (0, 0, 0)
            rhs = np.random.default_rng(1).standard_normal(size)
            n = system.pattern[0]
            assert backward_error(system, np.concatenate(ours.solve(rhs[:n], rhs[n:])), rhs) < 1e-8


@pytest.mark.parametrize(
    ("ratios", "expected"),
    [
        ([0.7, 0.75, 0.8, 1.5], "faster"),
        ([0.9, 0.97, 0.99, 1.0], "level"),
        ([0.6, 0.9, 1.2, 1.6], "level"),
        ([1.03, 1.03, 1.04, 1.05], "slower"),
        ([1.0, 1.01, 1.04, 1.05], "level"),
        ([1.1], "slower"),
    ],
)
def test_two_threads_are_judged_by_most_rounds(peers: ModuleType, ratios: list[float], expected: str) -> None:
    from bench import threads

    # the machine gets slower and slower: only the ratios of a round tell
    rounds = [((0.1 * k, 0.1 * k), (0.1 * k * ratio, 0.2 * k)) for k, ratio in enumerate(ratios, start=1)]
    assert threads.verdict(rounds) == expected
    line = threads.line(threads.Case("solve", "P4", 1000, 20), rounds)
    assert line.startswith("| solve P4, 20 rods, n = 1,000 | ") and line.endswith(f" | {expected} |")
    assert line.count("|") == threads.HEAD.splitlines()[0].count("|")


def test_one_thread_and_two_take_turns(peers: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    from bench import threads
    from stc.codegen.threads import limit

    asked: list[int] = []

    def measure(count: int) -> threads.Times:
        asked.append(count)
        return float(count), 0.0

    assert threads.alternate(measure, 3) == [((1.0, 0.0), (2.0, 0.0))] * 3
    assert asked == [1, 2, 2, 1, 1, 2]
    monkeypatch.setattr(threads, "BUDGET", 0.0)
    assert len(threads.alternate(measure, 100)) == threads.FEWEST
    monkeypatch.setattr(threads, "BATCH", 1e-4)
    try:
        for what in ("solve", "evaluate"):
            rounds = threads.repeated(threads.Case(what, "P2", 20), 2)
            assert len(rounds) == 2 and min(min(times) for both in rounds for times in both) >= 0.0
    finally:
        limit(None)
    assert threads.summary(["level", "faster", "level"]).endswith("1 faster, 2 level, 0 slower.")


def test_a_page_keeps_its_prose(peers: ModuleType, tmp_path: Path) -> None:
    from bench import document

    page = tmp_path / "page.md"
    page.write_text("before\n\n<!-- part -->\nold\n<!-- end of part -->\n\nafter\n")
    document.put("part", "| new |\\n", page)
    assert page.read_text() == "before\n\n<!-- part -->\n\n| new |\\n\n\n<!-- end of part -->\n\nafter\n"
    with pytest.raises(ValueError, match="no part 'other'"):
        document.put("other", "", page)


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_random_motions_are_specs_and_repeat(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "bench"))
    from kinds import KINDS

    for kind in KINDS:
        texts = [kind(np.random.default_rng([seed, 0])) for seed in (1, 1, 2)]
        assert texts[0] == texts[1] != texts[2]
        for text in texts[1:]:
            model = stc.load(text)
            problem, transcription = model.transcription()
            assert np.isfinite(transcription.bind(problem.constants).x0).all()


def test_random_motions_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("casadi")
    monkeypatch.syspath_prepend(str(ROOT / "bench"))
    from variety import Ending, line

    pairs = [
        (Ending("optimal", 1.0, 10, 1.0), Ending("optimal", 1.00001, 20, 4.0)),
        (Ending("optimal", 1.0, 10, 1.0), Ending("optimal", 2.0, 20, 16.0)),
        (Ending("optimal", 3.0, 40, 2.0), Ending("optimal", 2.0, 20, 16.0)),
        (Ending("infeasible", 3.0, 40, 2.0), Ending("optimal", 2.0, 20, 16.0)),
    ]
    assert line("rods", pairs) == "| rods | 4 | 3 | 4 | 1 / 1 / 1 | 0.79 | 8 | 4 to 16 |"


def test_the_front_pages_table_is_what_its_script_writes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Row by row, but for the digits: the words, the units and how numbers are written."""
    monkeypatch.syspath_prepend(str(ROOT))
    from bench import front_page as front

    tracked = front.Tracked(1.2e-5, 3.4e-5, 0.0056, 0.00078)
    figures = front.Figures(1e-5, 2e-4, 3e-5, 4e-4, tracked, tracked, 5e-15, 6e-16, 7e-4, 4.0)
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    part = page.split("<!-- measured -->")[1].split("<!-- end of measured -->")[0]

    def without_digits(text: str) -> list[str]:
        cells = re.sub(r"\d+(\.\d+)?(e[-+]?\d+)?", lambda found: "E" if found[2] else "N", text).strip()
        return cells.splitlines()

    assert without_digits(part) == without_digits(front.table(figures))
    assert "| 1.2e-5 | 3.4e-5 | 0.56 % (0.078 %) |" in front.table(figures)


def test_the_base_is_told_as_a_share_of_its_way_everywhere() -> None:
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    assert [page.name for page in pages if "share of the jump" in page.read_text(encoding="utf-8")] == []
