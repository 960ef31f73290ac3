"""Where the iteration stalls near a solution: what is left to gain is not given up."""

from __future__ import annotations

from pathlib import Path

import pytest

import stc

CRANE = Path(__file__).parents[1] / "problems" / "literature" / "crane_in_least_time.stc"


@pytest.mark.parametrize("shift", range(-30, -10, 2))
def test_a_stall_with_products_left_is_not_the_end(shift: int, tmp_path: Path) -> None:
    """From some of these guesses the first attempt stalls at products of 5e-7, with 1e-5 of the time to gain."""
    text = CRANE.read_text(encoding="utf-8")
    assert "T = 5;" in text
    spec = tmp_path / "crane.stc"
    spec.write_text(text.replace("T = 5;", f"T = {5 + 1e-7 * shift!r};"), encoding="utf-8")
    solution = stc.load(spec).solve(max_iterations=1500)
    assert solution.status == "optimal"
    assert solution.objective == pytest.approx(3.46511214, rel=1e-6)
