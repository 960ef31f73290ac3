"""Solution files that were cut off, at whatever place, are refused in plain words; older ones are read."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import stc
from stc.errors import SolutionError
from stc.solution import Solution, read

SPEC = """
constants: n = 6; variables: x; jumps: [3]: x'';
constraints: [0]: x; x'; [n]: x = 1/3; x';
objective: integral(x''^2); method: hermite-simpson;
"""


@pytest.fixture(scope="module")
def solution() -> Solution:
    return stc.load(SPEC).solve()


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_a_file_cut_anywhere_is_refused_in_plain_words(
    solution: Solution, tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"a{suffix}"
    solution.save(path)
    whole = path.read_bytes()
    np.testing.assert_array_equal(read(path)["x"], solution["x"])
    for length in {*range(0, len(whole), 41), *range(len(whole) - 120, len(whole))}:
        path.write_bytes(whole[:length])
        with pytest.raises(SolutionError) as caught:
            read(path)
        message = str(caught.value)
        assert any(word in message for word in ("damaged", "not a solution file"))
        for raw in ("inhomogeneous", "delimiter", "char ", "JSON", "zip", "float:", "array", "Expecting"):
            assert raw not in message


def test_a_table_that_lost_whole_rows_is_refused(solution: Solution, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    solution.save(path)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:-1]))
    with pytest.raises(SolutionError, match="rows are missing"):
        read(path)


def test_files_from_before_rows_were_counted_are_read(solution: Solution, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    solution.save(path)
    first, rest = path.read_text().split("\n", 1)
    facts = json.loads(first.removeprefix("# facts "))
    assert facts.pop("rows") == 7 + 6 + 1  # frames, midpoints, and frame 3 twice
    path.write_text(f"# facts {json.dumps(facts)}\n{rest}")
    np.testing.assert_array_equal(read(path)["x"], solution["x"])
