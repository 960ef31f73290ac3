"""Static problems with known answers: Hock and Schittkowski, Schittkowski, CUTEst, and made to be difficult."""

from __future__ import annotations

import json
from pathlib import Path
from statistics import median
from typing import Any

import pytest

import stc

PROBLEMS = Path(__file__).parents[1] / "problems" / "nlp"
EXPECTED: dict[str, dict[str, Any]] = json.loads((PROBLEMS / "expected.json").read_text(encoding="utf-8"))
ITERATIONS: dict[str, int] = {}


@pytest.mark.parametrize("name", sorted(EXPECTED))
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_known_problem(name: str) -> None:
    expected = EXPECTED[name]
    solution = stc.load(PROBLEMS / name).solve()
    if expected.get("local_infeasibility_is_acceptable") and solution.status == "infeasible":
        return
    assert solution.status == expected["kind"]
    if expected["kind"] == "optimal":
        ITERATIONS[name] = solution.iterations
        values = [expected["objective"], *expected.get("other_local_minima", [])]
        assert any(abs(solution.objective - f) <= expected["tol"] * max(1.0, abs(f)) for f in values)
        assert solution.violation <= 1e-7


def test_few_iterations_in_the_median() -> None:
    """IPOPT needs 11 on those of this sample that it solves."""
    assert len(ITERATIONS) < 40 or median(ITERATIONS.values()) <= 13
