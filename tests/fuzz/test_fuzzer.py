"""The fuzzer sees what it looks for, and makes the same cases from the same seed."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from fuzz import worker
from fuzz.campaign import campaign
from fuzz.cases import Case, case, corpus


def _raises(words: list[str]) -> int:
    raise ValueError("never handled")


def _steers(words: list[str]) -> int:
    print("\x1b[31m")
    return 0


def _warns(words: list[str]) -> int:
    print("note: overflow encountered in divide", file=sys.stderr)
    return 0


def _loses(words: list[str]) -> int:
    Path("spec.stc").unlink()
    return 0


def _spoils(words: list[str]) -> int:
    Path("out.npz").write_bytes(b"PK half")
    return 0


def _leaves(words: list[str]) -> int:
    Path(".out.1-00000000.tmp.npz").touch()
    return 0


@pytest.mark.parametrize(
    ("command", "wrong"),
    [
        (lambda words: 3, "exit status 3"),
        (_raises, "ValueError: never handled"),
        (_steers, "control characters"),
        (_warns, "encountered in"),
        (_loses, "spec.stc is lost"),
        (_spoils, "out.npz is no whole file"),
        (_leaves, "left behind"),
        (lambda words: 0, "no JSON object"),
    ],
)
def test_what_goes_wrong_is_seen(
    command: Callable[[list[str]], int], wrong: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker, "run", command)
    files = {"spec.stc": b"", "out.npz": b"PK"}
    words = ["--json"] if wrong.startswith("no JSON") else []
    (found,) = worker.carry_out(Case("options", files, words), tmp_path)
    assert wrong in found


def test_nothing_is_seen_where_nothing_is_wrong(tmp_path: Path) -> None:
    assert worker.carry_out(Case("spec", {"spec.stc": b"x"}, ["check", "spec.stc", "--json"]), tmp_path) == []


def test_a_seed_makes_the_same_cases_again(tmp_path: Path) -> None:
    given = corpus(tmp_path)
    cases = [case(5, number, given) for number in range(100)]
    assert cases == [case(5, number, given) for number in range(100)]
    assert cases != [case(6, number, given) for number in range(100)]
    assert {one.kind for one in cases} == {"spec", "solve", "solution", "model", "table", "data", "options"}


@pytest.mark.slow
def test_cases_are_carried_out_in_processes(tmp_path: Path) -> None:
    assert campaign(0, range(8), tmp_path / "work", tmp_path / "findings", processes=1) == []
