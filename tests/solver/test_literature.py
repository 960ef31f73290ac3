"""Problems from the literature and closed forms that took the solver most to learn: motions and static ones.

Each has its source in ``tests/problems/literature/expected.json``.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import stc

PROBLEMS = Path(__file__).parents[1] / "problems" / "literature"
EXPECTED: dict[str, dict[str, Any]] = json.loads((PROBLEMS / "expected.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", sorted(EXPECTED))
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_problem_from_the_literature(name: str) -> None:
    expected = EXPECTED[name]
    solution = stc.load(PROBLEMS / name).solve(max_iterations=1500)
    assert solution.status == expected["kind"]
    if expected["kind"] == "optimal":
        values = [expected["objective"], *expected.get("other_local_minima", [])]
        assert any(abs(solution.objective - f) <= expected["tol"] * max(1.0, abs(f)) for f in values)
        assert solution.violation <= 1e-6


def test_every_problem_has_its_expectation() -> None:
    assert set(EXPECTED) == {path.name for path in PROBLEMS.glob("*.stc")}


def test_published_values() -> None:
    """Where the literature gives a value, another grid or method changes its late digits only."""
    for name, expected in EXPECTED.items():
        if "published" in expected:
            assert expected["objective"] == pytest.approx(expected["published"], rel=1e-3), name
